"""Which cause explains an oscillation: one decision from all that closing the loop shows."""

import dataclasses

from stiction_ros.identification.closed_loop.closed_loop import ClosedLoop, OutputLoop, ValveLoop
from stiction_ros.identification.result import Cause, CauseKind, Identification, ValveEstimate
from stiction_ros.loop.linear_loops import Ringing
from stiction_ros.records.record import Record
from stiction_ros.signals.oscillation import REGULAR

# share of OP's movement that must go away with the friction for the valve to be the cause
MATERIAL = 0.15
# the same of a friction that was not found, where nothing else explains the oscillation
LEFT_OVER = 0.25
MANY_TIMES = 3.0  # movement over the recorded one from which on a repeated loop is another one
# BIC gain from which on a line from outside is believed: strong evidence by Kass and Raftery
LINE = 6.0
# BIC gain of a line alone over that of the friction from which on the friction may be fitted to a
# wave from outside. Of valves that make their loop cycle it is below 0: no clock follows slips
RIVAL = 0.3
# BIC gain from which on a line shows an oscillation that is too short or too faint to be regular by
# its autocorrelation
PLAIN_LINE = 60.0
# share of the variance from which on a line is an oscillation though it has too few cycles for a
# regularity
PLAIN_SHARE = 0.5
FAINT = 0.05  # share of the variance below which a line that nothing explains is no oscillation
DRIVEN = 0.5  # share of the cycle, of PV and of OP, that the set-point must make to be the cause
# share of PV's line that the line of a set-point that cycles must have to be the cause however
# regular PV is, and whatever the model says that it moves
FOLLOWED = 0.75
# share of OP's movement that moves of the set-point without a line must make to be the cause
ALL_DRIVEN = 0.9
OPEN = 0.9  # R² of the controller below which an unrecorded set-point may move OP
HALF_OPEN = 0.95  # the same where the line shows more clearly in OP than in PV
# share of an oscillation left after a period: a quarter is usual tuning, half of it rings long
RINGING = 0.5
# the same of the process beside a wave, from which on the loop makes the wave itself
STILL_RINGING = 0.85
SAME_PERIOD = 1.3  # factor within which the loop rings at the period of the oscillation


def explained(record: Record, found: Identification, closed: ClosedLoop) -> Identification:
    """Return the identification with causes, and with what the closed loop says of each valve.

    Args:
        record: what was measured.
        found: with the verdict on each valve.
        closed: its loops.
    """
    valves = tuple(
        dataclasses.replace(
            valve,
            band_share=loop.band_share,
            evidence=valve.evidence
            if valve.figures is not None
            else {**valve.evidence, **figures(loop)},
        )
        for valve, loop in zip(found.valves, closed.valves, strict=True)
    )
    outputs = tuple(
        dataclasses.replace(model, cause=cause(record, found, closed, i))
        for i, model in enumerate(found.outputs)
    )
    return dataclasses.replace(found, valves=valves, outputs=outputs)


def figures(loop: ValveLoop) -> dict[str, float]:
    """Return the figures of one closed loop, by name; none where it could not be closed.

    ``controller_fit``: R². ``outside_line``: BIC gain by a line that enters behind the valve.
    ``loop_gone``: share of the movement that goes away without the friction.
    """
    if loop.controller is None:
        return {}
    told = {"controller_fit": loop.controller.r_squared, "outside_line": loop.outside.gain}
    return told | ({"loop_gone": loop.gone} if loop.band_share > 0.0 else {})


def cause(record: Record, found: Identification, closed: ClosedLoop, i: int) -> Cause:
    """Return why output ``i`` oscillates."""
    output = closed.outputs[i]
    swing = output.oscillation
    if swing is None:
        return Cause(CauseKind.NONE, None, 0.0, 0.0, "There is no room for four cycles.")
    there = [
        (estimate, loop)
        for estimate, loop in zip(found.valves, closed.valves, strict=True)
        if found.outputs[i].b[estimate.name]
        and estimate.static_friction > 0.0
        and output.rivalry < RIVAL
    ]
    acting = [
        (valve, loop)
        for valve, loop in there
        if valve.is_likely and (_gone(loop) > MATERIAL or _open_and_sure(valve, loop))
    ]
    kind, sentence = _kind(output, closed, acting)
    if kind is CauseKind.UNKNOWN:
        kind, sentence = _left_over(sentence, there)
    driver = output.set_point if kind is CauseKind.SET_POINT else None
    period = (driver or swing).period * record.sample_time
    return Cause(kind, period, swing.regularity, swing.amplitude, sentence)


def _gone(loop: ValveLoop) -> float:
    """Return what goes away with a friction; none of a loop that does not repeat the record."""
    return loop.gone if loop.moved_with < MANY_TIMES else 0.0


