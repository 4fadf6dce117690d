"""History of tags (OPC UA part 11, raw values): read in pages, kept, made into records."""

import asyncio
import dataclasses
import datetime
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
from stiction_ros.texts import json_text

Stamps = NDArray[np.int64]  # ns

PAGE = 10_000  # values asked for at once
LONGEST = 10_000_000  # samples of a record


@dataclasses.dataclass(frozen=True)
class Span:
    """A stretch of time, ns."""

    begin: int
    end: int


History = Sequence[TagReading]  # what a server kept of one tag; stamps rise, of equal ones the last


def numbers_at(history: History, times: Stamps) -> FloatArray:
    """Return the last values with stamps up to ``times``; NaN before the first, and if not good."""
    good = (one.number if one.quality is TagQuality.GOOD else np.nan for one in history)
    return np.array([np.nan, *good])[_counted(history, times)]


def modes_at(history: History, times: Stamps) -> list[str]:
    """Return the last modes of good quality with stamps up to ``times``; empty before the first."""
    good = [one for one in history if one.quality is TagQuality.GOOD]
    words = ["", *(mode_text(one.value) for one in good)]
    return [words[count] for count in _counted(good, times)]


def _counted(history: History, times: Stamps) -> Stamps:
    """Return how many values have stamps up to ``times``."""
    stamps = np.array([one.stamp for one in history], dtype=np.int64)
    return np.searchsorted(stamps, times, side="right")


def keep(path: Path, tag: str, span: Span, history: History) -> None:
    """Write the history of a tag; the file is there when all of it has been written."""
    told = [(one.stamp, one.value, int(one.quality)) for one in history]
    part = path.with_suffix(".part")
    part.parent.mkdir(parents=True, exist_ok=True)
    part.write_text(json_text([tag, span.begin, span.end, told], indent=None), encoding="utf-8")
    part.replace(path)


def kept(path: Path, tag: str, span: Span) -> History | None:
    """Return what :func:`keep` wrote, None without a file; InputError at other tags or times."""
    if not path.exists():
        return None
    *title, told = json.loads(path.read_text(encoding="utf-8"))
    if title != [tag, span.begin, span.end]:
        raise InputError(
            "holds other history", where=str(path), fix="choose another folder by --out"
        )
    return [TagReading(value, TagQuality(quality), stamp) for stamp, value, quality in told]


async def fetch(
    url: str,
    credentials: Credentials,
    files: Mapping[str, Path],
    span: Span,
    progress: Callable[[float], None],
) -> dict[str, History]:
    """Return the history of tags, each kept in its file; what is there is not read again.

    Raises:
        InputError: the server cannot be reached, refuses, or keeps no history of a tag.
    """
    from asyncua import ua

    try:
        client = await open_client(url, credentials)
    except (OSError, TimeoutError, ua.UaError) as error:
        raise InputError(describe(error), where=url) from None
    found: dict[str, History] = {}
    tag = "all tags"
    try:
        nodes = await node_ids(client, list(files))
        for tag, path in files.items():
            history = kept(path, tag, span)
            if history is None:
                history = await _fetch_tag(client.get_node(nodes[tag]), span)
                keep(path, tag, span, history)
            found[tag] = history
            progress(len(found) / len(files))
    except (OSError, TimeoutError, ua.UaError) as error:
        raise InputError(
            f"history of {tag} was not read to its end: {describe(error)}",
            where=url,
            fix="the same command goes on with this tag",
        ) from None
    finally:
        await asyncio.wait_for(client.disconnect(), ANSWER)
    return found


async def _fetch_tag(node: Any, span: Span) -> History:
    """Read page after page, by the server's continuation points or by the stamps."""
    from asyncua import ua

    found, point = await _in_force(node, span.begin), None
    since = span.begin
    while True:
        details = ua.ReadRawModifiedDetails(
            IsReadModified=False,
            StartTime=_moment(since),
            EndTime=_moment(span.end),
            NumValuesPerNode=PAGE,
            ReturnBounds=False,
        )
        result = await node.history_read(details, point)
        result.StatusCode.check()
        page = [reading_of(value, first=False) for value in result.HistoryData.DataValues]
        last = found[-1].stamp if found else 0
        news = sorted((one for one in page if one.stamp > last), key=lambda one: one.stamp)
        found += news
        point = result.ContinuationPoint
        if point is None:
            if len(page) < PAGE or not news:
                return found
            since = news[-1].stamp  # a server without continuation points


async def _in_force(where: Any, begin: int) -> list[TagReading]:
    """Return the last value before ``begin``, read backwards: it holds until the next one."""
    values = await where.read_raw_history(_moment(begin - 1000), EPOCH, 1, return_bounds=False)
    found = [reading_of(value, first=False) for value in values]
    return [one for one in found if 0 < one.stamp < begin][:1]


def record_of(tags: LoopTags, found: Mapping[str, History], span: Span) -> Record:
    """Pair the history of a loop to its grid, by the rule of the live samples.

    PV and SP of a sample are the last values with stamps up to it (and a jitter of a tenth of a
    sample), OP is the last up to its middle. The grid begins with the first value of each PV;
    samples with a bad value are marked so.
    """
    jitter, half = tags.sample_ns // JITTER, tags.sample_ns // 2
    pv = [found[output.pv] for output in tags.outputs]
    op = [found[valve.op_read] for valve in tags.valves]
    names = [one.name for one in tags.outputs] + [one.name for one in tags.valves]
    for told, name in zip((*pv, *op), names, strict=True):
        if not told:
            raise InputError(f"no history of {name}", where=f"loop {tags.loop}")
    first = max(history[0].stamp for history in pv)
    first += max(-(-(span.begin - first) // tags.sample_ns), 0) * tags.sample_ns
    end = min(span.end, max(history[-1].stamp for history in (*pv, *op)))
    count = (end - first) // tags.sample_ns + 1
    if not 2 <= count <= LONGEST:
        raise InputError(f"{max(count, 0)} samples are no record", where=f"loop {tags.loop}")
    grid = first + tags.sample_ns * np.arange(count, dtype=np.int64)
    columns = {
        "op": np.column_stack([numbers_at(history, grid + half) for history in op]),
        "pv": np.column_stack([numbers_at(history, grid + jitter) for history in pv]),
    }
    if all(output.sp for output in tags.outputs):
        sp = [numbers_at(found[output.sp], grid + jitter) for output in tags.outputs]
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


def modes_of(tags: LoopTags, found: Mapping[str, History], record: Record) -> list[str] | None:
    """Return the mode of the loop at each sample, empty where it is not known; None without one.

    That of a loop with several valves is the first that is not automatic.
    """
    grid = np.rint((record.start + record.time) * 1e9).astype(np.int64) + tags.sample_ns // JITTER
    modes = [modes_at(found[valve.mode], grid) for valve in tags.valves if valve.mode]
    if not modes:
        return None
    return [
        next((w for w in words if not AUTOMATIC.fullmatch(w)), words[0])
        for words in zip(*modes, strict=True)
    ]


def _moment(stamp: int) -> datetime.datetime:
    return EPOCH + datetime.timedelta(microseconds=stamp // 1000)
