"""When a diagnostic has shown a fault, and when it was gone again."""

from __future__ import annotations

import dataclasses

from stiction_ros.faults.fault import LEVELS, Notice
from stiction_ros.faults.judgement.observation import Observation, Shown

SHOWN_WITHIN = 3.0  # s, or
SHOWN_SAMPLES = 3  # samples, whichever is longer
GONE_WITHIN = 6.0  # s after the fault: shown for 2.5 s, told once a second, a lease of 3 s


@dataclasses.dataclass(frozen=True)
class Noticing:
    """One diagnostic of one case: s after the fault began, s after it was over, and faults."""

    shown: float | None
    gone: float | None
    reason: str


def level_at(statuses: tuple[Shown, ...], node: str, wall: float) -> str:
    """Return the level that ``node`` showed last before ``wall``; ok for a silent node."""
    found = "ok"
    for one in statuses:
        if one.wall > wall:
            break
        if one.node == node:
            found = one.level
    return found


def look_for(notice: Notice, seen: Observation) -> Noticing:
    """Judge one diagnostic."""
    wanted = LEVELS.index(notice.level)
    name = f"{notice.node} {notice.level}"
    if LEVELS.index(level_at(seen.statuses, notice.node, seen.begun)) >= wanted:
        return Noticing(None, None, f"{name} was shown before the fault")
    own = [one for one in seen.statuses if one.node == notice.node and one.wall > seen.begun]
    shown = next((s.wall - seen.begun for s in own if LEVELS.index(s.level) >= wanted), None)
    if shown is None:
        return Noticing(None, None, f"{name} was never shown")
    allowed = max(SHOWN_WITHIN, SHOWN_SAMPLES * seen.period)
    if shown > allowed:
        return Noticing(shown, None, f"{name} after {shown:.1f} s, allowed are {allowed:.1f}")
    if notice.stays:
        return Noticing(shown, None, "")
    bad = [s.wall for s in own if LEVELS.index(s.level) >= wanted]
    good = [s.wall for s in own if s.wall > max(*bad, seen.over)] if bad else []
    if not good:
        return Noticing(shown, None, f"{name} is still shown {seen.until - seen.over:.1f} s after")
    gone = max(good[0] - seen.over, 0.0)
    if gone > GONE_WITHIN:
        return Noticing(shown, gone, f"{name} ended {gone:.1f} s after, allowed are {GONE_WITHIN}")
    return Noticing(shown, gone, "")
