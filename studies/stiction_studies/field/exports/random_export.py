"""One loop written as any of thousands of exports, and what a reader must find in it.

Shape, clock, language, quality, unit of OP and jitter of the stamps are drawn independently.
"""

import dataclasses
import datetime
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from stiction_studies.field.kernels import FloatArray

ROWS = 400
STEPS = (0.0125, 0.5, 1.0, 2.0, 5.0, 10.0, 60.0)
"""Scans, s."""

SHAPES = ("single", "wide", "tall", "time_each", "file_each", "header_again", "spaces")
CLOCKS = (
    *("iso", "iso_z", "bracket", "european", "american", "month_name", "unpadded", "epoch_ms"),
    *("seconds", "autumn", "spring", "half_day"),
)
QUALITIES = ("none", "Quality", "Confidence", "IsGood", "Questionable", "Validity")
UNITS = ("%", "0-1", "mA", "psi")
JITTERS = ("none", "slight", "quarter", "one_late", "ten_late", "rounded", "holes")
MONTHS = {
    "en": "Jan Feb Mar Apr May Jun Jul Aug Sep Oct Nov Dec".split(),  # noqa: SIM905
    "de": "Jan Feb Mär Apr Mai Jun Jul Aug Sep Okt Nov Dez".split(),  # noqa: SIM905
    "fr": "janv févr mars avr mai juin juil août sept oct nov déc".split(),  # noqa: SIM905
    "it": "gen feb mar apr mag giu lug ago set ott nov dic".split(),  # noqa: SIM905
    "es": "ene feb mar abr may jun jul ago sep oct nov dic".split(),  # noqa: SIM905
    "pt": "jan fev mar abr mai jun jul ago set out nov dez".split(),  # noqa: SIM905
    "nl": "jan feb mrt apr mei jun jul aug sep okt nov dec".split(),  # noqa: SIM905
    "pl": "sty lut mar kwi maj cze lip sie wrz paź lis gru".split(),  # noqa: SIM905
}
TALL_HEADERS = (
    ("TagName", "Timestamp", "Value"),
    ("t_stamp", "tagpath", "floatvalue"),
    ("_time", "_field", "_value"),
    ("NAME", "IP_TREND_TIME", "IP_TREND_VALUE"),
    ("VarName", "TimeString", "VarValue"),
    ("a", "b", "c"),
)
TO_UNIT: dict[str, Callable[[FloatArray], FloatArray]] = {
    "%": lambda op: op,
    "0-1": lambda op: op / 100.0,
    "mA": lambda op: 4.0 + 0.16 * op,
    "psi": lambda op: 3.0 + 0.12 * op,
}
BAD = {"Quality": "Bad", "Confidence": "0", "IsGood": "False", "Questionable": "True"}
GOOD = {"Quality": "Good", "Confidence": "100", "IsGood": "True", "Questionable": "False"}


@dataclasses.dataclass(frozen=True)
class Drawn:
    """What one export is like."""

    shape: str
    clock: str
    language: str
    quality: str
    unit: str
    jitter: str
    step: float

    def __str__(self) -> str:
        return " ".join(str(value) for value in dataclasses.asdict(self).values())


@dataclasses.dataclass(frozen=True)
class Export:
    """An export and its truth.

    Attributes:
        drawn: what it is like.
        files: that were written.
        options: of the reader that a user would give: ``--time-unit`` and the like, by field.
        op, pv: values of each written row, OP in %, shape (N,).
        place: scan of each written row, counted from 0, shape (N,).
        bad: rows whose quality is bad, shape (N,).
        scan: mean scan, s.
    """

    drawn: Drawn
    files: tuple[Path, ...]
    op: FloatArray
    pv: FloatArray
    place: np.ndarray[tuple[int], np.dtype[np.intp]]
    bad: np.ndarray[tuple[int], np.dtype[np.bool_]]
    scan: float


def draw(random: np.random.Generator) -> Drawn:
    """Return what an export is like; combinations that nobody writes are drawn again."""

    def one(names: Sequence[str]) -> str:
        return str(names[int(random.integers(len(names)))])

    while True:
        drawn = Drawn(
            one(SHAPES), one(CLOCKS), one(tuple(MONTHS)), one(QUALITIES), one(UNITS), one(JITTERS),
            float(STEPS[int(random.integers(len(STEPS)))]),
        )  # fmt: skip
        of_hours = drawn.clock in ("autumn", "spring", "half_day")
        fine = drawn.step < 1.0 and drawn.clock not in ("iso", "seconds", "epoch_ms")
        rounded = drawn.jitter == "rounded" and drawn.clock not in ("seconds",)
        beside = drawn.quality != "none" and drawn.shape in ("time_each", "header_again", "spaces")
        spaced = drawn.shape == "spaces" and drawn.clock not in ("seconds", "epoch_ms")
        if not (fine or rounded or beside or spaced or (of_hours and drawn.step < 10.0)):
            return drawn


