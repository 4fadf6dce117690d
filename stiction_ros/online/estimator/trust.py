"""When an estimate of friction is trusted, and what a later window may change."""

import dataclasses
from collections.abc import Mapping
from typing import Self

from stiction_ros.effects import Stiction
from stiction_ros.identification import ValveEstimate, VerdictKind
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.settings import setting

Interval = tuple[float, float]

UNIMPORTANT = 0.01  # of f_S: a change of f_S or f_D that needs no new controller
RESOLUTION = 1.01  # by which a friction offered exceeds one that is rejected
TRIED = 1.06  # of the lower end: how far up from it a friction that is not settled may lie
SETTLED = 1.12  # ratio of the ends of an interval of f_S from which on its middle is taken


@dataclasses.dataclass(frozen=True)
class TrustRule:
    """A valve is trusted to have friction after agreeing verdicts in successive windows.

    1. ``confirmations`` successive windows say *sticky* or *backlash*, which is friction without
       a jump, and their intervals of f_S and of f_D overlap: the friction is trusted, with the
       intersection of the intervals. Each end is first moved out by ``tolerance`` of f_S: an
       interval of one window covers the noise, not that the process is a little nonlinear.
    2. A later window is intersected with what is trusted. A loop that is compensated no
       longer excites the friction band, so its window is wide and changes nothing.
    3. Only ``contradictions`` successive windows whose intervals are disjoint from the trusted
       ones replace it: by the new estimate if they find friction, by a healthy valve if they
       say *healthy*.
    """

    confirmations: int = setting(2, "successive windows with friction before trust", low=1, high=20)
    tolerance: float = setting(
        0.02, "share of f_S by which every interval is widened", low=0.0, high=0.5
    )
    contradictions: int = setting(2, "successive disjoint windows before a change", low=1, high=20)


@dataclasses.dataclass(frozen=True)
class TrustedFriction:
    """Friction of one valve that the controller may rely on, by one law; % of travel.

    After a growth of friction only one move that failed and one that did not may be known, with
    much in between. Then the friction is not ``settled``: it is offered at the lower end of its
    interval, so that the next moves find out more.
    """

    static_friction: float
    static_interval: Interval
    dynamic_friction: float
    dynamic_interval: Interval
    settled: bool = True
    law: str = "he"
    further: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @classmethod
    def of(cls, found: ValveEstimate, tolerance: float) -> Self:
        """Return what one window says, its intervals widened by ``tolerance`` of f_S."""
        slack = tolerance * found.static_friction
        return cls(
            found.static_friction,
            _widened(found.static_interval, slack),
            found.dynamic_friction,
            _widened(found.dynamic_interval, slack),
            law=found.law,
            further=found.further,
        )

    @property
    def offered_interval(self) -> Interval:
        """The values of f_S that the controller should reckon with."""
        low, high = self.static_interval
        return (low, high) if self.settled else (low, min(high, TRIED * low))

    def narrowed(
        self, static: Interval, dynamic: float, dynamic_interval: Interval, *, anew: bool
    ) -> Self:
        """Return the friction as the moves since it changed tell it, all of them if ``anew``.

        Their intervals are given, and f_D, taken only where the one in force lies outside its own.
        """
        both = static if anew else _intersect(self.static_interval, static) or static
        settled = both[1] <= SETTLED * both[0]
        value = 0.5 * (both[0] + both[1]) if settled else RESOLUTION * both[0]
        if both[0] <= 0.0:  # the moves say nothing of how little it may be
            value = min(self.static_friction, both[1])
        known = dynamic_interval[0] <= self.dynamic_friction <= dynamic_interval[1]
        return dataclasses.replace(
            self,
            static_friction=value,
            static_interval=both,
            dynamic_friction=self.dynamic_friction if known else dynamic,
            dynamic_interval=self.dynamic_interval if known else dynamic_interval,
            settled=settled,
        )

    def figures(self) -> dict[str, float]:
        """Return f_S, f_D and the further parameters of the law, by their keys."""
        return {"f_s": self.static_friction, "f_d": self.dynamic_friction, **self.further}

    def behaviour(self) -> Stiction:
        """Return the law with these values."""
        frictions = self.static_friction, self.dynamic_friction
        return behaviour_of(self.law, frictions, self.further)


