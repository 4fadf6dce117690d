"""An identification for people: in sentences, as a table of HTML, as a table of rich."""

import html
import math
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from stiction_ros.identification.result import (
    Cause,
    CauseKind,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.texts import plural, probability, spoken, symbol

WIDTH = 80  # columns of a terminal
NOTES = 3  # notes that a summary shows
HEAD = ("valve", "verdict", "P", "f_S, %", "interval", "f_D, %", "interval")
# what to do about a cycle that the valve does not make
CAUSES: Mapping[CauseKind, str] = {
    CauseKind.TUNING: "retune the controller: it rings with the process",
    CauseKind.DISTURBANCE: "look upstream for what comes in with this period",
    CauseKind.SET_POINT: "look at what moves the set-point with this period",
    CauseKind.UNKNOWN: "look at the neighbouring loops: nothing found here explains the cycle",
}


def summary(found: Identification, notes: int | None = NOTES) -> str:
    """Return what was found in plain sentences, lines of 80 columns, with some ``notes`` or all."""
    lines = [f"{_size(found)}, {spoken(found.samples * found.sample_time)} of operation"]
    if found.row_samples > 1:
        used = found.row_samples * found.sample_time
        lines.append(f"friction was judged at a coarser rate: one row each {used:g} s")
    if found.reason:
        lines += _wrapped(f"The fit is not to be trusted: {found.reason}", indent="")
    for j, valve in enumerate(found.valves):
        chance = probability(valve.probability)
        sure = f", probability of friction {chance}" if chance else ""
        lines += ["", *_wrapped(f"{valve.name}: {valve.verdict}{sure}{_frictions(valve)}", "")]
        said = (why(found, j), materiality(valve))
        lines += _wrapped(" ".join(filter(None, said)))
        lines += _wrapped(f"What to do next: {next_step(found, j)}")
    for output in found.outputs:
        lines += ["", *_wrapped(_process(found, output), indent="")]
        if output.cause is not None:
            lines += _wrapped(cycle(output))
    if found.notes:
        lines.append("")
    shown = found.notes[:notes]
    for note in shown:
        lines += textwrap.wrap(f"- {note}", WIDTH, subsequent_indent="  ")
    if left := len(found.notes) - len(shown):
        lines.append(f"- {plural(left, 'more note')} in the attribute notes")
    return "\n".join(lines)


def rows(found: Identification) -> Iterator[tuple[str, ...]]:
    """Yield the cells of each valve below :data:`HEAD`."""
    for valve in found.valves:
        yield (
            valve.name,
            str(valve.verdict),
            probability(valve.probability),
            f"{valve.static_friction:.2f}",
            "{:.2f} to {:.2f}".format(*valve.static_interval),
            f"{valve.dynamic_friction:.2f}",
            "{:.2f} to {:.2f}".format(*valve.dynamic_interval),
        )


def as_html(found: Identification) -> str:
    """Return a table of the valves for notebooks."""

    def row(cells: tuple[str, ...], kind: str) -> str:
        inside = "".join(f"<{kind}>{html.escape(cell)}</{kind}>" for cell in cells)
        return f"<tr>{inside}</tr>"

    told = html.escape(f"{found.status}: {found.reason}" if found.reason else _size(found))
    body = "".join(row(cells, "td") for cells in rows(found))
    return f"<table><caption>{told}</caption><thead>{row(HEAD, 'th')}</thead>{body}</table>"


def as_table(found: Identification) -> Any:
    """Return a table of the valves for a console of rich."""
    from rich.table import Table
    from rich.text import Text

    table = Table(*HEAD, title=Text(found.reason or _size(found)), title_justify="left")
    for cells in rows(found):
        table.add_row(*map(Text, cells))
    return table


def _size(found: Identification) -> str:
    return f"{plural(found.samples, 'sample')} of {found.sample_time:g} s"


def _frictions(valve: ValveEstimate) -> str:
    if valve.verdict is VerdictKind.HEALTHY:
        return ""
    static, dynamic = valve.static_interval, valve.dynamic_interval
    further = ""
    for key, value in valve.further.items():
        ends = valve.further_intervals.get(key)
        between = "held" if ends is None else "{:.3g} to {:.3g}".format(*ends)
        further += f", {symbol(key)} {value:.3g} ({between})"
    return (
        f"; f_S {valve.static_friction:.2f} % ({static[0]:.2f} to {static[1]:.2f} %), "
        f"f_D {valve.dynamic_friction:.2f} % ({dynamic[0]:.2f} to {dynamic[1]:.2f} %), "
        f"law {valve.law}{further}"
    )


def _process(found: Identification, output: OutputModel) -> str:
    """Return gain and delay of an output, and how well its free run fits."""
    told = []
    for valve, taps in output.b.items():
        level = math.isclose(sum(output.a), -1.0)
        gain = "integrates" if level else f"gain {sum(taps) / (1.0 + sum(output.a)):.3g} per % of"
        delay = output.delay.get(valve, 0) * found.sample_time
        told.append(f"{gain} {valve}, delay {delay:g} s")
    fit = f"fit of PV computed from OP alone (free run) {output.fit_free_run:.0f} %"
    return f"{output.name}: {'; '.join([*told, fit])}"


def _wrapped(text: str, indent: str = "  ") -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent="  ")


