"""Watching a new controller after the swap, to roll it back when it does worse."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.settings import setting

FEWEST = 20  # samples of a reference, where there are so many


@dataclasses.dataclass(frozen=True)
class WatchRule:
    """A new controller must not be worse than the one it replaced.

    After a swap the mean absolute error of each output over ``watch_samples`` samples is held
    against the mean over up to ``watch_reference`` samples before it: long enough for several
    limit cycles, in which a stuck valve may rest near the set-point for a while. Samples within
    ``watch_settle`` of a set-point move count on neither side. More than ``watch_ratio`` times
    the error, or more than ``watch_failures`` failed steps, rolls the controller back.
    Nor do samples count for which another one has the valves, as the plant's own controller;
    a swap before which none of ours counted has no reference, and is not judged by the error.
    """

    watch_samples: int = setting(60, "samples judged after a swap; 0 never judges", low=0)
    watch_reference: int = setting(1000, "samples before a swap to compare with", low=1)
    watch_settle: int = setting(30, "samples left out after a set-point move", low=0)
    watch_ratio: float = setting(1.5, "largest tolerated ratio of mean errors", low=1.0)
    watch_failures: int = setting(5, "failed steps tolerated while watching", low=0)


class Watch:
    """Errors of the running controller, and of the one before."""

    def __init__(self, rule: WatchRule) -> None:
        self.rule = rule
        self._recent: list[FloatArray] = []
        self._since_move = 0
        self._last_sp: FloatArray | None = None
        self._reference: FloatArray | None = None
        self._failures = 0
        self.active = False

    def add(self, pv: FloatArray, sp: FloatArray, failed: bool) -> None:
        """Take in one sample; one without a measurement says nothing of the controller.

        Neither do the samples behind it, as behind a move of the set-point.
        """
        if not (np.isfinite(pv).all() and np.isfinite(sp).all()):
            self.disturb()
            return
        if self._last_sp is not None and not np.array_equal(sp, self._last_sp):
            self._since_move = 0
        self._last_sp = sp
        self._since_move += 1
        if self._since_move > self.rule.watch_settle:
            self._recent.append(np.abs(pv - sp))
            if not self.active:
                del self._recent[: -self.rule.watch_reference]
        if self.active and failed:
            self._failures += 1

    def begin(self, last: int = 0) -> None:
        """Start judging: what was seen so far becomes the reference.

        Where the valve itself is known to have changed, that is the ``last`` samples since: a
        controller for a valve that sticks more is not to be held against the time before.
        """
        if self.rule.watch_samples == 0:
            return
        before = self._recent[-max(last, FEWEST) :] if last else self._recent
        if not self.active:  # what is on trial itself is no reference
            self._reference = np.mean(before, axis=0) if before else None
        self._recent, self._failures, self.active = [], 0, True

    def disturb(self) -> None:
        """Leave out the next samples, as behind a move of the set-point."""
        self._since_move = 0

    def stop(self) -> None:
        self.active = False

    def verdict(self) -> str:
        """Return why to roll back, or an empty text; ends the watch when it is over."""
        if not self.active:
            return ""
        if self._failures > self.rule.watch_failures:
            self.active = False
            return f"{self._failures} failed steps since the swap"
        if len(self._recent) < self.rule.watch_samples:
            return ""
        self.active = False
        if self._reference is None:
            return ""
        mean = np.mean(self._recent, axis=0)
        worse = mean > self.rule.watch_ratio * self._reference
        if not worse.any():
            return ""
        i = int(np.argmax(mean / np.maximum(self._reference, 1e-300)))
        return f"mean error {mean[i]:.3g} after the swap against {self._reference[i]:.3g} before"


class Approach:
    """A set-point that begins at PV and is at its own value some samples later.

    After a start, and after a hold, PV may be far from the set-point; a controller that answers
    the whole error at once moves the valves further than any move of the set-point does.
    """

    def __init__(self, pv: FloatArray, sp: FloatArray, samples: int) -> None:
        """Begin at ``pv`` (p,), to be at the set-points after ``samples``, ``sp`` (p,) now."""
        self._from, self._samples = pv - sp, samples
        self._sample = 0

    @property
    def over(self) -> bool:
        """Whether the next aim is the set-point itself."""
        return self._sample >= self._samples

    def aim(self, sp: FloatArray) -> FloatArray:
        """Return what to aim at in the next sample, shape (p,), with set-points ``sp`` (p,)."""
        self._sample += 1
        left = max(1.0 - self._sample / (self._samples + 1), 0.0)
        return np.asarray(sp + left * self._from)
