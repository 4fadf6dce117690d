"""What each effect does to PV, and what would decide between rivals, in pictures."""

from __future__ import annotations

import numpy as np

from stiction_ros.discrepancy import Discrepancy, FoundEffect, GapVerdict
from stiction_ros.discrepancy.answer.preview import Preview
from stiction_ros.discrepancy.gap.measure import levelled
from stiction_ros.report.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILION,
    Drawing,
    TimeAxis,
    legend,
    panels,
)
from stiction_ros.report.gap.words import called, figures_with_units, place_of, word_of
from stiction_ros.report.page import card, number

WINDOW = 400  # samples that are drawn, where an effect moves PV most
STYLES = ("-", "--", ":", "-.", (0, (1, 3)))
COLOURS = (BLUE, VERMILION, GREEN, ORANGE, INK)


def effect_card(effect: FoundEffect) -> str:
    """Return the box of one effect: place, law, figures with units, and why it."""
    lines = figures_with_units(effect)
    if effect.alternatives:
        others = " or ".join(called(*name) for name in effect.alternatives)
        lines.append(f"or {others}: these records do not tell them apart")
    if np.isfinite(effect.closed):
        lines.append(f"closes {100.0 * effect.closed:.0f} % of the gap by itself")
    if effect.sentence:
        lines.append(f"{effect.sentence}.")
    kind = "bad" if effect.verdict is GapVerdict.NAMED else "open"
    law = "" if effect.law is None else f" (law {effect.law})"
    return card(kind, place_of(effect.place), word_of(effect.effect) + law, "\n".join(lines))


def effect_drawings(found: Discrepancy) -> list[Drawing]:
    """Return a picture of what each effect does to the output that it moves most."""
    drawings = []
    for k, effect in enumerate(found.effects):
        if effect.moves is None or not float(np.ptp(effect.moves)) > 0.0:
            continue
        drawings.append(_effect(found, effect, k))
    return drawings


def _effect(found: Discrepancy, effect: FoundEffect, k: int) -> Drawing:
    assert effect.moves is not None
    base = levelled(found.base_after)
    scored = np.column_stack([blocks.scored for blocks in base.blocks])
    moves = np.where(scored, effect.moves, np.nan)
    i = int(np.argmax(np.nanstd(moves, axis=0)))
    rows, name = _liveliest(moves[:, i]), found.model_before.outputs[i]
    pv = base.run.runs.pv[rows, i]
    with_it = np.where(scored[rows, i], pv - base.noise[i].residual[rows], np.nan)
    seconds = np.arange(rows.start, rows.stop) * found.runs.sample_time
    axis_of_time = TimeAxis.spanning(float(seconds[-1]))
    figure, axes = panels(1, 3.4)
    axis, at = axes[0, 0], axis_of_time(seconds)
    axis.plot(at, pv, color=GREY, linewidth=4.0, alpha=0.5, label=f"{name} measured")
    axis.plot(at, with_it - moves[rows, i], color=ORANGE, label="free run without it")
    axis.plot(at, with_it, color=BLUE, label="free run with it")
    axis.set_ylabel(name)
    axis.set_xlabel(axis_of_time.label)
    legend(axis)
    title = called(effect.place, effect.effect)
    caption = (
        f"The {rows.stop - rows.start} samples in which it moves {name} most. Both free runs are "
        "driven by the recorded OP alone."
    )
    return Drawing(f"effect_{k + 1}", f"What it does: {title}", caption, figure)


def _liveliest(moves: np.ndarray[tuple[int], np.dtype[np.float64]]) -> slice:
    """Return where a signal, NaN where it does not count, is farthest from its mean."""
    count = min(WINDOW, len(moves))
    squares = np.concatenate([[0.0], np.nancumsum((moves - np.nanmean(moves)) ** 2)])
    inside = squares[count:] - squares[:-count]
    first = int(np.argmax(inside))
    return slice(first, first + count)


def preview_drawing(preview: Preview) -> Drawing:
    """Return what each rival would show in the experiment that decides."""
    figure, axes = panels(4, 7.6, sharex=True)
    seconds = np.arange(len(preview.op)) * preview.sample_time
    axis_of_time = TimeAxis.spanning(float(seconds[-1]))
    at = axis_of_time(seconds)
    axes[0, 0].plot(at, preview.op, color=INK)
    axes[0, 0].set_ylabel(f"OP of {preview.valve} (%)")
    labels = ("stem (%)", f"{preview.output} shown", f"{preview.output} itself")
    for k, rival in enumerate(preview.rivals):
        for row, values in enumerate((rival.stem, rival.pv, rival.true), start=1):
            axes[row, 0].plot(
                at,
                values,
                color=COLOURS[k % len(COLOURS)],
                linestyle=STYLES[k % len(STYLES)],
                label=called(rival.place, rival.effect),
            )
    for row, label in enumerate(labels, start=1):
        axes[row, 0].set_ylabel(label)
    legend(axes[1, 0])
    axes[-1, 0].set_xlabel(axis_of_time.label)
    told = [
        label
        for label, signal in zip(labels, ("stem", "pv", "true"), strict=True)
        if _apart([getattr(rival, signal) for rival in preview.rivals])
    ]
    where = " and ".join(told) if told else "none of these signals"
    caption = (
        "OP moved by hand with the controller off: up, back, and one step, without noise. "
        f"The rivals differ in {where}; PV itself is what a second sensor would show."
    )
    return Drawing("preview", "What would decide: each rival in one experiment", caption, figure)


def _apart(signals: list[np.ndarray[tuple[int], np.dtype[np.float64]]]) -> bool:
    spread = max(float(np.ptp(each)) for each in signals)
    first = signals[0]
    return any(float(np.abs(each - first).max()) > 0.02 * max(spread, 1e-12) for each in signals)


def change_lines(found: Discrepancy) -> list[str]:
    """Return what of the process was changed, one line each."""
    lines = []
    for change in found.process_changes:
        low, high = change.interval
        if change.what == "delay":
            lines.append(
                f"{change.output}: dead time {number(change.value)} s longer than in the model "
                f"(95 % between {number(low)} and {number(high)})"
            )
            continue
        what = "gain"
        if change.model is not None:
            kind = "lead" if change.what == "lead" else "time constant"
            what = f"{kind} of {number(change.model)} s"
        lines.append(
            f"{change.output}: {what} {number(change.value)} times that of the model "
            f"(95 % between {number(low)} and {number(high)})"
        )
    return lines
