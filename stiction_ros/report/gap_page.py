"""The report of a discrepancy: the gap before and after, what names the effect, the rivals."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stiction_ros.discrepancy import Discrepancy, FoundEffect, GapVerdict, Look
from stiction_ros.discrepancy.decision.explanation import ProcessChange
from stiction_ros.discrepancy.gap.measure import levelled
from stiction_ros.pages.frame import framed, listed, text
from stiction_ros.pages.plot import SCRIPT, Curve, over_time
from stiction_ros.report import gap_words as say
from stiction_ros.report.page import Cell, card, folded, number, table, write_page
from stiction_ros.signals.holds import stretches

CANDIDATES = (
    "Every candidate with its own best figures, one at a time, the current model as it is. Rivals "
    "outside the catalogue only show that something else is amiss."
)
SHOWS = 1.1  # times the declared noise from which what the sensor adds to it is told

_HEADLINES = {
    GapVerdict.NAMED: "The simulation lacks {what}",
    GapVerdict.AMBIGUOUS: "The simulation lacks {what}",
    GapVerdict.UNKNOWN: "There is a gap that the catalogue does not explain",
    GapVerdict.NONE: "The simulation explains the records",
    GapVerdict.UNTESTABLE: "These records cannot show what the simulation lacks",
}


def report_gap(found: Discrepancy, out: str | Path) -> Path:
    """Write ``report.html`` into the folder ``out`` and return the page."""
    return write_page(Path(out) / "report.html", gap_page(found))


def gap_page(found: Discrepancy) -> str:
    """Return the report as HTML."""
    names = ", ".join(record.name for record in found.runs.records)
    headline = _headline(found)
    parts = [
        f"<h1>{text(headline)}</h1>",
        f'<p class="soft">{text(names)}: {len(found.runs)} samples of '
        f"{found.runs.sample_time:g} s; verdict {text(found.verdict)}</p>",
        '<div class="cards">' + "".join(effect_card(effect) for effect in found.effects) + "</div>",
        *_decides(found),
        "<h2>The data</h2>" + _gate(found),
        "<h2>The gap</h2>" + _gaps(found),
        _before_and_after(found),
        "<h2>The noise</h2>" + _noise(found),
    ]
    changes = change_lines((*found.process_changes, *found.corrections))
    if changes:
        parts.append("<h2>What of the process was changed</h2>" + listed(changes))
    for k, look in enumerate(found.looks):
        parts += _look(found, look, k)
    parts += ["<h2>What these records could not show</h2>" + _untestable(found)]
    if found.not_considered:
        left = (f"{entry.name}: {entry.reason}" for entry in found.not_considered)
        parts.append("<h2>What was not considered</h2>" + listed(left))
    parts += [folded("The loop model with what was found", found.model_after.to_yaml())]
    return framed(f"{names}: {headline}", parts, SCRIPT)


def _headline(found: Discrepancy) -> str:
    names = [_called(effect) for effect in found.effects]
    if not names and not found.alternatives and found.process_changes:
        said = "; ".join(change_lines(found.process_changes))
        return f"The process is another than the model: {said}"
    if not names:
        names = [say.one_of(found.alternatives, found.probabilities)]
    return _HEADLINES[found.verdict].format(what=", and ".join(names))


def _called(effect: FoundEffect) -> str:
    named = say.called(effect.place, effect.effect)
    if not effect.alternatives:
        return named
    return f"{named} (or {' or '.join(say.called(*name) for name in effect.alternatives)})"


def _decides(found: Discrepancy) -> list[str]:
    if not found.experiment:
        return []
    said = found.experiment[0].upper() + found.experiment[1:]
    return [f"<h2>What would decide</h2><p>{text(said)}.</p>"]


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
    return listed(lines)


def _gate(found: Discrepancy) -> str:
    gate = found.gate
    lines = []
    runs = found.runs
    for name, quantum, usable in zip(
        found.model_before.outputs, runs.lattices, runs.usable, strict=True
    ):
        rounded = f", in steps of {number(quantum)}" if quantum else ""
        lines.append(f"{name}: {100.0 * float(usable.mean()):.1f} % of PV can be scored{rounded}")
    for name, count in zip(found.model_before.valve_names, gate.reversals, strict=True):
        lines.append(f"{name}: OP reverses {count} times")
    if gate.set_point_moves is not None:
        moves = ", ".join(map(str, gate.set_point_moves))
        lines.append(f"set-point moves: {moves}")
    lines.append(say.CONTROLLER[found.controller.status])
    lines += found.notes
    return listed(lines)


def _gaps(found: Discrepancy) -> str:
    rows: list[list[Cell]] = []
    for before, after in zip(found.before, found.after, strict=True):
        free = before.free_run_rmse, after.free_run_rmse, after.floor_free_run
        ahead = before.one_step_rmse, after.one_step_rmse, after.floor_one_step
        rows.append([before.name, *map(number, (*free, *ahead))])
    head = ("output", "free run before", "after", "noise", "one step before", "after", "noise")
    closed = f"<p>{100.0 * found.closed:.0f} % of the free-run excess over the noise is gone "
    return table(head, rows) + closed + "on samples that were not used for the fit.</p>"


def _look(found: Discrepancy, look: Look, k: int) -> list[str]:
    where = listed(map(say.plain, look.where.sentences)) if look.where.sentences else ""
    rows: list[list[Cell]] = []
    for fit in look.scores.fits:
        outside = "" if fit.candidate.inside else ", outside the catalogue"
        rows.append(
            [
                say.candidate_of(fit) + outside,
                say.named_figures(fit),
                number(fit.delta_bic),
                number(round(fit.held_gain, 3) + 0.0),
            ]
        )
    head = ("candidate", "figures", "BIC gained", "held-out gain")
    said = say.plain(f"{look.decision.verdict}: {look.decision.reason}")
    after = "it stays in the model" if look.kept else look.reason
    if not after or after == look.decision.reason:
        after = "nothing is added"
    return [
        f"<h2>Look {k + 1}: where the gap is</h2>",
        where or "<p>At no particular time or place.</p>",
        _track(found, look),
        f"<h2>Look {k + 1}: the candidates</h2>",
        f"<p>{text(said)}; {text(say.plain(after))}.</p>",
        f"<p class='soft'>{CANDIDATES}</p>",
        table(head, rows, texts=2),
    ]


def _untestable(found: Discrepancy) -> str:
    if not found.untestable:
        return "<p>Every effect of the catalogue would have been seen.</p>"
    rows = [
        [say.called(t.place, t.effect), t.experiment, number(t.expected)] for t in found.untestable
    ]
    return table(("effect", "what would help", "BIC expected"), rows, texts=2)


def _before_and_after(found: Discrepancy) -> str:
    """Return PV with the free runs of both models, and both gaps, of each output."""
    time = np.arange(float(len(found.runs))) * found.runs.sample_time
    shown = levelled(found.base_before), levelled(found.base_after)
    figures = []
    for i, name in enumerate(found.model_before.outputs):
        scored = found.base_before.blocks[i].scored
        old, new = (np.where(scored, base.noise[i].residual, np.nan) for base in shown)
        pv = found.base_after.run.runs.pv[:, i]
        begins, ends = stretches(found.base_after.blocks[i].held)
        held = [(time[a], time[b - 1]) for a, b in zip(begins, ends, strict=True)]
        runs = [
            Curve(f"{name}, measured", "whole", pv),
            Curve("free run before", "op", found.base_before.run.runs.pv[:, i] - old),
            Curve("free run after", "pv", pv - new),
        ]
        gaps = [Curve("gap before", "op", old), Curve("gap after", "pv", new)]
        figures += [
            over_time(
                "The free runs are driven by the recorded OP alone. State and level at the start "
                "are fitted on the stretches without shade.",
                *(time, runs, text(name)),
                shade=held,
            ),
            over_time(
                "The gap: PV less the free run. The figures above are those of the shaded "
                "stretches.",
                *(time, gaps, text(name)),
                shade=held,
            ),
        ]
    return "".join(figures)


def _track(found: Discrepancy, look: Look) -> str:
    """Return the disturbance that would close the gap at the most telling place."""
    track = look.where.track
    if track is None or track.gain <= 0.0:
        return ""
    place, curve = say.plain(track.place), Curve("disturbance", "free", track.wave)
    time = np.arange(float(len(found.runs))) * found.runs.sample_time
    return over_time(
        f"The slow disturbance at {place} that would close the gap. A step or a ramp in it is a "
        "disturbance.",
        *(time, [curve], f"missing at {text(place)}"),
    )


def effect_card(effect: FoundEffect) -> str:
    """Return the box of one effect: place, law, figures with units, and why it."""
    kind = "bad" if effect.verdict is GapVerdict.NAMED else "open"
    title = say.titled(effect, say.word_of(effect.effect))
    return card(kind, say.place_of(effect.place), title, "\n".join(say.lines_of(effect)))


def change_lines(changes: Sequence[ProcessChange]) -> list[str]:
    """Return what of the process was changed, one line each."""
    return [f"{change.output}: {change.sentence}" for change in changes]