def cycle(model: OutputModel) -> str:
    """Return why an output oscillates, by the names of :class:`CauseKind`; nothing if untold."""
    if (cause := model.cause) is None:
        return ""
    said = f"{model.name}: cause of the oscillation: {cause.kind}"
    if cause.kind is not CauseKind.NONE and cause.period is not None:
        said += f"; period {spoken(cause.period)}, amplitude {cause.amplitude:.3g} PV units"
    # That the valve makes the cycle is what materiality says already, with its share.
    return f"{said}." if cause.kind is CauseKind.VALVE else f"{said}. {cause.sentence}"


def why(found: Identification, valve: int) -> str:
    """Return in a sentence why a valve is said to be what it is said to be."""
    estimate = found.valves[valve]
    name, kind = estimate.name, estimate.verdict
    band = estimate.static_friction + estimate.dynamic_friction
    if kind is VerdictKind.UNDECIDED:
        reason = estimate.experiment.partition(". ")[0].rstrip(".") + "."
        if not _calm(found, valve):
            return reason
        return f"The loop does not oscillate: nothing to repair is visible. {reason}"
    if kind is VerdictKind.HEALTHY:
        high = estimate.static_interval[1]
        return f"The stem of {name} follows OP: f_S above {high:.2f} % is ruled out by this record."
    rests = f"When OP turns, the stem of {name} rests until OP has gone back by {band:.2f} %"
    if kind is VerdictKind.BACKLASH:
        return f"{rests}; it then follows, without a jump that this record shows."
    return f"{rests}, and then jumps by {estimate.jump:.2f} % or more."


def materiality(estimate: ValveEstimate) -> str:
    """Return how much the friction matters, by its share of OP's movement and of the cycle."""
    if not estimate.static_friction > 0.0 or not estimate.band_share > 0.0:
        return ""
    share = 100.0 * min(estimate.band_share, 1.0)
    said = f"f_S + f_D (deadband plus stickband) takes {share:.0f} % of OP's movement"
    gone = estimate.evidence.get("loop_gone")
    if gone is None:
        return f"{said}; what goes away without it is not known, as no controller fits OP."
    if gone <= 0.0:
        return f"{said}; in simulation the loop moves as much without it."
    away = 100.0 * min(gone, 1.0)
    return f"{said}; in simulation {away:.0f} % of the loop's movement goes away without it."


def next_step(found: Identification, valve: int) -> str:
    """Return what to do next about a valve."""
    estimate = found.valves[valve]
    if estimate.verdict is VerdictKind.UNDECIDED:
        step = estimate.experiment.partition(". ")[2] or "Record the loop for longer."
        if not _calm(found, valve):
            return step
        return f"Nothing, while the loop is calm. What would decide: {step[0].lower()}{step[1:]}"
    cause = cause_of(found, valve)
    kind = CauseKind.NONE if cause is None else cause.kind
    other = CAUSES.get(kind, "")
    if estimate.verdict is VerdictKind.HEALTHY:
        if not other:
            return "Nothing is to be done about this valve."
        return f"Leave the valve and {other}."
    part = "linkage" if estimate.verdict is VerdictKind.BACKLASH else "packing"
    service = f"have {estimate.name} serviced ({part} and positioner first)"
    if other:
        return f"First {other}; then {service}."
    if kind is not CauseKind.VALVE:
        return f"The friction makes no cycle: {service} at the next stop."
    service = f"{service[0].upper()}{service[1:]}"
    return (
        f"{service}, unless `stiction gain` promises more from another tuning or from a "
        "controller that knows the friction."
    )


def _calm(found: Identification, valve: int) -> bool:
    """Return whether the loop does not oscillate and friction is not likely either."""
    cause = cause_of(found, valve)
    still = cause is not None and cause.kind is CauseKind.NONE
    return still and not found.valves[valve].is_likely


def cause_of(found: Identification, valve: int) -> Cause | None:
    """Return the cause of the oscillation that goes with a valve: one that it makes, else its own.

    Args:
        found: what identification made of the record.
        valve: index.
    """
    name = found.valves[valve].name
    told = [model.cause for model in found.outputs if model.cause and any(model.b.get(name, ()))]
    made = [cause for cause in told if cause.kind is CauseKind.VALVE]
    if made or not told:
        return made[0] if made else None
    return told[min(valve, len(told) - 1)]
