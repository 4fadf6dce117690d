"""The stiction-compensating sequence (21), from which the paper starts its programme."""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.controllers.laws import PrintedFriction


def compensation(
    friction: PrintedFriction,
    before: float,
    stems: tuple[float, float],
    horizon: int,
    first_move: float,
) -> FloatArray:
    r"""Return OP, shape (N,), %, of one valve by the three moves of (21).

    .. math::
        u_k &= u_{k-1} \pm a f_S & + \text{ if } u_{k-1} \ge \chi_{ss} \\
        u_{k+1} &= \chi_k \pm f_D & + \text{ if } u_k \ge \chi_k \\
        u_{k+2} &= \chi_{ss} \mp f_D & - \text{ if } u_{k+1} \ge \chi_{ss} \\
        u_{k+j} &= u_{k+2} & j > 2

    Args:
        friction: of the valve.
        before: u_{k−1}, %.
        stems: χ_{k−1} and χ_ss, %.
        horizon: N ≥ 1, samples.
        first_move: a; for a > 2 the first move slips wherever the stem rests in its band.
    """
    stem, goal = stems
    static, dynamic = friction.static_friction, friction.dynamic_friction
    first = before + (first_move * static if before >= goal else -first_move * static)
    moved = float(friction.simulate(np.array([first]), start=stem)[0])
    second = moved + (dynamic if first >= moved else -dynamic)
    third = goal - (dynamic if second >= goal else -dynamic)
    op = np.full(horizon, third)
    op[: min(2, horizon)] = (first, second)[:horizon]
    return op
