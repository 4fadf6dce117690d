"""The look of all figures: one style, one set of colours, marks that come back everywhere."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import functools
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.pages.frame import SCROLLED, text

# Okabe and Ito's colours, told apart with every kind of colour vision.
BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#CC79A7",
    "#56B4E9",
)
INK, GREY, PALE = "#222222", "#767676", "#D9D9D9"
WIDTH = 10.0  # inches; at 150 dots per inch 1500 pixels
DPI = 150

_STYLE: Any = {
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 10,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E8E8E8",
    "grid.linewidth": 0.7,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "font.family": ["DejaVu Sans"],
    "font.size": 10,
    "legend.frameon": False,
    "legend.fontsize": 9,
    "lines.linewidth": 1.1,
    "lines.solid_capstyle": "round",
    "path.simplify": True,
}


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A figure with its file name (without ending), its heading and a caption of a sentence."""

    name: str
    title: str
    caption: str
    figure: Figure

    @functools.cached_property
    def png(self) -> bytes:
        """The figure as PNG of at most 128 colours, which line drawings do not miss."""
        with style():
            canvas: Any = FigureCanvasAgg(self.figure)  # type: ignore[no-untyped-call,unused-ignore]
            canvas.draw()
        pixels = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        target = io.BytesIO()
        pixels.quantize(128, dither=Image.Dither.NONE).save(target, "png", optimize=True)
        return target.getvalue()

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, folder: Path) -> Path:
        """Write the figure into a folder, by its name, and return the file."""
        path = folder / f"{self.name}.png"
        path.write_bytes(self.png)
        return path


@contextlib.contextmanager
def style() -> Iterator[None]:
    """Draw in the style of the reports."""
    with matplotlib.rc_context(_STYLE):
        yield


def panels(
    rows: int, height: float, columns: int = 1, ratios: Sequence[float] | None = None, **kwargs: Any
) -> tuple[Figure, Any]:
    """Return a figure and its axes, shape (rows, columns); ``height`` in inches."""
    figure = Figure(figsize=(WIDTH, height), dpi=DPI, layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, height_ratios=ratios, **kwargs)
    return figure, axes


@dataclasses.dataclass(frozen=True)
class TimeAxis:
    """The unit in which times are shown: s, min or h, as fits the span."""

    unit: str
    seconds: float

    @classmethod
    def spanning(cls, span: float) -> TimeAxis:
        """Return the unit for ``span`` seconds."""
        if span > 4 * 3600:
            return cls("h", 3600.0)
        if span > 20 * 60:
            return cls("min", 60.0)
        return cls("s", 1.0)

    def __call__(self, seconds: Any) -> Any:
        return np.asarray(seconds) / self.seconds

    @property
    def label(self) -> str:
        """The label of the axis."""
        return f"time since the first sample ({self.unit})"


def embedded(drawing: Drawing) -> str:
    """Return a figure with its picture inside the page."""
    data = base64.b64encode(drawing.png).decode("ascii")
    return (
        f'<figure id="{text(drawing.name)}">{SCROLLED}<img alt="{text(drawing.title)}" '
        f'src="data:image/png;base64,{data}"></div><figcaption><b>{text(drawing.title)}.</b> '
        f"{text(drawing.caption)}</figcaption></figure>"
    )


def legend(axis: Any, columns: int = 6) -> None:
    """Put the legend above the axes at the right, where it covers no data."""
    axis.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=1.8,
        columnspacing=1.4,
    )


def data_limits(axis: Any, values: Sequence[FloatArray], room: float = 0.06) -> None:
    """Show all finite ``values`` with a little room."""
    joined = np.concatenate([np.ravel(v)[np.isfinite(np.ravel(v))] for v in values])
    if joined.size == 0:
        return
    low, high = float(joined.min()), float(joined.max())
    slack = room * (high - low) or 1.0
    axis.set_ylim(low - slack, high + slack)
