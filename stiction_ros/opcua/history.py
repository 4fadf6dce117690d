"""History of tags (OPC UA part 11, raw values): read in pages, resumed, made into records."""

import asyncio
import dataclasses
import datetime
import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.modes import AUTOMATIC
from stiction_ros.opcua.loop_bridge import mode_text
from stiction_ros.opcua.sampling import JITTER, TagQuality, TagReading
from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.session import ANSWER, EPOCH, describe, node_ids, open_client, reading_of
from stiction_ros.opcua.tag_map import LoopTags
from stiction_ros.records import Record
from stiction_ros.records.record import Quality

if TYPE_CHECKING:
    from asyncua import Client, ua

PAGE = 10_000  # values asked for at once
LONGEST = 10_000_000  # samples of a record


@dataclasses.dataclass(frozen=True)
class Span:
    """A stretch of time, ns."""

    begin: int
    end: int


@dataclasses.dataclass(frozen=True)
class TagHistory:
    """What a server kept of one tag."""

    stamps: np.ndarray[Any, np.dtype[np.int64]]  # ns, rising, shape (K,)
    values: FloatArray  # NaN where the quality is not good, shape (K,)

    def at(self, times: np.ndarray[Any, np.dtype[np.int64]]) -> FloatArray:
        """Return the last values with stamps up to ``times`` (ns); NaN before the first."""
        if not len(self.stamps):
            return np.full(len(times), np.nan)
        rows = np.searchsorted(self.stamps, times, side="right") - 1
        return np.where(rows >= 0, self.values[np.maximum(rows, 0)], np.nan)


class HistoryFile:
    """Raw history of one tag in a text file that grows page by page.

    A line is ``stamp,value,quality``. What a broken run has left is read again, but for a last
    line that is not whole, and the reading goes on behind it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._done = path.with_suffix(".done")

    def begin(self, tag: str, span: Span) -> None:
        """Begin or go on; InputError when the file holds another tag or stretch."""
        title = f"# {tag} from {span.begin} to {span.end}\n"
        text = self.path.read_text(encoding="utf-8") if self.path.exists() else ""
        lines = text.splitlines(keepends=True)
        if not lines or not lines[0].endswith("\n"):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(title, encoding="utf-8")
            return
        if lines[0] != title:
            raise InputError(
                "holds other history", where=str(self.path), fix="choose another folder by --out"
            )
        if not lines[-1].endswith("\n"):
            self.path.write_text("".join(lines[:-1]), encoding="utf-8")

    @property
    def complete(self) -> bool:
        """Whether everything has been read."""
        return self._done.exists()

    def finish(self) -> None:
        """Note that everything has been read."""
        self._done.touch()

    def append(self, readings: list[TagReading]) -> None:
        """Add a page; a text stands there in quotes."""
        lines = [f"{one.stamp},{_shown(one)},{int(one.quality)}\n" for one in readings]
        with self.path.open("a", encoding="utf-8") as file:
            file.write("".join(lines))

    def read(self) -> TagHistory:
        """Return what there is; of equal stamps the last."""
        found: dict[int, float] = {}
        for stamp, value, quality in self._lines():
            good = quality == TagQuality.GOOD and not value.startswith('"')
            found[stamp] = float(value) if good else float("nan")
        stamps = np.array(sorted(found), dtype=np.int64)
        return TagHistory(stamps, np.array([found[int(stamp)] for stamp in stamps], dtype=float))

    def read_modes(self) -> tuple[np.ndarray[Any, np.dtype[np.int64]], list[str]]:
        """Return stamps, ns, and modes as text; those of bad quality are left out."""
        found: dict[int, str] = {}
        for stamp, value, quality in self._lines():
            if quality == TagQuality.GOOD:
                found[stamp] = mode_text(json.loads(value) if value[0] == '"' else float(value))
        stamps = sorted(found)
        return np.array(stamps, dtype=np.int64), [found[stamp] for stamp in stamps]

    @property
    def last(self) -> int | None:
        """Stamp of the last value, ns; None before the first."""
        lines = self._lines()
        return lines[-1][0] if lines else None

    def _lines(self) -> list[tuple[int, str, int]]:
        """Return stamp, value as it stands there, and quality of each line."""
        found = []
        for line in self.path.read_text(encoding="utf-8").splitlines()[1:]:
            stamp, _, rest = line.partition(",")
            value, _, quality = rest.rpartition(",")
            found.append((int(stamp), value, int(quality)))
        return found


def _shown(reading: TagReading) -> str:
    return json.dumps(reading.value) if isinstance(reading.value, str) else repr(reading.number)


async def fetch(
    url: str,
    credentials: Credentials,
    files: dict[str, HistoryFile],
    span: Span,
    progress: Callable[[float], None],
) -> None:
    """Read the history of tags into their files; what is there already is not read again.

    Raises:
        InputError: the server cannot be reached, refuses, or keeps no history of a tag.
    """
    from asyncua import ua

    try:
        client = await open_client(url, credentials)
    except (OSError, TimeoutError, ua.UaError) as error:
        raise InputError(describe(error), where=url) from None
    try:
        nodes = await node_ids(client, list(files))
        for number, (tag, file) in enumerate(files.items()):
            file.begin(tag, span)
            if not file.complete:
                await _fetch_tag(client, nodes[tag], file, span)
                file.finish()
            progress((number + 1) / len(files))
    except (OSError, TimeoutError, ua.UaError) as error:
        raise InputError(
            f"history of {tag} was not read to its end: {describe(error)}",
            where=url,
            fix="the same command goes on where it stopped",
        ) from None
    finally:
        await asyncio.wait_for(client.disconnect(), ANSWER)


async def _fetch_tag(client: "Client", node: "ua.NodeId", file: HistoryFile, span: Span) -> None:
    """Read page after page, by the server's continuation points or by the stamps."""
    from asyncua import ua

    where, point = client.get_node(node), None
    if file.last is None:
        file.append(await _in_force(where, span.begin))
    last = file.last
    since = span.begin if last is None else max(last, span.begin)
    while True:
        details = ua.ReadRawModifiedDetails(
            IsReadModified=False,
            StartTime=_moment(since),
            EndTime=_moment(span.end),
            NumValuesPerNode=PAGE,
            ReturnBounds=False,
        )
        result = await where.history_read(details, point)
        result.StatusCode.check()
        page = [reading_of(value, first=False) for value in result.HistoryData.DataValues]
        news = [one for one in page if one.stamp and (last is None or one.stamp > last)]
        file.append(news)
        last = news[-1].stamp if news else last
        point = result.ContinuationPoint
        if point is None:
            if len(page) < PAGE or not news or last is None:
                return
            since = last  # a server without continuation points


