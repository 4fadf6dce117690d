"""Figures as SVG that take their colours from the page; those over time can be zoomed."""

import dataclasses
import datetime
import itertools
import math
from collections.abc import Sequence
from importlib import resources

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.intake.tables.clock import DATED
from stiction_ros.pages.frame import text, words
from stiction_ros.signals.holds import stretches
from stiction_ros.texts import HOUR

# units across the area of a figure over time, which is as wide as its page, and its height, px
WIDE, TALL = 1000, 240
SIDE = 300  # width and height of a figure that has no time
MOST = 3000  # points of a curve; of a longer one the lowest and highest of each stretch are kept
ROOM = 0.04  # share of the range that is left free above and below
KINDS = ("pv", "op", "stem", "free", "sp", "ink")  # colours of curves that are of one kind

SCRIPT = resources.files("stiction_ros.pages").joinpath("plot.js").read_text("utf-8")
"""Writes the times below each figure over time, and zooms."""


@dataclasses.dataclass(frozen=True)
class Curve:
    """A curve: the word beside its colour, the class that colours it, and its values, (N,)."""

    name: str
    kind: str
    values: FloatArray
    steps: bool = False


def over_time(
    title: str,
    time: FloatArray,
    curves: Sequence[Curve],
    axis: str,
    start: float = 0.0,
    shade: Sequence[tuple[float, float]] = (),
    *,
    marks: Sequence[float] = (),
) -> str:
    """Return a figure of curves over one time, whose axis the script of the page writes and zooms.

    Args:
        title: below the figure.
        time: s since the first sample, shape (N,), increasing.
        curves: values that are not finite leave a gap.
        axis: name and unit of what goes up, HTML.
        start: of the record; dates are shown where it is one, s since 1970.
        shade: begin and end of stretches that are shaded, s of ``time``.
        marks: where a vertical line stands, s of ``time``.
    """
    low, high = _range([curve.values for curve in curves])
    span = float(max(time[-1] - time[0], 1e-9))
    dated = DATED[0] <= start <= DATED[1]
    unit, size = ("date", 1.0) if dated else _unit(span)
    begin = (start if dated else 0.0) + float(time[0]) / size
    end = begin + span / size
    scale = WIDE / span
    lines = [
        f'<rect x="{(a - time[0]) * scale:.1f}" y="0" height="{TALL}" class="shade" '
        f'width="{(b - a) * scale:.1f}"/>'
        for a, b in shade
    ]
    lines += [
        f'<polyline class="mark" points="{x:.1f},0 {x:.1f},{TALL}"/>'
        for x in [(at - time[0]) * scale for at in marks]
    ]
    for curve in curves:
        y = (high - curve.values) / (high - low) * TALL
        for part in _parts((time - time[0]) * scale, y, curve.steps):
            lines.append(f'<polyline class="{curve.kind}" points="{part}"/>')
    grid, labels = [], []
    for value in _ticks(low, high, 5):
        up = (high - value) / (high - low) * TALL
        grid.append(f'<line class="grid" x1="0" x2="100%" y1="{up:.1f}" y2="{up:.1f}"/>')
        labels.append(f'<text x="-6" y="{up + 4:.1f}" text-anchor="end">{_label(value)}</text>')
    short = {"hours": " h", "minutes": " min"}.get(unit, " s")
    told = f"Time from {_stamp(begin)} to {_stamp(end)}." if dated else f"Time in {unit}."
    return (
        f'<figure class="plot" data-low="{begin:.12g}" data-high="{end:.12g}" data-unit="{short}"'
        f"{' data-dated' * dated}>{_keys(curves, axis)}"
        f'<svg class="over" height="{TALL}" role="img" aria-label="{text(title)}">'
        f'{"".join(grid)}<svg width="100%" height="{TALL}" viewBox="0 0 {WIDE} {TALL}" '
        f'preserveAspectRatio="none">{"".join(lines)}</svg>'
        f'<rect class="frame" width="100%" height="{TALL}"/>'
        f'{"".join(labels)}<g class="x" data-y="{TALL + 18}"></g></svg>'
        f"<figcaption>{words(title)} {told}</figcaption></figure>"
    )


