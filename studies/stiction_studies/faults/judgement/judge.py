"""Holds what was seen of a case against what is expected."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.judgement.flow import largest_move, longest_without, new_ops, recovered
from stiction_studies.faults.judgement.notices import look_for
from stiction_studies.faults.observation import Known, Observation
from stiction_studies.faults.terms import Bag, Pace, Phase

LEAST_SAMPLES = 50  # applied OPs in succession below which nothing can be said
LONGEST_LINE = 2000  # characters of a line in a log: more is text from the network
AGAIN = 3.0  # s without a new OP in lockstep: the plant shows a sample again each second
LOOP = ("plant", "controller", "estimator")
SHARE = 0.1  # by which a known friction may differ after the fault


@dataclasses.dataclass(frozen=True, kw_only=True)
class Verdict:
    """What every case ends with."""

    reasons: tuple[str, ...] = ()  # why it fails; empty for a pass
    seconds: float = 0.0  # that the case took

    @property
    def passed(self) -> bool:
        """Whether everything is as expected."""
        return not self.reasons

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        return dataclasses.asdict(self) | {"passed": self.passed}


@dataclasses.dataclass(frozen=True)
class Outcome(Verdict):
    """The verdict of one case."""

    # fault, pace, phase: which
    fault: str
    pace: Pace
    phase: Phase
    beyond: float = math.nan  # largest move of OP beyond what is allowed, %
    without: float = math.nan  # longest time without a new OP, s
    noticed: float | None = None  # until the last of its diagnostics was shown, s; None for none
    # from the end of the fault until OP flowed again, s; None for never
    recovered: float | None = None
    gone: float | None = None  # until the last of its diagnostics had ended, s; None for none
    ended: bool = False  # whether the loop ended with a clear sentence
    bag: bool = False  # whether the bag is as expected


def judge(fault: Fault, pace: Pace, seen: Observation, allowed: float) -> Outcome:
    """Judge one case.

    Args:
        fault: what was done.
        pace: of the loop.
        seen: what was seen of it.
        allowed: largest move of OP between two samples, %.
    """
    reasons = list(seen.remarks)
    move, count = largest_move(seen)
    beyond = max(move - allowed, 0.0)
    if beyond > 0.0:
        reasons.append(f"OP moves {move:.2f} % in a sample, allowed are {allowed:.2f}")
    fresh = new_ops(seen)
    ending = _ending(fault, pace, seen)
    until = seen.over if ending is not None else seen.until
    without = longest_without(seen, fresh, until)
    back = recovered(seen, fresh)
    shown: tuple[float | None, float | None] = (None, None)
    if ending is not None:
        reasons += ending
    else:
        if count < LEAST_SAMPLES and not fault.stops:
            reasons.append(f"only {count} applied OPs were seen")
        reasons += _flow(fault, seen, without, back) + _exits(seen)
        shown, missed = _notices(fault, pace, seen)
        reasons += missed
        if not fault.forgets:
            reasons += _knowledge(seen)
    reasons += wrong_in_logs(seen.logs)
    bag = _bag(fault, seen)
    reasons += bag
    return Outcome(
        fault.name,
        pace,
        seen.phase,
        beyond,
        without,
        shown[0],
        back,
        shown[1],
        ending is not None,
        not bag,
        reasons=tuple(reasons),
    )


def _flow(fault: Fault, seen: Observation, without: float, back: float | None) -> list[str]:
    if back is None:
        return [f"OP does not flow again within {seen.until - seen.over:.1f} s after the fault"]
    found = []
    if back > fault.recovery:
        found.append(f"OP flows again after {back:.1f} s, allowed are {fault.recovery:g}")
    allowed = max(fault.silence, 10 * seen.period if seen.period else AGAIN)
    if without > allowed:
        found.append(f"no new OP for {without:.1f} s, allowed are {allowed:g}")
    return found


def _notices(
    fault: Fault, pace: Pace, seen: Observation
) -> tuple[tuple[float | None, float | None], list[str]]:
    found = [look_for(notice, seen) for notice in fault.noticed_in(pace)]
    shown = [one.shown for one in found if one.shown is not None]
    gone = [one.gone for one in found if one.gone is not None]
    reasons = [one.reason for one in found if one.reason]
    return (max(shown, default=None), max(gone, default=None)), reasons


def _exits(seen: Observation) -> list[str]:
    return [
        f"{node} ended with code {end.code}" for node, end in seen.ended.items() if not end.by_fault
    ]


def _ending(fault: Fault, pace: Pace, seen: Observation) -> list[str] | None:
    """Return what is wrong with the end of the loop; None when it goes on."""
    if pace not in fault.ends or not any(name in seen.ended for name in LOOP):
        return None
    found = [f"{name} did not end" for name in LOOP if name not in seen.ended]
    for node, end in seen.ended.items():
        expected = 1 if node == "plant" else 0
        if end.by_fault:
            continue
        if end.code != expected:
            found.append(f"{node} ended with code {end.code} instead of {expected}")
        if not end.log.strip():
            found.append(f"{node} ended without a word")
    return found


def _knowledge(seen: Observation) -> list[str]:
    """Return what the controller should not have learnt or forgotten."""
    before, after = seen.before, seen.after
    if seen.phase is Phase.AFTER and not before.friction:
        return ["the controller never knew the friction"]
    if after.mode != before.mode:
        return [f"the mode is {after.mode or 'unknown'} after the fault, {before.mode} before"]
    return _changed(before, after)


def _changed(before: Known, after: Known) -> list[str]:
    found = []
    for name in sorted(before.friction.keys() | after.friction.keys()):
        was, now = before.friction.get(name, 0.0), after.friction.get(name, 0.0)
        if not abs(now - was) <= SHARE * max(was, 1e-6):
            found.append(f"{name} is {now:.3g} after the fault, {was:.3g} before")
    return found


def wrong_in_logs(logs: Mapping[str, str]) -> list[str]:
    """Return what no log of a node may hold."""
    found = []
    for node, log in logs.items():
        if "Traceback (most recent call last)" in log:
            found.append(f"{node} wrote a traceback")
        if any(len(line) > LONGEST_LINE for line in log.splitlines()):
            found.append(f"{node} wrote a line of more than {LONGEST_LINE} characters")
    return found


def _bag(fault: Fault, seen: Observation) -> list[str]:
    if fault.bag is Bag.LOST:
        return []
    bag = seen.bag
    if bag.reason:
        return [f"the bag cannot be read: {bag.reason}"]
    if fault.bag is Bag.WHOLE and (bag.missing or not bag.expected):
        return [f"{bag.missing} of {bag.expected} messages are not in the bag"]
    return []