def _left_over(
    otherwise: str, there: list[tuple[ValveEstimate, ValveLoop]]
) -> tuple[CauseKind, str]:
    """Return the valve without whose friction much goes away, where nothing else explains it.

    The evidence for this friction may be little; that there is an oscillation, and nothing else
    to make it, speaks for it.

    Args:
        otherwise: what is said where there is no such valve.
        there: valves that the output answers, and their loops.
    """
    valve, loop = max(there, key=lambda one: _gone(one[1]), default=(None, None))
    if valve is None or loop is None:
        return CauseKind.UNKNOWN, otherwise
    if _gone(loop) <= (MATERIAL if valve.verdict.has_friction else LEFT_OVER):
        return CauseKind.UNKNOWN, otherwise
    share = f"{100 * min(_gone(loop), 1.0):.0f} %"
    return (
        CauseKind.VALVE,
        f"Nothing else explains it, and without the friction that {valve.name} may have "
        f"{share} of the movement goes away.",
    )


def _open_and_sure(valve: ValveEstimate, loop: ValveLoop) -> bool:
    """Tell whether friction is sure and the loop cannot be closed for want of its controller.

    What goes away without the friction is then nobody's to say, and acquits no valve.
    """
    known = loop.controller is not None and loop.controller.r_squared > OPEN
    return not known and valve.verdict.has_friction


def _kind(
    output: OutputLoop, closed: ClosedLoop, acting: list[tuple[ValveEstimate, ValveLoop]]
) -> tuple[CauseKind, str]:
    swing = output.oscillation
    assert swing is not None
    loop = next((one for one in closed.valves if one.output == output.name), None)
    regular = swing.regularity > REGULAR
    followed = _cycles(output) and (output.set_point_line or 0.0) > FOLLOWED
    if followed or (regular and _set_point(output, loop)):
        return CauseKind.SET_POINT, "The set-point moves the loop at this period."
    turns = swing.regularity > 0.0 or swing.share > PLAIN_SHARE
    if acting and turns:  # a valve that sticks where nothing comes back makes no cycle
        valve, with_it = max(acting, key=lambda one: _gone(one[1]))
        if _gone(with_it) <= MATERIAL:
            return (
                CauseKind.VALVE,
                f"{valve.name} sticks; what else moves OP its controller does not tell.",
            )
        gone = f"{100 * min(with_it.gone, 1.0):.0f} %"
        return (
            CauseKind.VALVE,
            f"Without the friction of {valve.name}, {gone} of the movement goes away.",
        )
    rings = regular and loop is not None and _growth(loop.ringing, swing.period) > RINGING
    line = max(output.after.gain, output.alone.gain) > (LINE if regular else PLAIN_LINE)
    itself = loop is not None and _growth(loop.ringing_beside, swing.period) > STILL_RINGING
    clear = regular and swing.share > FAINT
    if clear and not line and loop is not None and loop.driven > ALL_DRIVEN:
        return CauseKind.SET_POINT, "Moves of the set-point make all of it."
    if rings and (itself or not line):
        return CauseKind.TUNING, "Controller and process ring at this period without friction."
    if line:
        return (
            CauseKind.DISTURBANCE,
            "A wave that keeps its period to the sample enters behind the valve.",
        )
    if swing.regularity == 0.0 and swing.share > PLAIN_SHARE:
        return CauseKind.UNKNOWN, "The record has too few cycles to tell."
    if not regular:
        return CauseKind.NONE, "There is no regular oscillation."
    if swing.share < FAINT:
        return CauseKind.NONE, "The oscillation is too faint to be told from noise."
    return CauseKind.UNKNOWN, "Nothing that was identified explains this oscillation."


def _set_point(output: OutputLoop, loop: ValveLoop | None) -> bool:
    """Tell whether the set-point makes the cycle, a recorded one or one that is not."""
    if loop is None or loop.controller is None:
        return False
    if output.set_point_line is not None:
        swings = output.set_point_line > DRIVEN and loop.driven > DRIVEN
        return swings and _cycles(output)
    ahead = loop.before.gain > output.after.gain and loop.controller.r_squared < HALF_OPEN
    return loop.before.gain > LINE and (ahead or loop.controller.r_squared < OPEN)


def _cycles(output: OutputLoop) -> bool:
    """Tell whether the recorded set-point is a cycle itself: single moves are none."""
    return output.set_point is not None and output.set_point.regularity > REGULAR


def _growth(ringing: tuple[Ringing, ...], period: float) -> float:
    """Return how much of an oscillation at about ``period`` samples is left after a period."""
    near = (
        one.growth for one in ringing if period / SAME_PERIOD < one.period < period * SAME_PERIOD
    )
    return max(near, default=0.0)
