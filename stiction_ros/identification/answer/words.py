"""The answer in plain sentences: why, how much it matters, what to do next."""

from __future__ import annotations

from collections.abc import Mapping

from stiction_ros.identification.result.cause import Cause, CauseKind
from stiction_ros.identification.result.identification import (
    Identification,
    ValveEstimate,
    VerdictKind,
)

CAUSES: Mapping[CauseKind, str] = {
    CauseKind.TUNING: "retune the controller: it rings with the process",
    CauseKind.DISTURBANCE: "look upstream for what comes in with this period",
    CauseKind.SET_POINT: "look at what moves the set-point with this period",
    CauseKind.UNKNOWN: "look at the neighbouring loops: nothing found here explains the cycle",
}
"""What to do about a cycle that the valve does not make."""


def why(found: Identification, valve: int) -> str:
    """Return in a sentence why a valve is said to be what it is said to be.

    Args:
        found: what identification made of the record.
        valve: index.
    """
    estimate = found.valves[valve]
    name, kind = estimate.name, estimate.verdict
    band = estimate.static_friction + estimate.dynamic_friction
    if kind is VerdictKind.UNDECIDED:
        reason = estimate.experiment.partition(". ")[0].rstrip(".") + "."
        cause = cause_of(found, valve)
        if cause is None or cause.kind is not CauseKind.NONE or estimate.is_likely:
            return reason
        return f"The loop does not oscillate: nothing to repair is visible. {reason}"
    if kind is VerdictKind.HEALTHY:
        high = estimate.static_interval[1]
        return f"The stem of {name} follows OP: f_S above {high:.2g} % is ruled out by this record."
    rests = f"When OP turns, the stem of {name} rests until OP has gone back by {band:.2g} %"
    if kind is VerdictKind.BACKLASH:
        return f"{rests}; it then follows, without a jump that this record shows."
    return f"{rests}, and then jumps by {estimate.jump:.2g} % or more."


def materiality(estimate: ValveEstimate) -> str:
    """Return how much the friction matters, by its share of OP's movement and of the cycle."""
    if not estimate.static_friction > 0.0 or not estimate.band_share > 0.0:
        return ""
    share = 100.0 * min(estimate.band_share, 1.0)
    said = f"The band f_S + f_D takes {share:.0f} % of OP's movement"
    gone = estimate.evidence.get("loop_gone")
    if gone is None:
        return f"{said}; what goes away without it is not known, as no controller fits OP."
    if gone <= 0.0:
        return f"{said}; in simulation the loop moves as much without it."
    away = 100.0 * min(gone, 1.0)
    return f"{said}; in simulation {away:.0f} % of the loop's movement goes away without it."


def next_step(found: Identification, valve: int, *, asked: bool = False) -> str:
    """Return what to do next about a valve.

    Args:
        found: what identification made of the record.
        valve: index.
        asked: whether what would help is told elsewhere, or that it could not be simulated.
    """
    estimate = found.valves[valve]
    if estimate.verdict is VerdictKind.UNDECIDED:
        return estimate.experiment.partition(". ")[2] or "Record the loop for longer."
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
    if asked:
        return f"{service}."
    return (
        f"{service}; ask stiction gain what a service, another tuning or a controller that knows "
        "the friction would bring."
    )


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