def write_random_export(seed: int, folder: Path) -> Export:
    """Write the export of a seed into an empty folder and return its truth."""
    random = np.random.default_rng([seed, 77])
    drawn = draw(random)
    place, time, scan = _times(random, drawn)
    op, pv = _signals(random, int(place[-1]) + 1)
    op, pv = op[place], pv[place]
    bad = np.zeros(len(place), dtype=np.bool_)
    if drawn.quality != "none":
        bad[random.choice(np.arange(20, len(place) - 20), 12, replace=False)] = True
    stamps = _stamps(drawn, time)
    shown_op = [f"{value:.7g}" for value in TO_UNIT[drawn.unit](op)]
    shown_pv = [f"{3.0 * value + 900.0:.7g}" if b else f"{value:.7g}"
                for value, b in zip(pv, bad, strict=True)]  # fmt: skip
    files = _write(random, drawn, folder, stamps, shown_op, shown_pv, bad)
    return Export(drawn, files, op, pv, place, bad, scan)


def _signals(random: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    """Return OP, %, and PV of a loop, no two values alike."""
    walk = np.cumsum(random.standard_normal(count)) * 0.4
    op = 50.0 + 15.0 * np.sin(np.arange(count) / 23.0) + np.clip(walk, -20.0, 20.0)
    pv = np.zeros(count)
    for k in range(1, count):
        pv[k] = 0.9 * pv[k - 1] + 0.1 * (op[k - 1] - 50.0)
    pv += 200.0 + 0.3 * random.standard_normal(count)
    return np.round(op, 5), np.round(pv, 4)


def _times(
    random: np.random.Generator, drawn: Drawn
) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], FloatArray, float]:
    """Return the scan of each row, its time in s since the first, and the mean scan."""
    place = np.arange(ROWS)
    if drawn.jitter == "holes":
        gone = random.choice(np.arange(5, ROWS - 5), 6, replace=False)
        place = np.setdiff1d(place, gone)
    time = drawn.step * place.astype(float)
    late = {"one_late": 1, "ten_late": 10}.get(drawn.jitter, 0)
    rows = random.choice(np.arange(5, len(place) - 5), late, replace=False)
    time[rows] += 0.4 * drawn.step
    share = {"slight": 0.08, "quarter": 0.25}.get(drawn.jitter, 0.0)
    time[1:-1] += drawn.step * random.uniform(-share, share, len(time) - 2)
    if drawn.jitter == "rounded":
        time = np.round(time / (0.8 * drawn.step)) * 0.8 * drawn.step
    return place.astype(np.intp), time, float(time[-1] / place[-1])


def _stamps(drawn: Drawn, time: FloatArray) -> list[str]:
    """Return the time of each row as text."""
    if drawn.clock == "seconds":
        return [f"{seconds:.6g}" for seconds in time]
    start = {
        "autumn": datetime.datetime(2024, 10, 27, 2, 40),
        "spring": datetime.datetime(2024, 3, 31, 1, 40),
        "half_day": datetime.datetime(2024, 5, 14, 9, 20),
    }.get(drawn.clock, datetime.datetime(2024, 5, 14, 9, 20))
    if drawn.clock == "epoch_ms":
        epoch = start.replace(tzinfo=datetime.UTC).timestamp()
        return [f"{round(1e3 * (epoch + seconds))}" for seconds in time]
    change = {"autumn": -3600.0, "spring": 3600.0}.get(drawn.clock, 0.0)
    moved = np.where(time >= 1200.0, time + change, time)  # the clock changes at 03:00 or 02:00
    return [_stamp(drawn, start + datetime.timedelta(seconds=float(s))) for s in moved]


