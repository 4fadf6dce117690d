"""What each effect does to PV, and what would decide between rivals, in figures."""

from __future__ import annotations

import itertools

import numpy as np

from stiction_ros.discrepancy import Discrepancy, FoundEffect, GapVerdict
from stiction_ros.discrepancy.answer.preview import Preview
from stiction_ros.discrepancy.gap.measure import levelled
from stiction_ros.pages.frame import text
from stiction_ros.pages.plot import KINDS, Curve, over_time
from stiction_ros.report.gap.words import called, figures_with_units, place_of, word_of
from stiction_ros.report.page import card

WINDOW = 400  # samples that are drawn, where an effect moves PV most


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


def effect_figure(found: Discrepancy, effect: FoundEffect) -> str:
    """Return what an effect does to the output that it moves most; nothing where it moves none."""
    if effect.moves is None or not float(np.ptp(effect.moves)) > 0.0:
        return ""
    base = levelled(found.base_after)
    scored = np.column_stack([blocks.scored for blocks in base.blocks])
    moves = np.where(scored, effect.moves, np.nan)
    i = int(np.argmax(np.nanstd(moves, axis=0)))
    rows, name = _liveliest(moves[:, i]), found.model_before.outputs[i]
    pv = base.run.runs.pv[rows, i]
    with_it = np.where(scored[rows, i], pv - base.noise[i].residual[rows], np.nan)
    return over_time(
        f"What it does: {called(effect.place, effect.effect)}, in the {rows.stop - rows.start} "
        f"samples in which it moves {name} most. Both free runs are driven by the recorded OP "
        "alone.",
        np.arange(float(rows.start), rows.stop) * found.runs.sample_time,
        [
            Curve(f"{name}, measured", "whole", pv),
            Curve("free run without it", "op", with_it - moves[rows, i]),
            Curve("free run with it", "pv", with_it),
        ],
        text(name),
    )


def _liveliest(moves: np.ndarray[tuple[int], np.dtype[np.float64]]) -> slice:
    """Return where a signal, NaN where it does not count, is farthest from its mean."""
    count = min(WINDOW, len(moves))
    squares = np.concatenate([[0.0], np.nancumsum((moves - np.nanmean(moves)) ** 2)])
    inside = squares[count:] - squares[:-count]
    first = int(np.argmax(inside))
    return slice(first, first + count)


def preview_figures(preview: Preview) -> str:
    """Return what each rival would show in the experiment that decides."""
    time = np.arange(float(len(preview.op))) * preview.sample_time
    rivals = [(called(rival.place, rival.effect), rival) for rival in preview.rivals]
    signals = {
        "stem": "stem (%)",
        "pv": f"{preview.output} as the sensor shows it",
        "true": f"{preview.output} itself, as a second sensor would show it",
    }
    op = over_time(
        "What would decide: OP moved by hand with the controller off: up, back, and one step, "
        "without noise.",
        *(time, [Curve(f"OP of {preview.valve}", "op", preview.op, steps=True)], "%"),
    )
    figures = []
    for signal, label in signals.items():
        drawn = [
            Curve(name, kind, getattr(rival, signal))
            for (name, rival), kind in zip(rivals, itertools.cycle(KINDS), strict=False)
        ]
        differ = _apart([curve.values for curve in drawn])
        said = f"{label}: {'the rivals differ' if differ else 'the rivals are alike'}."
        figures.append(over_time(said[0].upper() + said[1:], time, drawn, text(label)))
    return op + "".join(figures)


def _apart(signals: list[np.ndarray[tuple[int], np.dtype[np.float64]]]) -> bool:
    spread = max(float(np.ptp(each)) for each in signals)
    first = signals[0]
    return any(float(np.abs(each - first).max()) > 0.02 * max(spread, 1e-12) for each in signals)


def change_lines(found: Discrepancy) -> list[str]:
    """Return what of the process was changed, one line each."""
    return [f"{change.output}: {change.sentence}" for change in found.process_changes]
