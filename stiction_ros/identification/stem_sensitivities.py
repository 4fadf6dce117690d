r"""Stem positions of the smoothed law (5)-(6) and their derivatives in f_S and f_D.

One sample is χ_k = F(χ_{k−1}, u_k, f). First and second derivatives in f = (f_S, f_D) obey

.. math::
    \partial_p \chi_k &= F_\chi \, \partial_p \chi_{k-1} + F_p \\
    \partial_{pq} \chi_k &= F_{\chi\chi} \, \partial_p \chi_{k-1} \partial_q \chi_{k-1}
        + F_{\chi p} \, \partial_q \chi_{k-1} + F_{\chi q} \, \partial_p \chi_{k-1} + F_{pq}
        + F_\chi \, \partial_{pq} \chi_{k-1}

so value, gradient and Hessian of anything built on the stem cost one forward sweep each,
whatever the number of samples, and are exact.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.stiction_he_smoothed import smoothed_step

BLOCK = 250
SECOND = ((0, 0), (0, 1), (1, 1))


def _step(order: int) -> Any:
    """Return one sample: (χ and its derivatives, u, [f_S, f_D, τ]) → the same one later."""
    stem, value, smoothing = ca.SX.sym("chi"), ca.SX.sym("u"), ca.SX.sym("tau")
    friction = ca.SX.sym("f", 2)
    following = smoothed_step(stem, value, (friction[0], friction[1]), smoothing, ca.tanh)
    inputs = ca.vertcat(stem, friction)
    state, new = [stem], [following]
    if order >= 1:
        slope = ca.gradient(following, inputs)
        first = [ca.SX.sym("chi_s"), ca.SX.sym("chi_d")]
        state += first
        new += [slope[0] * first[p] + slope[1 + p] for p in range(2)]
    if order == 2:
        bend = ca.hessian(following, inputs)[0]
        second = [ca.SX.sym("chi_ss"), ca.SX.sym("chi_sd"), ca.SX.sym("chi_dd")]
        state += second
        for (p, q), now in zip(SECOND, second, strict=True):
            mixed = bend[0, 1 + p] * first[q] + bend[0, 1 + q] * first[p] + bend[1 + p, 1 + q]
            new.append(bend[0, 0] * first[p] * first[q] + mixed + slope[0] * now)
    arguments = [ca.vertcat(*state), value, ca.vertcat(friction, smoothing)]
    return ca.Function("step", arguments, [ca.vertcat(*new)], {"cse": True})


def _block(step: Any, length: int) -> Any:
    """Return ``length`` samples in one function: (state, u, parameters) → all states."""
    start = ca.SX.sym("start", step.size1_in(0))
    values, parameters = ca.SX.sym("u", 1, length), ca.SX.sym("p", 3)
    state, passed = start, []
    for k in range(length):
        state = step(state, values[k], parameters)
        passed.append(state)
    return ca.Function("block", [start, values, parameters], [ca.horzcat(*passed)])


class StemSensitivities:
    """CasADi expressions of the stem for a given OP.

    Attributes:
        samples: N of every OP that it takes.
    """

    def __init__(self, samples: int) -> None:
        self.samples = samples
        self._blocks = []
        for order in range(3):
            step = _step(order)
            whole, rest = divmod(samples, BLOCK)
            lengths = [BLOCK] * whole + ([rest] if rest else [])
            made = {length: _block(step, length) for length in set(lengths)}
            self._blocks.append([made[length] for length in lengths])

    def expression(self, order: int, op: FloatArray, parameters: Any) -> list[Any]:
        """Return χ and its derivatives up to ``order`` as rows of shape (1, N).

        Args:
            order: 0, 1 or 2.
            op: shape (N,); the stem before the first sample is the first OP.
            parameters: expression of shape (3, 1): f_S, f_D and τ in the units of ``op``.

        Returns:
            χ; then ∂χ/∂f_S, ∂χ/∂f_D; then the second derivatives in the order of ``SECOND``.
        """
        blocks = self._blocks[order]
        state = np.zeros(blocks[0].size1_in(0))
        state[0] = op[0]
        at, current, passed = 0, ca.MX(ca.DM(state)), []
        for block in blocks:
            length = block.size2_in(1)
            part = block(current, ca.DM(op[None, at : at + length]), parameters)
            current, at = part[:, length - 1], at + length
            passed.append(part)
        rows = ca.horzcat(*passed)
        return list(ca.vertsplit(rows))