def _stamp(drawn: Drawn, at: datetime.datetime) -> str:
    fine = f".{at.microsecond // 1000:03d}" if at.microsecond else ""
    half, mark = at.hour % 12 or 12, "PM" if at.hour > 11 else "AM"
    if drawn.clock == "european":
        return f"{at:%d.%m.%Y %H:%M:%S}{fine}"
    if drawn.clock == "american":
        return f"{at:%m/%d/%Y} {half}:{at:%M:%S}{fine} {mark}"
    if drawn.clock == "half_day":
        return f"{at:%Y-%m-%d} {half:02d}:{at:%M:%S}{fine}"
    if drawn.clock == "month_name":
        return f"{at.day:02d}-{MONTHS[drawn.language][at.month - 1]}-{at:%Y %H:%M:%S}{fine}"
    if drawn.clock == "unpadded":
        return f"{at.year}-{at.month}-{at.day} {at.hour}:{at.minute}:{at.second}{fine}"
    end = {"iso_z": "Z", "bracket": " [Europe/Berlin]"}.get(drawn.clock, "")
    return f"{at:%Y-%m-%d %H:%M:%S}{fine}{end}"


def _write(
    random: np.random.Generator,
    drawn: Drawn,
    folder: Path,
    stamps: Sequence[str],
    op: Sequence[str],
    pv: Sequence[str],
    bad: np.ndarray[tuple[int], np.dtype[np.bool_]],
) -> tuple[Path, ...]:
    unit = "" if drawn.unit == "%" else f" [{drawn.unit}]"
    words = [_word(drawn.quality, bool(b)) for b in bad]
    there = drawn.quality != "none"
    path = folder / "FIC101.csv"
    if drawn.shape in ("single", "spaces"):
        between = "   " if drawn.shape == "spaces" else ","
        bare = f"OP{unit}" if drawn.shape == "single" else f"OP{unit.replace(' ', '')}"
        rows = [["t" if drawn.clock == "seconds" else "Time", bare, "PV", *[drawn.quality] * there]]
        rows += [[s, u, y, *[w] * there] for s, u, y, w in zip(stamps, op, pv, words, strict=True)]
        return (_text(path, rows, between),)
    if drawn.shape == "header_again":
        first = [["Time", f"OP{unit}", "PV"]]
        first += [list(row) for row in zip(stamps[:250], op[:250], pv[:250], strict=True)]
        first += [["Time", "PV", f"OP{unit}"]]
        first += [list(row) for row in zip(stamps[250:], pv[250:], op[250:], strict=True)]
        return (_text(path, first),)
    tags = [f"FIC101.OP{unit}", "FIC101.PV"]
    if drawn.shape == "wide":
        other = [f"{40.0 + 0.01 * k:.6g}" for k in range(len(op))]
        rows = [["Timestamp", *tags, "TIC7.OP", "TIC7.PV", *[drawn.quality] * there]]
        rows += [
            [s, u, y, o, f"{float(o) / 3.0:.6g}", *[w] * there]
            for s, u, y, o, w in zip(stamps, op, pv, other, words, strict=True)
        ]
        return (_text(folder / "plant.csv", rows),)
    if drawn.shape == "time_each":
        rows = [["Time", tags[0], "Time", tags[1]]]
        rows += [[s, u, s, y] for s, u, y in zip(stamps, op, pv, strict=True)]
        return (_text(path, rows),)
    if drawn.shape == "file_each":
        found = []
        for tag, column in zip(("FIC101.OP", "FIC101.PV"), (op, pv), strict=True):
            own = unit if tag.endswith("OP") else ""
            rows = [["Time", f"{tag}{own}", *[drawn.quality] * there]]
            rows += [[s, v, *[w] * there] for s, v, w in zip(stamps, column, words, strict=True)]
            found.append(_text(folder / f"{tag}.csv", rows))
        return tuple(found)
    names = TALL_HEADERS[int(random.integers(len(TALL_HEADERS)))]
    header, first_tag = list(names), names[0] not in ("t_stamp", "_time")
    rows = [[*header, *[drawn.quality] * there, *["Unit"] * bool(unit)]]
    units = {"FIC101.OP": unit.strip(" []"), "FIC101.PV": "kg/h"}
    pairs = ((("FIC101.OP", u), ("FIC101.PV", y)) for u, y in zip(op, pv, strict=True))
    for s, both, w in zip(stamps, pairs, words, strict=True):
        for tag, value in both:
            cells = [tag, s, value] if first_tag else [s, tag, value]
            rows.append([*cells, *[w] * there, *[units[tag]] * bool(unit)])
    return (_text(folder / "export.csv", rows),)


def _word(quality: str, bad: bool) -> str:
    if quality == "Validity":
        return "Invalid" if bad else "Valid"
    return (BAD if bad else GOOD).get(quality, "")


def _text(path: Path, rows: Sequence[Sequence[str]], between: str = ",") -> Path:
    lines = itertools.chain((between.join(row) for row in rows), [""])
    path.write_text("\n".join(lines), encoding="utf-8")
    return path
