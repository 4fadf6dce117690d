"""The answer in plain sentences: why, how much it matters, what to do next."""

from collections.abc import Mapping

from stiction_ros.identification.result.cause import Cause, CauseKind
from stiction_ros.identification.result.identification import (
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.texts import spoken

CAUSES: Mapping[CauseKind, str] = {
    CauseKind.TUNING: "retune the controller: it rings with the process",
    CauseKind.DISTURBANCE: "look upstream for what comes in with this period",
    CauseKind.SET_POINT: "look at what moves the set-point with this period",
    CauseKind.UNKNOWN: "look at the neighbouring loops: nothing found here explains the cycle",
}
"""What to do about a cycle that the valve does not make."""


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
    """Return what to do next about a valve.

    Args:
        found: what identification made of the record.
        valve: index.
    """
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
