"""The report of a discrepancy: the gap before and after, what names the effect, the rivals."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stiction_ros.discrepancy import Discrepancy, FoundEffect, GapVerdict, Look
from stiction_ros.discrepancy.answer.preview import preview
from stiction_ros.discrepancy.gap.measure import levelled
from stiction_ros.effects import FloatArray
from stiction_ros.pages.frame import framed, text
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
    style,
)
from stiction_ros.report.gap.effects import (
    change_lines,
    effect_card,
    effect_drawings,
    preview_drawing,
)
from stiction_ros.report.gap.words import CONTROLLER, called, candidate_of, named_figures, plain
from stiction_ros.report.page import Cell, embedded, folded, number, table

SHOWN = 12  # candidates in the picture
SHOWS = 1.1  # times the declared noise from which what the sensor adds to it is told

_HEADLINES = {
    GapVerdict.NAMED: "The simulation lacks {what}",
    GapVerdict.AMBIGUOUS: "The simulation lacks {what}",
    GapVerdict.UNKNOWN: "There is a gap that the catalogue does not explain",
    GapVerdict.NONE: "The simulation explains the records",
    GapVerdict.UNTESTABLE: "These records cannot show what the simulation lacks",
}


def report_gap(found: Discrepancy, out: str | Path) -> Path:
    """Write ``report.html`` and its figures into the folder ``out`` and return the page."""
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    with style():
        drawings = [_before_and_after(found), *effect_drawings(found)]
        decides = preview(found)
        if decides is not None:
            drawings.append(preview_drawing(decides))
        for k, look in enumerate(found.looks):
            drawings += [*_tracks(found, look, k), _rivals(look, k)]
    for drawing in drawings:
        drawing.save(folder)
    target = folder / "report.html"
    target.write_text(gap_page(found, drawings), encoding="utf-8")
    return target


def gap_page(found: Discrepancy, drawings: Sequence[Drawing]) -> str:
    """Return the report as HTML."""
    pictures = {drawing.name: embedded(drawing) for drawing in drawings}
    names = ", ".join(record.name for record in found.runs.records)
    headline = _headline(found)
    parts = [
        f"<h1>{text(headline)}</h1>",
        f'<p class="soft">{text(names)}: {len(found.runs)} samples of '
        f"{found.runs.sample_time:g} s; verdict {text(found.verdict)}</p>",
        '<div class="cards">' + "".join(effect_card(effect) for effect in found.effects) + "</div>",
        *(pictures.get(f"effect_{k + 1}", "") for k in range(len(found.effects))),
        *_decides(found, pictures),
        "<h2>The data</h2>" + _gate(found),
        "<h2>The gap</h2>" + _gaps(found),
        pictures["gap"],
        "<h2>The noise</h2>" + _noise(found),
    ]
    changes = change_lines(found)
    if changes:
        parts.append("<h2>What of the process was changed</h2>" + _listed(changes))
    for k, look in enumerate(found.looks):
        parts += _look(found, look, k, pictures)
    parts += ["<h2>What these records could not show</h2>" + _untestable(found)]
    listed = [f"{entry.name}: {entry.reason}" for entry in found.not_considered]
    if listed:
        parts.append("<h2>What was not considered</h2>" + _listed(listed))
    parts += [folded("The loop model with what was found", found.model_after.to_yaml())]
    return framed(f"{names}: {headline}", parts)


def _headline(found: Discrepancy) -> str:
    names = [_called(effect) for effect in found.effects]
    if not names:
        names = [" or ".join(called(*name) for name in found.alternatives)]
    return _HEADLINES[found.verdict].format(what=", and ".join(names))


def _called(effect: FoundEffect) -> str:
    named = called(effect.place, effect.effect)
    if not effect.alternatives:
        return named
    return f"{named} (or {' or '.join(called(*name) for name in effect.alternatives)})"


def _decides(found: Discrepancy, pictures: dict[str, str]) -> list[str]:
    if not found.experiment:
        return []
    said = found.experiment[0].upper() + found.experiment[1:]
    return [f"<h2>What would decide</h2><p>{text(said)}.</p>", pictures.get("preview", "")]


def _noise(found: Discrepancy) -> str:
    lines = []
    for each in found.noise:
        if math.isnan(each.declared):
            lines.append(f"{each.name}: the model declares no noise; found {number(each.found)}")
            continue
        seen = ""
        if each.expected > SHOWS * each.declared:
            seen = f"; {number(each.expected)} with what the sensor does to PV"
        agrees = "more or other than" if each.disagrees else "as"
        lines.append(
            f"{each.name}: innovations of {number(each.found)}, {agrees} the model declares "
            f"({number(each.declared)}{seen})"
        )
    return _listed(lines)


def _listed(lines: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{text(line)}</li>" for line in lines) + "</ul>"


def _gate(found: Discrepancy) -> str:
    gate = found.gate
    lines = []
    for name, quantum, usable in zip(
        found.model_before.outputs, gate.quantum, gate.usable, strict=True
    ):
        rounded = f", in steps of {number(quantum)}" if quantum else ""
        lines.append(f"{name}: {100.0 * float(usable.mean()):.1f} % of PV can be scored{rounded}")
    for name, count in zip(found.model_before.valve_names, gate.reversals, strict=True):
        lines.append(f"{name}: OP reverses {count} times")
    if gate.set_point_moves is not None:
        moves = ", ".join(map(str, gate.set_point_moves))
        lines.append(f"set-point moves: {moves}")
    lines.append(CONTROLLER[found.controller.status])
    lines += found.notes
    return _listed(lines)


def _gaps(found: Discrepancy) -> str:
    rows: list[list[Cell]] = []
    for before, after in zip(found.before, found.after, strict=True):
        rows.append(
            [
                before.name,
                number(before.free_run_rmse),
                number(after.free_run_rmse),
                number(after.floor_free_run),
                number(before.one_step_rmse),
                number(after.one_step_rmse),
                number(after.floor_one_step),
            ]
        )
    head = ("output", "free run before", "after", "noise", "one step before", "after", "noise")
    closed = f"<p>{100.0 * found.closed:.0f} % of the free-run excess over the noise is gone "
    return table(head, rows) + closed + "on samples that no figure was fitted to.</p>"


def _look(found: Discrepancy, look: Look, k: int, pictures: dict[str, str]) -> list[str]:
    listed = "".join(f"<li>{text(plain(said))}</li>" for said in look.where.sentences)
    rows: list[list[Cell]] = []
    for fit in look.scores.fits:
        outside = "" if fit.candidate.inside else ", outside the catalogue"
        rows.append(
            [
                candidate_of(fit) + outside,
                named_figures(found, fit),
                number(fit.delta_bic),
                number(fit.held_gain),
            ]
        )
    head = ("candidate", "figures", "BIC gained", "held-out gain")
    said = plain(f"{look.decision.verdict}: {look.decision.reason}")
    after = "it stays in the model" if look.kept else (look.reason or "nothing is added")
    return [
        f"<h2>Look {k + 1}: where the gap is</h2>",
        f"<ul>{listed}</ul>" if listed else "<p>At no particular time or place.</p>",
        pictures.get(f"track_{k + 1}", ""),
        f"<h2>Look {k + 1}: the candidates</h2>",
        f"<p>{text(said)}; {text(plain(after))}.</p>",
        pictures.get(f"candidates_{k + 1}", ""),
        table(head, rows, texts=2),
    ]


def _untestable(found: Discrepancy) -> str:
    if not found.untestable:
        return "<p>Every effect of the catalogue would have been seen.</p>"
    rows = [[called(t.place, t.effect), t.experiment, number(t.expected)] for t in found.untestable]
    return table(("effect", "what would help", "BIC expected"), rows, texts=2)


def _before_and_after(found: Discrepancy) -> Drawing:
    """Draw PV, the free runs of both models, and both gaps."""
    names = found.model_before.outputs
    figure, axes = panels(2 * len(names), 0.8 + 3.6 * len(names), sharex=True)
    at, axis_of_time = _time(found)
    shown = levelled(found.base_before), levelled(found.base_after)
    for i, name in enumerate(names):
        scored = found.base_before.blocks[i].scored
        old, new = (np.where(scored, base.noise[i].residual, np.nan) for base in shown)
        pv = found.base_after.run.runs.pv[:, i]
        top, low = axes[2 * i, 0], axes[2 * i + 1, 0]
        top.plot(at, pv, color=GREY, linewidth=0.8, label=f"{name} measured")
        top.plot(at, found.base_before.run.runs.pv[:, i] - old, color=ORANGE, label="before")
        top.plot(at, pv - new, color=BLUE, label="after")
        top.set_ylabel(name)
        legend(top)
        low.plot(at, old, color=ORANGE, label="gap before")
        low.plot(at, new, color=BLUE, label="gap after")
        held = found.base_after.blocks[i].held
        low.fill_between(
            at,
            0,
            1,
            where=held.tolist(),
            transform=low.get_xaxis_transform(),
            color=INK,
            alpha=0.07,
            linewidth=0,
            label="held out",
        )
        low.set_ylabel("gap")
        legend(low)
    axes[-1, 0].set_xlabel(axis_of_time.label)
    axes[-1, 0].set_xlim(at[0], at[-1])
    caption = (
        "The free run is driven by the recorded OP alone. State and level at the start are "
        "fitted on the blocks without shade; the figures above are those of the shaded blocks."
    )
    return Drawing("gap", "Gap before and after", caption, figure)


def _tracks(found: Discrepancy, look: Look, k: int) -> list[Drawing]:
    """Draw the disturbance that would close the gap at the most telling place."""
    if not look.where.tracks or look.where.tracks[0].gain <= 0.0:
        return []
    track = look.where.tracks[0]
    figure, axes = panels(1, 3.4, 2, width_ratios=(2.0, 1.0))
    at, axis_of_time = _time(found)
    axes[0, 0].plot(at, track.wave, color=VERMILION)
    axes[0, 0].set_xlabel(axis_of_time.label)
    axes[0, 0].set_ylabel(plain(f"missing at {track.place}"))
    driver, label = _driver(found, look, track.place)
    axes[0, 1].plot(driver, track.wave, color=VERMILION, linewidth=0.7)
    axes[0, 1].set_xlabel(label)
    caption = (
        f"The slow disturbance at {plain(track.place)} that would close the gap, against time and "
        f"against {label}. A loop in the right panel is play or friction, a bend is a "
        "characteristic or a limit, a step or ramp in the left one is a disturbance."
    )
    return [Drawing(f"track_{k + 1}", plain(f"What is missing at {track.place}"), caption, figure)]


def _driver(found: Discrepancy, look: Look, place: str) -> tuple[FloatArray, str]:
    kind, _, tag = place.partition(":")
    names = found.model_before.valve_names
    if kind == "valve":
        return found.runs.op[:, names.index(tag)], f"OP of {tag} (%)"
    i = found.model_before.outputs.index(tag)
    return look.scores.base.run.forced[:, i], f"free run of {tag}"


def _rivals(look: Look, k: int) -> Drawing:
    """Draw the scores of the best candidates."""
    fits = look.scores.fits[:SHOWN][::-1]
    figure, axes = panels(1, 0.9 + 0.28 * len(fits))
    axis = axes[0, 0]
    colours = [GREY if not fit.candidate.inside else GREEN for fit in fits]
    axis.barh(np.arange(len(fits)), [fit.delta_bic for fit in fits], color=colours)
    axis.set_yticks(np.arange(len(fits)), [candidate_of(fit) for fit in fits])
    axis.axvline(0.0, color=INK, linewidth=0.8)
    axis.set_xlabel("BIC gained against the current model")
    caption = (
        "Every candidate with its own best figures, one at a time, the current model as it is. "
        "Grey: rivals outside the catalogue, which only show that something else is amiss."
    )
    return Drawing(f"candidates_{k + 1}", f"Candidates of look {k + 1}", caption, figure)


def _time(found: Discrepancy) -> tuple[FloatArray, TimeAxis]:
    seconds = np.arange(len(found.runs)) * found.runs.sample_time
    axis = TimeAxis.spanning(float(seconds[-1]))
    return np.asarray(axis(seconds)), axis