async def _in_force(where: Any, begin: int) -> list[TagReading]:
    """Return the last value before ``begin``, read backwards: it holds until the next one."""
    values = await where.read_raw_history(_moment(begin - 1000), EPOCH, 1, return_bounds=False)
    found = [reading_of(value, first=False) for value in values]
    return [one for one in found if 0 < one.stamp < begin][:1]


def record_of(tags: LoopTags, files: dict[str, HistoryFile], span: Span) -> Record:
    """Pair the history of a loop to its grid, by the rule of the live samples.

    PV and SP of a sample are the last values with stamps up to it (and a jitter of a tenth of a
    sample), OP is the last up to its middle. The grid begins with the first value of each PV;
    samples with a bad value are marked so.
    """
    jitter, half = tags.sample_ns // JITTER, tags.sample_ns // 2
    pv = [files[output.pv].read() for output in tags.outputs]
    op = [files[valve.op_read].read() for valve in tags.valves]
    names = [one.name for one in tags.outputs] + [one.name for one in tags.valves]
    for told, name in zip((*pv, *op), names, strict=True):
        if not len(told.stamps):
            raise InputError(f"no history of {name}", where=f"loop {tags.loop}")
    first = max(int(one.stamps[0]) for one in pv)
    first += max(-(-(span.begin - first) // tags.sample_ns), 0) * tags.sample_ns
    end = min(span.end, max(int(one.stamps[-1]) for one in (*pv, *op)))
    count = (end - first) // tags.sample_ns + 1
    if not 2 <= count <= LONGEST:
        raise InputError(f"{max(count, 0)} samples are no record", where=f"loop {tags.loop}")
    grid = first + tags.sample_ns * np.arange(count, dtype=np.int64)
    columns = {
        "op": np.column_stack([one.at(grid + half) for one in op]),
        "pv": np.column_stack([one.at(grid + jitter) for one in pv]),
    }
    if all(output.sp for output in tags.outputs):
        sp = [files[output.sp].read().at(grid + jitter) for output in tags.outputs]
        columns["sp"] = np.column_stack(sp)
    good = np.all([np.isfinite(values).all(axis=1) for values in columns.values()], axis=0)
    mask = np.where(good, Quality.GOOD, Quality.BAD).astype(np.uint8)
    return Record(
        tags.loop,
        tags.sample_time,
        tuple(valve.name for valve in tags.valves),
        tuple(output.name for output in tags.outputs),
        columns["op"],
        columns["pv"],
        columns.get("sp"),
        start=first / 1e9,
        mask=mask,
    )


def modes_of(tags: LoopTags, files: dict[str, HistoryFile], record: Record) -> list[str] | None:
    """Return the mode of the loop at each sample, empty where it is not known; None without one.

    That of a loop with several valves is the first that is not automatic.
    """
    grid = np.rint((record.start + record.time) * 1e9).astype(np.int64) + tags.sample_ns // JITTER
    found: list[list[str]] = []
    for valve in tags.valves:
        if valve.mode:
            stamps, words = files[valve.mode].read_modes()
            rows = np.searchsorted(stamps, grid, side="right") - 1
            found.append([words[row] if row >= 0 else "" for row in rows.tolist()])
    if not found:
        return None
    return [
        next((w for w in words if not AUTOMATIC.fullmatch(w)), words[0])
        for words in zip(*found, strict=True)
    ]


def _moment(stamp: int) -> datetime.datetime:
    return EPOCH + datetime.timedelta(microseconds=stamp // 1000)