class ValveTrust:
    """The state of the rule for one valve."""

    def __init__(self, rule: TrustRule) -> None:
        self.rule = rule
        self.trusted: TrustedFriction | None = None
        self._pending: TrustedFriction | None = None
        self._found_windows = 0
        self._disjoint_windows = 0
        self._disjoint_verdict: VerdictKind | None = None

    def update(self, estimate: ValveEstimate, firm: bool = False) -> TrustedFriction | None:
        """Take in the estimate of one more window, which only narrows a ``firm`` trust."""
        found = TrustedFriction.of(estimate, self.rule.tolerance)
        if self.trusted is not None:
            self._revise(found, estimate.verdict, firm)
        elif estimate.verdict.has_friction:
            both = _combine(self._pending, found) if self._pending is not None else None
            self._found_windows = self._found_windows + 1 if both is not None else 1
            self._pending = both if both is not None else found
            if self._found_windows >= self.rule.confirmations:
                self.trusted = self._pending
        else:
            self._found_windows, self._pending = 0, None
        return self.trusted

    def renew(self, friction: TrustedFriction | None) -> None:
        """Trust what a change that was seen has left, None for a healthy valve."""
        self.trusted, self._pending = friction, None
        self._found_windows = self._disjoint_windows = 0

    def _revise(self, found: TrustedFriction, verdict: VerdictKind, firm: bool) -> None:
        assert self.trusted is not None
        both = _combine(self.trusted, found)
        if both is not None:
            self.trusted, self._disjoint_windows = both, 0
            return
        if firm and found.law == self.trusted.law:
            return
        said = VerdictKind.STICKY if verdict.has_friction else verdict  # with a jump or without
        if said is not self._disjoint_verdict:
            self._disjoint_windows, self._disjoint_verdict = 0, said
        self._disjoint_windows += 1
        if self._disjoint_windows < self.rule.contradictions:
            return
        if said is VerdictKind.STICKY:
            self.renew(found)
        elif said is VerdictKind.HEALTHY:
            self.renew(None)


def alike(one: Mapping[str, TrustedFriction], other: Mapping[str, TrustedFriction]) -> bool:
    """Return whether a controller built on either would do the same, or nearly so."""
    if one.keys() != other.keys():
        return False
    return all(
        abs(a.static_friction - b.static_friction) <= UNIMPORTANT * b.static_friction
        and abs(a.dynamic_friction - b.dynamic_friction) <= UNIMPORTANT * b.static_friction
        and (a.settled, a.law) == (b.settled, b.law)
        for a, b in ((one[name], other[name]) for name in one)
    )


def _combine(old: TrustedFriction, new: TrustedFriction) -> TrustedFriction | None:
    """Return the intersection, the old point kept where it still fits; None when disjoint."""
    if old.law != new.law:
        return None
    static = _intersect(old.static_interval, new.static_interval)
    dynamic = _intersect(old.dynamic_interval, new.dynamic_interval)
    if static is None or dynamic is None:
        return None
    return dataclasses.replace(
        old,
        static_friction=min(max(old.static_friction, static[0]), static[1]),
        static_interval=static,
        dynamic_friction=min(max(old.dynamic_friction, dynamic[0]), dynamic[1]),
        dynamic_interval=dynamic,
        settled=True,
    )


def _widened(interval: Interval, slack: float) -> Interval:
    return max(interval[0] - slack, 0.0), interval[1] + slack


def _intersect(one: Interval, other: Interval) -> Interval | None:
    low, high = max(one[0], other[0]), min(one[1], other[1])
    return (low, high) if low <= high else None
