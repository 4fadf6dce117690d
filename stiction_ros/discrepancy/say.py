"""Step 6: one word for all looks, and the experiment that would say more."""

from __future__ import annotations

from collections.abc import Sequence

from stiction_ros.discrepancy.decide import GapVerdict
from stiction_ros.discrepancy.results import FoundEffect, Look
from stiction_ros.discrepancy.testable import Testable

LEFT = 0.4  # of the last effect's score: what may stay unexplained beside a name

_SEPARATING = (
    (
        {"lag", "pole"},
        "record the stem position: a slow valve shows there; move the sensor or compare it with "
        "a second one to tell a slow sensor from a slow process",
    ),
    (
        {"stiction", "backlash"},
        "ramp OP slowly through a reversal and back: a stem that jumps after its rest has "
        "stiction, one that follows smoothly has backlash",
    ),
    ({"step", "bias_step"}, "compare PV with a second sensor or a laboratory value"),
    ({"drift"}, "compare PV with a second sensor at the start and at the end"),
    (
        {"delay", "time_shift"},
        "record the set-point and the controller's tuning, or put OP and PV on one clock",
    ),
    (
        {"gain", "characteristic"},
        "hold the set-point at three levels of OP, tens of per cent apart",
    ),
)


def overall(
    effects: Sequence[FoundEffect], looks: Sequence[Look], testable: Sequence[Testable]
) -> tuple[GapVerdict, tuple[tuple[str, str], ...]]:
    """Return the verdict of all looks and what stays possible beside the effects.

    With several effects it is that of the largest, which is found first; each effect has a
    verdict of its own.
    """
    last = looks[-1].decision
    alternatives = [name for effect in effects for name in effect.alternatives]
    open_set = last.verdict is GapVerdict.AMBIGUOUS and not last.inseparable
    if not effects:
        if open_set and last.chosen is not None:
            names = [*last.chosen.candidate.keys, *last.alternatives]
            return GapVerdict.AMBIGUOUS, tuple(dict.fromkeys(names))
        if last.verdict is GapVerdict.UNKNOWN:
            return GapVerdict.UNKNOWN, ()
        if last.chosen is not None and not looks[-1].kept:
            return GapVerdict.NONE, ()
        if not any(t.testable for t in testable if _physical(t)):
            return GapVerdict.UNTESTABLE, ()
        return GapVerdict.NONE, ()
    if last.verdict is GapVerdict.UNKNOWN and _much_left(effects, looks[-1]):
        return GapVerdict.UNKNOWN, tuple(alternatives)
    return effects[0].verdict, tuple(dict.fromkeys(alternatives))


def experiment_for(
    verdict: GapVerdict,
    effects: Sequence[FoundEffect],
    alternatives: Sequence[tuple[str, str]],
    testable: Sequence[Testable],
) -> str:
    """Return what to do to learn more; empty when there is nothing to tell apart."""
    if verdict is GapVerdict.UNTESTABLE:
        return "; ".join(dict.fromkeys(t.experiment for t in testable if not t.testable))
    if verdict is GapVerdict.UNKNOWN:
        return "record the stem position and a second sensor, and move the set-point in steps"
    if not alternatives:
        return ""
    names = {effect for _, effect in alternatives}
    names |= {effect.effect for effect in effects if effect.alternatives}
    hints = [text for members, text in _SEPARATING if members & names]
    return "; ".join(hints) or "move the set-point in larger steps and record the stem position"


def _physical(entry: Testable) -> bool:
    return entry.place.startswith(("valve:", "process:"))


def _much_left(effects: Sequence[FoundEffect], look: Look) -> bool:
    outside = [fit for fit in look.scores.fits if not fit.candidate.inside]
    left = max((fit.delta_bic for fit in outside), default=0.0)
    return left > LEFT * max(effect.delta_bic for effect in effects)
