"""The verdict on one valve: from what its rates say, and what its closed loop says of that."""

from __future__ import annotations

import dataclasses

from stiction_ros.identification.closed_loop.explanation import MATERIAL as CAUSES
from stiction_ros.identification.closed_loop.explanation import (
    OPEN,
    RIVAL,
    SURE,
    is_echoed,
    is_wave_itself,
)
from stiction_ros.identification.evidence.rates import PRICE, Agreement, Look
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.inference.verdict import kind_of, price_of_few
from stiction_ros.identification.result.cause import CauseKind
from stiction_ros.identification.result.identification import (
    Identification,
    ValveEstimate,
    VerdictKind,
)

LEAST_GONE = 0.1  # share of the movement that must go away with a friction
WIDER = 2.0  # of OP's movement: a wider band is not what makes it
MATTERS = 0.1  # of OP's movement about its mean: a smaller band hardly keeps anything from the stem
MATERIAL = 0.03  # of the range of OP: a band up to this is none to speak of
REJECTED = 3.0
"""−2 log likelihood that all bands that would matter must lose at two rates: a twentieth of the
likelihood of none at both together."""
REJECTING = 2  # rates that do
SURELY = 10.0  # what they must lose where one rate alone rejects them
GAINED = 5.0  # −2 log likelihood that such a band may gain where another rate rejects it, at most
HARDLY = 0.05  # share of the movement that goes away, at most, with one that does not matter
AS_RECORDED = 1.3  # factor within which its loop moves as recorded
ANOTHER = 2.0  # factor from which on a loop with its friction is not the one that was recorded
OWN = (CauseKind.TUNING, CauseKind.SET_POINT)
ELSEWHERE = (*OWN, CauseKind.DISTURBANCE)


def verdict_of(
    figures: dict[str, float],
    agreed: Agreement,
    seen: tuple[Look, ...],
    valve: int,
    options: IdentificationOptions,
) -> VerdictKind:
    """Return the verdict on one valve by what its rates show.

    What rates find beside a process that the controller would not hold is nothing where two that
    see the process reject it.

    Args:
        figures: the evidence of ``agreed``.
        agreed: the rates that agree best on its friction.
        seen: each rate.
        valve: index.
        options: of the search.
    """
    held = agreed.look.accepted[valve]
    slips = figures["moves"] >= options.min_moves
    if figures["delta_bic"] > 0.0 and agreed.alike and held.band[0] > MATERIAL:
        both = min(figures["half_1"], figures["half_2"]) > 0.0
        enough = figures["delta_bic"] > price_of_few(figures["moves"], options.min_moves)
        shown = both and slips and enough and (agreed.held or not _rejected(seen, valve))
        kind = kind_of(held.deadband_loss, held.static, held.dynamic)
        return kind if shown else VerdictKind.UNDECIDED
    return VerdictKind.HEALTHY if slips and _harmless(seen, valve) else VerdictKind.UNDECIDED


def _harmless(seen: tuple[Look, ...], valve: int) -> bool:
    """Tell whether the record rejects all bands that would matter: at two rates, or surely at one.

    A rate that takes something else for the process rejects nothing, as neither do rows that are
    drawn between reports; and what such rows say for friction is not believed before it is sure.
    Where that is beside a process that the controller would not hold, it is nothing. Where a rate
    finds friction, be it a small one, there is some; where one with news gains by what would
    matter, be it little, it is not rejected; and one rejects alone only where none that sees the
    process gains by that.
    """
    speak = [look for look in seen if look.speaks(valve)]
    if any(look.beyond_price(valve) > (0.0 if look.carries_news else SURE) for look in speak):
        return False
    gains = [look.accepted[valve].material_gain for look in speak if look.carries_news]
    lost = _lost(seen, valve)
    surely = max(lost, default=0.0) >= SURELY and min(lost) >= 0.0
    return max(gains, default=PRICE) <= 0.0 and (surely or _rejected(seen, valve))


def _rejected(seen: tuple[Look, ...], valve: int) -> bool:
    """Tell whether all bands that would matter are rejected at two rates that see the process."""
    return sum(one >= REJECTED for one in _lost(seen, valve)) >= REJECTING


