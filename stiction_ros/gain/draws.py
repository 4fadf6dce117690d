"""Loops that the identification does not tell apart: friction, controller, process drawn anew."""

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.result import ValveEstimate, VerdictKind
from stiction_ros.loop.repeated_loops import Equations
from stiction_ros.signals.controller_recovery import RecoveredController

DRAWS = 20
"""Loops drawn, the estimate itself among them."""

CANDIDATES = 60
"""Frictions that draws are taken from."""

TRIES = 200
"""Pairs drawn for each that is wanted: narrow bands leave few of them."""

TEMPER = 40.0
"""By what losses are divided where the jump of the stem counts, and not the band alone.

That of the true pair lies above the least of the possible ones by 43 in the median of the loops
that are found in the field, and by 240 in one of ten; of a likelihood that held it would be 1.4 and
4.6. Which of the pairs that share a band is likeliest hangs on how the stem jumps, which rounding,
compression and the lag of an actuator blur.
"""

SEED = 18
"""Of the draws: the same record gives the same answer."""

LEAST_SHARE = 0.2
"""Share of a coefficient that a draw keeps at least: gain and reset keep their sign."""


@dataclasses.dataclass(frozen=True)
class Draws:
    """R loops, each of which may be the recorded one."""

    frictions: FloatArray  # (f_S, f_D) of the valve that is looked at, %, shape (R, 2)
    tunings: FloatArray  # (K, K_i, K_d) of its controller, scaled, shape (R, 3)
    stems: FloatArray  # of all valves in the record, scaled, shape (R, m, N)
    equations: Equations  # of PV, and what comes from outside
    # draws at the begin that nothing was changed in: the loop as identified, and of a valve that is
    # undecided the loop without friction
    likeliest: int = 1

    def __len__(self) -> int:
        """Return R."""
        return len(self.frictions)

    def taken(self, which: list[int]) -> Self:
        """Return some of the draws, in this order."""
        a, b, delay, outside = self.equations
        return dataclasses.replace(
            self,
            frictions=self.frictions[which],
            tunings=self.tunings[which],
            stems=self.stems[which],
            equations=Equations(a[which], b[which], delay, outside[which]),
        )


def drawn_frictions(valve: ValveEstimate, count: int, random: np.random.Generator) -> FloatArray:
    """Return (f_S, f_D), %, shape (count, 2): the estimate, then pairs drawn from the intervals.

    Of a valve that is undecided nothing is known below the estimate: either it has what was found,
    or more, or none at all; none is not among these.
    """
    static, dynamic = _ends(valve.static_interval), _ends(valve.dynamic_interval)
    if valve.verdict is VerdictKind.UNDECIDED:
        static = max(valve.static_friction, 0.0), static[1]
        dynamic = max(valve.dynamic_friction, 0.0), dynamic[1]
    pairs = np.column_stack([random.uniform(*static, count), random.uniform(*dynamic, count)])
    pairs[0] = valve.static_friction, valve.dynamic_friction
    pairs[:, 1] = np.minimum(pairs[:, 1], pairs[:, 0])
    return pairs


def possible_frictions(valve: ValveEstimate, count: int, random: np.random.Generator) -> FloatArray:
    """Return (f_S, f_D), %, shape (count, 2): the estimate, then all that are possible, evenly."""
    static, dynamic = _ends(valve.static_interval), _ends(valve.dynamic_interval)
    low, high = valve.sum_interval
    tried = TRIES * count
    pairs = np.column_stack([random.uniform(*static, tried), random.uniform(*dynamic, tried)])
    band = pairs.sum(axis=1)
    inside = (pairs[:, 1] <= pairs[:, 0]) & (low <= band) & (band <= high)
    estimate = np.array([valve.static_friction, valve.dynamic_friction])
    estimate[1] = min(estimate)
    found = np.vstack([estimate, pairs[inside]])
    return found[np.arange(count) % len(found)]


def resampled(
    pairs: FloatArray, losses: FloatArray, verdict: VerdictKind, random: np.random.Generator
) -> FloatArray:
    """Return the frictions of the draws, %, shape (DRAWS, 2), the first of ``pairs`` before others.

    A pair of two figures that are each inside their interval may be one that the record rejects:
    pairs are taken as often as they are likely. A healthy valve has no friction; of an undecided
    one every second draw has none.

    Args:
        pairs: shape (C, 2).
        losses: −2 log likelihood of each, shape (C,).
        verdict: on the valve.
        random: source of the draws.
    """
    weights = np.exp(-0.5 * (losses - losses.min()))
    which = random.choice(len(pairs), DRAWS, p=weights / weights.sum())
    which[0] = 0
    found = pairs[which]
    if verdict is VerdictKind.HEALTHY:
        found[:] = 0.0
    elif verdict is VerdictKind.UNDECIDED:
        found[1::2] = 0.0
    return found


def drawn_tunings(law: RecoveredController, count: int, random: np.random.Generator) -> FloatArray:
    """Return (K, K_i, K_d), shape (count, 3): twice as recovered, then with its covariance."""
    values, vectors = np.linalg.eigh(law.covariance)
    spread = vectors * np.sqrt(np.maximum(values, 0.0))
    found = law.coefficients + random.standard_normal((count, 3)) @ spread.T
    found[:2] = law.coefficients
    for k in range(2):
        kept = LEAST_SHARE * law.coefficients[k]
        weak = found[:, k] * law.coefficients[k] < kept * law.coefficients[k]
        found[weak, k] = kept
    return np.asarray(found)


def _ends(interval: tuple[float, float]) -> tuple[float, float]:
    low, high = interval
    return max(low, 0.0), max(high, low, 0.0)
