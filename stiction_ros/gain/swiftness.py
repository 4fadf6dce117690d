r"""How much faster than the loop's own controller another one would answer.

A loop that cycles shows its process at the cycle and at what its controller answers, and hardly
beyond: there the drawn processes are alike because the prior says so. With P the process, C the
controller that is there and :math:`C'` the predictive one on a valve without friction, the loop
answers up to the crossover, the lowest frequency at which :math:`|C P|` falls below 1, and would
answer up to that of :math:`C' P`. Of :math:`C'` one sample is, with the observer's gains
:math:`K_x, K_d` and the first row :math:`K_z, K_v` of the horizon's solution,

.. math::
    e &= y - C \hat\xi - \hat d \\
    \hat\xi^+ &= \hat\xi + K_x e, \quad \hat d^+ = \hat d + K_d e \\
    \chi_{ss} &= -\hat d^+ / g_\infty, \quad \xi_{ss} = (I - A)^{-1} B \chi_{ss} \\
    \chi &= \chi_{ss} - K_z (\hat\xi^+ - \xi_{ss}) - K_v (\chi^- - \chi_{ss}).
"""

import numpy as np

from stiction_ros.control.design import ControlDesign
from stiction_ros.control.horizon import HorizonCost
from stiction_ros.control.observer import Observer
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.gain.draws import Draws
from stiction_ros.gain.recorded_loop import RecordedLoop
from stiction_ros.gain.retuning import (
    UNCHANGED,
    ComplexArray,
    controller_response,
    frequencies,
    process_response,
)

FASTEST = 3.0
"""Times the recorded loop's crossover up to which a promise is made.

In the field's seeds 0:599 five of eight loops above it become worse than they are, and five of 75
below.
"""


def times_as_fast(loop: RecordedLoop, design: ControlDesign, draws: Draws) -> float:
    """Return the crossover under a predictive controller over that of the recorded loop.

    Args:
        loop: with its own controller.
        design: of the other, scaled, its valve without friction.
        draws: loops; the median of them is given.
    """
    turn = frequencies()
    present = controller_response(loop, UNCHANGED, turn)
    other = predictive_response(design, turn)
    ratios = []
    for r in range(len(draws)):
        process = process_response(loop, draws, r, turn)
        ratios.append(_crossover(other * process) / _crossover(present * process))
    return float(np.median(ratios))


def predictive_response(design: ControlDesign, turn: ComplexArray) -> ComplexArray:
    """Return C' from SP − PV to the stem, shape (F,), of one valve and one output.

    Args:
        design: of the controller; the weights are those of the embedding.
        turn: the backward shift q at each frequency, shape (F,).
    """
    a, b, c, d = _states(design)
    eye = np.eye(len(a))
    return np.array([-(c @ np.linalg.solve(eye / q - a, b) + d) for q in turn])


def _states(design: ControlDesign) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Return the controller from PV to stem as a state space of (ξ̂, d̂, χ⁻)."""
    model = design.model
    n, b, c = model.order, model.b[:, 0], model.c[0]
    cost = HorizonCost(model, design.embedding)
    linear = np.hstack([cost.from_state, cost.from_last])
    k = np.linalg.solve(cost.hessian, linear)[0]
    gain = Observer(model, design.observer).gain[:, 0]
    rest = np.linalg.solve(np.eye(n) - model.a, b)
    # Rows on (ξ̂, d̂, χ⁻, y).
    error = np.concatenate([-c, [-1.0, 0.0, 1.0]])
    state = np.eye(n, n + 3) + np.outer(gain[:n], error)
    load = np.eye(1, n + 3, n)[0] + gain[n] * error
    aim = -load / float(c @ rest)
    last = np.eye(1, n + 3, n + 1)[0]
    stem = aim - k[:n] @ (state - np.outer(rest, aim)) - k[n] * (last - aim)
    following = np.vstack([model.a @ state + np.outer(b, stem), load, stem])
    return following[:, :-1], following[:, -1], stem[:-1], float(stem[-1])


def _crossover(open_loop: ComplexArray) -> float:
    """Return the lowest frequency at which an open loop falls below 1, in those looked at."""
    below = np.flatnonzero(np.abs(open_loop) < 1.0)
    place = int(below[0]) if len(below) else len(open_loop) - 1
    return float(np.geomspace(1e-4, 1.0, len(open_loop))[place])