def _lost(seen: tuple[Look, ...], valve: int) -> list[float]:
    """Return what the best friction that would matter loses at each rate that sees the process."""
    return [-look.accepted[valve].material_gain for look in seen if look.sees_process(valve)]


def confirms(found: Identification, valve: int) -> bool:
    """Tell whether a loop closed again speaks for the friction of a valve.

    It moves as recorded, less without the friction, and nothing else explains that it moves.
    """
    if any(model.cause and model.cause.kind in ELSEWHERE for model in found.outputs):
        return False
    told = found.valves[valve].evidence
    moved = told.get("moved_with", 0.0)
    known = told.get("controller_fit", 0.0) > OPEN
    as_recorded = 1.0 / AS_RECORDED < moved < AS_RECORDED
    return known and as_recorded and told.get("loop_gone", 0.0) > LEAST_GONE


def acquits(found: Identification, seen: tuple[Look, ...], valve: int) -> bool:
    """Tell whether a loop closed again shows that the friction of a valve does not matter.

    No rate finds any, and without any the loop moves as recorded, hardly less than with what the
    record does not reject. Its controller rings with the process, or its set-point cycles; or
    nothing cycles, one rate surely rejects all that matters, and none gains much by it. A wave from
    outside acquits no valve: a stem that goes to and fro with it may be missed.
    """
    if any(look.beyond_price(valve) > 0.0 for look in seen):
        return False
    told = found.valves[valve].evidence
    free, gone = told.get("moved_without", 0.0), told.get("loop_gone", 0.0)
    as_recorded = 1.0 / AS_RECORDED < free < AS_RECORDED
    causes = [model.cause.kind if model.cause else CauseKind.UNKNOWN for model in found.outputs]
    known = told.get("controller_fit", 0.0) > OPEN
    if not (known and as_recorded) or CauseKind.DISTURBANCE in causes:
        return False
    if all(kind in OWN for kind in causes):
        return gone < CAUSES
    lost = _lost(seen, valve)
    rejected = max(lost, default=0.0) >= SURELY and min(lost, default=0.0) > -GAINED
    return gone < HARDLY and rejected


def doubted(valve: ValveEstimate) -> ValveEstimate:
    """Return the estimate, no longer with friction where its loop says otherwise.

    A friction without which OP would move all the same is not what moves it, and one with which it
    would move otherwise than recorded is not its own, where the controller is known and the
    evidence not overwhelming. A stem that is a wave itself cannot be told from one that comes from
    outside; neither can one beside which a line from outside gains, and alone about as much, where
    its rates speak of processes that the controller would not hold; nor one that moves in time with
    what repeats itself, where no line stands for that. A band that is wider than OP moves about its
    mean moves with its large moves alone, as those in manual are, and one that is a small share of
    them is none to speak of.
    """
    if not valve.verdict.has_friction:
        return valve
    told = valve.evidence
    known = told.get("controller_fit", 0.0) > OPEN
    gone = told.get("loop_gone", 1.0) * min(told.get("moved_with", 1.0), 1.0)
    another = not 1.0 / ANOTHER < told.get("moved_with", 1.0) < ANOTHER
    denied = known and (gone < LEAST_GONE or another) and told.get("delta_bic", 0.0) < SURE
    wide = valve.band_share > WIDER
    small = 0.0 < valve.band_share < MATTERS
    line = told.get("outside_line", 0.0) > 0.0 and told.get("line_rivalry", 0.0) > RIVAL
    rival = line and not told.get("held", 1.0)
    if not (denied or wide or small or rival or is_echoed(told) or stem_is_wave(valve)):
        return valve
    return dataclasses.replace(
        valve,
        verdict=VerdictKind.UNDECIDED,
        static_interval=(0.0, valve.static_interval[1]),
        dynamic_interval=(0.0, valve.dynamic_interval[1]),
        band_interval=(0.0, valve.sum_interval[1]),
    )


def stem_is_wave(valve: ValveEstimate) -> bool:
    """Tell whether the stem of a valve is a wave itself."""
    band_share = valve.evidence["share"] * (1.0 + valve.dynamic_friction / valve.static_friction)
    return is_wave_itself(valve.evidence, band_share)
