"""When a diagnostic has shown a fault, and when it was gone again."""

import dataclasses
import re
from collections.abc import Iterable

from stiction_studies.faults.observation import Observation, Shown
from stiction_studies.faults.terms import LEVELS, Notice

SHOWN_WITHIN = 3.0  # s, or
SHOWN_SAMPLES = 3  # samples, whichever is longer
COUNT = re.compile(r"-?\d+(\.\d+)?")  # how often, how late
GONE_WITHIN = 6.0  # s after the fault: shown for 2.5 s, told once a second, a lease of 3 s


@dataclasses.dataclass(frozen=True)
class Noticing:
    """One diagnostic of one case: s after the fault began, s after it was over, and faults."""

    shown: float | None
    gone: float | None
    reason: str


def level_at(statuses: tuple[Shown, ...], node: str, wall: float) -> str:
    """Return the level that ``node`` showed last before ``wall``; ok for a silent node."""
    told = _last_before(statuses, node, wall)
    return told.level if told else "ok"


def reasons(text: str) -> frozenset[str]:
    """Return what a status says, without how often: ``running; 2 samples behind; late: 3``."""
    parts = (part.strip() for part in text.split(";"))
    return frozenset(COUNT.sub("#", part) for part in parts if part)


def look_for(notice: Notice, seen: Observation) -> Noticing:
    """Judge one diagnostic: the level that is wanted, with a reason that was not there before.

    A sample that came late on its own account just before the fault is told of for some seconds.
    It is no sign of the fault, and none that the fault is not noticed.
    """
    wanted = LEVELS.index(notice.level)
    name = f"{notice.node} {notice.level}"
    told = _last_before(seen.statuses, notice.node, seen.begun)
    warned = told is not None and LEVELS.index(told.level) >= wanted
    known = reasons(told.text) if told is not None and warned else frozenset()
    own = [
        one
        for one in seen.statuses
        if one.node == notice.node and one.wall > seen.begun and LEVELS.index(one.level) >= wanted
    ]
    news = [one for one in own if not warned or reasons(one.text) - known]
    if not news:
        said = "was shown before the fault, and nothing new" if warned else "was never shown"
        return Noticing(None, None, f"{name} {said}")
    shown = news[0].wall - seen.begun
    allowed = max(SHOWN_WITHIN, SHOWN_SAMPLES * seen.period)
    if shown > allowed:
        return Noticing(shown, None, f"{name} after {shown:.1f} s, allowed are {allowed:.1f}")
    if notice.stays:
        return Noticing(shown, None, "")
    during = [reasons(one.text) for one in news if one is news[0] or one.wall <= seen.over]
    new = frozenset().union(*during) - known
    bad = [one.wall for one in news if not warned or reasons(one.text) & new]
    after = (one for one in seen.statuses if one.node == notice.node)
    good = [one.wall for one in after if one.wall > max(*bad, seen.over)]
    if not good:
        return Noticing(shown, None, f"{name} is still shown {seen.until - seen.over:.1f} s after")
    gone = max(good[0] - seen.over, 0.0)
    if gone > GONE_WITHIN:
        return Noticing(shown, gone, f"{name} ended {gone:.1f} s after, allowed are {GONE_WITHIN}")
    return Noticing(shown, gone, "")


def _last_before(statuses: tuple[Shown, ...], node: str, wall: float) -> Shown | None:
    own = [one for one in statuses if one.node == node and one.wall <= wall]
    return own[-1] if own else None


def changes_told(statuses: Iterable[Shown], begun: float) -> list[str]:
    """Return a line for every change of a status, in s after the fault ``begun``."""
    told: dict[str, tuple[str, str]] = {}
    lines = []
    for one in statuses:
        if told.get(one.node) != (one.level, one.text):
            told[one.node] = one.level, one.text
            lines.append(f"{one.wall - begun:8.2f} {one.node} {one.level}: {one.text}")
    return lines