def against(
    title: str, curves: Sequence[tuple[FloatArray, Curve]], axes: tuple[str, str], *, equal: bool
) -> str:
    """Return a figure of curves over what is not a time.

    Args:
        title: below the figure.
        curves: each with what goes right, shape (N,), and what goes up.
        axes: name and unit of what goes right and of what goes up, HTML.
        equal: both have one scale, and the diagonal is drawn.
    """
    right, up = [x for x, _ in curves], [curve.values for _, curve in curves]
    across = _range([*right, *up] if equal else right)
    along = across if equal else _range(up)
    left, below = 46, 40
    wide, tall = SIDE - left - 14, SIDE - below - 6

    def place(x: FloatArray, y: FloatArray) -> str:
        return _points(
            left + (x - across[0]) / (across[1] - across[0]) * wide,
            6 + (along[1] - y) / (along[1] - along[0]) * tall,
        )

    ends = np.array(across)
    keys = [curve for _, curve in curves]
    lines = [f'<polyline class="{c.kind}" points="{place(x, c.values)}"/>' for x, c in curves]
    if equal:
        lines.insert(0, f'<polyline class="diagonal" points="{place(ends, ends)}"/>')
        keys.append(Curve("valve without friction", "diagonal", ends))
    for value in _ticks(*across, 4):
        x = left + (value - across[0]) / (across[1] - across[0]) * wide
        lines.append(
            f'<text x="{x:.1f}" y="{SIDE - below + 16}" text-anchor="middle">{_label(value)}</text>'
        )
    for value in _ticks(*along, 4):
        y = 6 + (along[1] - value) / (along[1] - along[0]) * tall
        lines.append(
            f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{_label(value)}</text>'
        )
    return (
        f'<figure class="plot square" style="max-width:460px">{_keys(keys, axes[1])}'
        f'<svg viewBox="0 0 {SIDE} {SIDE}" role="img" aria-label="{text(title)}">'
        f'<rect class="frame" x="{left}" y="6" width="{wide}" height="{tall}"/>{"".join(lines)}'
        f'<text x="{left + wide / 2}" y="{SIDE - 8}" text-anchor="middle">{axes[0]}</text></svg>'
        f"<figcaption>{words(title)}</figcaption></figure>"
    )


def _keys(curves: Sequence[Curve], axis: str) -> str:
    shown = "".join(
        f'<span><i class="{kind}"></i>{text(name)}</span>'
        for name, kind in dict.fromkeys((curve.name, curve.kind) for curve in curves)
    )
    return f'<div class="key"><b class="soft">{axis}:</b>{shown}</div>'


def _unit(span: float) -> tuple[str, float]:
    """Return the unit of an axis of ``span`` seconds that bears no dates, and its size in s."""
    units = (("hours", HOUR), ("minutes", 60.0))
    return next(((word, size) for word, size in units if span > 4.0 * size), ("seconds", 1.0))


def _stamp(seconds: float) -> str:
    shown = datetime.datetime.fromtimestamp(seconds, datetime.UTC)
    return f"{shown:%Y-%m-%d %H:%M}" if seconds % 60.0 == 0.0 else f"{shown:%Y-%m-%d %H:%M:%S}"


def spark(values: Sequence[float], most: float) -> str:
    """Return a small line without axes, from 0 to ``most``: lines of one scale compare."""
    numbers = np.asarray(values, dtype=float)
    x = np.linspace(2.0, 90.0, len(numbers))
    y = 20.0 - 18.0 * np.clip(numbers / max(most, 1e-12), 0.0, 1.0)
    said = ", ".join(f"{value:.3g}" for value in numbers)
    return (
        f'<svg class="spark" viewBox="0 0 92 22" role="img" aria-label="{said}">'
        f'<polyline points="{_points(x, y)}"/></svg>'
    )


def _range(values: Sequence[FloatArray]) -> tuple[float, float]:
    joined = np.concatenate([np.ravel(each)[np.isfinite(np.ravel(each))] for each in values])
    if not len(joined):
        return 0.0, 1.0
    low, high = float(joined.min()), float(joined.max())
    room = ROOM * (high - low) or max(abs(high), 1.0) * 1e-3
    return low - room, high + room


def _parts(x: FloatArray, y: FloatArray, steps: bool) -> list[str]:
    """Return the points of each stretch without a gap."""
    begins, ends = stretches(np.isfinite(y))
    found = []
    for first, last in zip(begins.tolist(), ends.tolist(), strict=True):
        a, b = _thinned(x[first:last], y[first:last], MOST * (last - first) // len(x) + 4)
        if steps:
            a, b = np.repeat(a, 2)[1:], np.repeat(b, 2)[:-1]
        found.append(_points(a, b))
    return found


def _thinned(x: FloatArray, y: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Return at most about ``most`` points: of each stretch the lowest and the highest."""
    if len(x) <= most:
        return x, y
    edges = np.linspace(0, len(x), max(most // 2, 1) + 1).astype(int)
    rows = []
    for a, b in itertools.pairwise(edges.tolist()):
        if b > a:
            rows += sorted({a + int(np.argmin(y[a:b])), a + int(np.argmax(y[a:b]))})
    return x[rows], y[rows]


def _points(x: FloatArray, y: FloatArray) -> str:
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x.tolist(), y.tolist(), strict=True))


def _ticks(low: float, high: float, wanted: int) -> list[float]:
    """Return round values between two ends, about as many as wanted."""
    rough = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * k for k in (1.0, 2.0, 2.5, 5.0, 10.0) if power * k >= rough * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _label(value: float) -> str:
    return f"{value:.6g}".replace("-", "−")
