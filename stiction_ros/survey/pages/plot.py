"""Figures of curves over time as SVG that takes its colours from the page and can be zoomed."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.signals.holds import stretches
from stiction_ros.survey.pages.frame import text

WIDTH, HEIGHT = 960, 240
LEFT, RIGHT, TOP, BOTTOM = 72, 8, 8, 32
"""Size of a figure and its margins, units of its own: a phone shows it at a third, and the figures
on its axes twice as large."""

MOST = 3000
"""Points of a curve; of a longer one the lowest and highest of each stretch are kept."""

ROOM = 0.04
"""Share of the range that is left free above and below."""

SCRIPT = """
for (const figure of document.querySelectorAll("figure.plot[data-low]")) {
  const svg = figure.querySelector("svg"), area = svg.querySelector("svg");
  const low = +figure.dataset.low, high = +figure.dataset.high, left = +figure.dataset.left,
    wide = +figure.dataset.wide, whole = area.getAttribute("viewBox").split(" ").map(Number);
  const ticks = svg.querySelector("g.x"), again = figure.querySelector("button");
  let a = low, b = high, from = null;
  const draw = () => {
    const scale = whole[2] / (high - low);
    area.setAttribute("viewBox",
      [(a - low) * scale, whole[1], (b - a) * scale, whole[3]].join(" "));
    let step = Math.pow(10, Math.floor(Math.log10((b - a) / 3)));
    if ((b - a) / step > 12) step *= 2.5;
    if ((b - a) / step > 8) step *= 2;
    const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    ticks.textContent = "";
    for (let k = Math.ceil(a / step - 1e-9); k * step <= b + 1e-9 * step; k++) {
      const tick = document.createElementNS("http://www.w3.org/2000/svg", "text");
      tick.setAttribute("x", left + wide * (k * step - a) / (b - a));
      tick.setAttribute("y", ticks.dataset.y);
      tick.setAttribute("text-anchor", "middle");
      tick.textContent = (k * step).toFixed(digits);
      ticks.append(tick);
    }
    again.hidden = a === low && b === high;
  };
  const at = event => {
    const box = svg.getBoundingClientRect();
    const x = (event.clientX - box.left) * svg.viewBox.baseVal.width / box.width;
    return a + (b - a) * Math.min(Math.max((x - left) / wide, 0), 1);
  };
  svg.addEventListener("pointerdown", event => { from = at(event); });
  svg.addEventListener("pointerup", event => {
    if (from === null) return;
    const to = at(event), least = (high - low) / 200;
    if (Math.abs(to - from) > least) { [a, b] = [Math.min(from, to), Math.max(from, to)]; draw(); }
    from = null;
  });
  svg.addEventListener("wheel", event => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    const middle = at(event), factor = event.deltaY > 0 ? 1.25 : 0.8;
    a = Math.max(low, middle - (middle - a) * factor);
    b = Math.min(high, middle + (b - middle) * factor);
    draw();
  }, { passive: false });
  again.addEventListener("click", () => { [a, b] = [low, high]; draw(); });
}
"""


@dataclasses.dataclass(frozen=True)
class Curve:
    """A curve: the word beside its colour, the class that colours it, and its values, (N,)."""

    name: str
    kind: str
    values: FloatArray
    steps: bool = False


def over_time(title: str, time: FloatArray, unit: str, curves: Sequence[Curve], axis: str) -> str:
    """Return a figure of curves over one time.

    Args:
        title: below the figure.
        time: shape (N,), increasing.
        unit: of time.
        curves: values that are not finite leave a gap.
        axis: name and unit of what goes up, HTML.
    """
    low, high = _range([curve.values for curve in curves])
    wide, tall = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM
    begin, end = float(time[0]), float(max(time[-1], time[0] + 1e-9))
    lines = []
    for curve in curves:
        x = (time - begin) / (end - begin) * wide
        y = (high - curve.values) / (high - low) * tall
        for part in _parts(x, y, curve.steps):
            lines.append(f'<polyline class="{curve.kind}" points="{part}"/>')
    grid, labels = [], []
    for value in _ticks(low, high, 5):
        up = TOP + (high - value) / (high - low) * tall
        grid.append(
            f'<line class="grid" x1="{LEFT}" x2="{LEFT + wide}" y1="{up:.1f}" y2="{up:.1f}"/>'
        )
        labels.append(
            f'<text x="{LEFT - 6}" y="{up + 4:.1f}" text-anchor="end">{_label(value)}</text>'
        )
    across = "".join(
        f'<text x="{LEFT + wide * (value - begin) / (end - begin):.1f}" y="{HEIGHT - 8}" '
        f'text-anchor="middle">{_label(value)}</text>'
        for value in _ticks(begin, end, 8)
    )
    keys = "".join(
        f'<span><i class="{curve.kind}"></i>{text(curve.name)}</span>' for curve in curves
    )
    return (
        f'<figure class="plot" data-low="{begin:.9g}" data-high="{end:.9g}" data-left="{LEFT}" '
        f'data-wide="{wide}"><div class="key">{keys}<span class="soft">{axis}</span></div>'
        f'<button type="button" hidden>whole record</button>'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{text(title)}">'
        f'{"".join(grid)}<svg x="{LEFT}" y="{TOP}" width="{wide}" height="{tall}" '
        f'viewBox="0 0 {wide} {tall}" preserveAspectRatio="none">{"".join(lines)}</svg>'
        f'<rect class="frame" x="{LEFT}" y="{TOP}" width="{wide}" height="{tall}"/>'
        f'{"".join(labels)}<g class="x" data-y="{HEIGHT - 8}">{across}</g></svg>'
        f"<figcaption>{text(title)} Time in {text(unit)}; drag over a stretch to see it closer."
        "</figcaption></figure>"
    )


def against(title: str, op: FloatArray, stem: FloatArray, unit: str = "%") -> str:
    """Return the figure of the stem against OP, shape (N,) each, in ``unit``."""
    low, high = _range([op, stem])
    side = 300
    scale = (side - 52) / (high - low)

    def place(x: FloatArray, y: FloatArray) -> str:
        return _points(46 + (x - low) * scale, 6 + (high - y) * scale)

    ends = np.array([low, high])
    kept = slice(max(len(op) - MOST, 0), None)
    labels = ""
    for value in _ticks(low, high, 4):
        along = 46 + (value - low) * scale
        up = 6 + (high - value) * scale
        labels += (
            f'<text x="{along:.1f}" y="{side - 26}" text-anchor="middle">{_label(value)}</text>'
        )
        labels += f'<text x="40" y="{up + 4:.1f}" text-anchor="end">{_label(value)}</text>'
    inside = f"{side - 52}"
    return (
        f'<figure class="plot" style="max-width:420px"><svg viewBox="0 0 {side} {side}" role="img" '
        f'aria-label="{text(title)}"><rect class="frame" x="46" y="6" width="{inside}" '
        f'height="{inside}"/><polyline class="diagonal" points="{place(ends, ends)}"/>'
        f'<polyline class="stem" points="{place(op[kept], stem[kept])}"/>{labels}'
        f'<text x="{side / 2 + 20}" y="{side - 8}" text-anchor="middle">OP, {text(unit)}</text>'
        "</svg>"
        f"<figcaption>{text(title)}</figcaption></figure>"
    )


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
