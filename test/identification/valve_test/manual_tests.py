"""Simulated tests in manual: steps of OP, a valve, a lag or a level, noise and a drifting load."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray

PAIRS = (0.5, -0.5, 1.2, -1.2, 3.0, -3.0, 0.0)


def path(levels: Sequence[float] = PAIRS, hold: int = 12) -> FloatArray:
    """Return OP about 50 %, each level held."""
    return 50.0 + np.repeat([0.0, *levels], hold)


def answer(
    op: FloatArray,
    friction: tuple[float, float] | None,
    seed: int,
    gain: float = 1.0,
    noise: float = 0.1,
    integrates: bool = False,
) -> FloatArray:
    """Return PV of a valve of He's law that rests at 50 %, a lag of 6 samples or an integrator."""
    random = np.random.default_rng(seed)
    stem = op if friction is None else HeStiction(*friction).simulate(op, start=50.0)
    load = np.cumsum(0.02 * random.standard_normal(len(op)))
    pv, state = np.empty(len(op)), 0.0
    for k in range(len(op)):
        pv[k] = state
        late = stem[max(k - 2, 0)] - 50.0 + load[k]
        state += gain * late / 16.0 if integrates else (gain * late - state) / 6.0
    return 100.0 + pv + noise * random.standard_normal(len(op))
