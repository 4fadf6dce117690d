r"""Stem positions of a smoothed law and their derivatives in f_S and f_D.

One sample is s_k = F(s_{k−1}, u_k, u_{k−1}, f), where the first entry of s is the stem χ; for the
law (5)-(6) it is the only one. Then first and second derivatives in f = (f_S, f_D) obey

.. math::
    \partial_p \chi_k &= F_\chi \, \partial_p \chi_{k-1} + F_p \\
    \partial_{pq} \chi_k &= F_{\chi\chi} \, \partial_p \chi_{k-1} \partial_q \chi_{k-1}
        + F_{\chi p} \, \partial_q \chi_{k-1} + F_{\chi q} \, \partial_p \chi_{k-1} + F_{pq}
        + F_\chi \, \partial_{pq} \chi_{k-1}
"""

from typing import Any

import casadi as ca
import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.paper.smoothed_laws import SmoothLaw

BLOCK = 250
SECOND = ((0, 0), (0, 1), (1, 1))


def _step(law: SmoothLaw, order: int) -> Any:
    """Return one sample: (s and its derivatives, u, [f_S, f_D, τ]) → the same one later.

    u is (u_k, u_{k−1}). With q entries of s, the first q of what is returned are s, the next 2q
    ∂s/∂f_S and ∂s/∂f_D, the last 3q the second derivatives in the order of ``SECOND``.
    """
    q = law.states
    symbols: Any = ca.SX.sym
    start, op, smoothing = symbols("s", q), symbols("u", 2), symbols("tau")
    friction = symbols("f", 2)
    following: Any = ca.vertcat(
        *law.step(
            ca.vertsplit(start), (op[0], op[1]), (friction[0], friction[1]), smoothing, ca.tanh
        )
    )
    inputs = ca.vertcat(start, friction)
    state: list[Any] = [start]
    new: list[Any] = [following]
    if order >= 1:
        slope: Any = ca.jacobian(following, inputs)
        first = symbols("s_f", q, 2)
        carried: Any = ca.vertcat(first, ca.SX.eye(2))
        state.append(ca.vec(first))
        new.append(ca.vec(ca.mtimes(slope, carried)))
    if order == 2:
        bends = [ca.hessian(following[i], inputs)[0] for i in range(q)]
        second = symbols("s_ff", q, 3)
        state.append(ca.vec(second))
        for k, (one, two) in enumerate(SECOND):
            bent = [ca.mtimes([carried[:, one].T, bend, carried[:, two]]) for bend in bends]
            new.append(ca.vertcat(*bent) + ca.mtimes(slope[:, :q], second[:, k]))
    arguments = [ca.vertcat(*state), op, ca.vertcat(friction, smoothing)]
    return ca.Function("step", arguments, [ca.vertcat(*new)], {"cse": True})


def _block(step: Any, length: int) -> Any:
    """Return ``length`` samples in one function: (state, u, parameters) → all states."""
    start = ca.SX.sym("start", step.size1_in(0))
    values, parameters = ca.SX.sym("u", 2, length), ca.SX.sym("p", 3)
    state, passed = start, []
    for k in range(length):
        state = step(state, values[:, k], parameters)
        passed.append(state)
    return ca.Function("block", [start, values, parameters], [ca.horzcat(*passed)])


class StemSensitivities:
    """CasADi expressions of the stem for a given OP.

    Attributes:
        law: of the valves.
    """

    def __init__(self, samples: int, law: SmoothLaw) -> None:
        """Prepare for OPs of N ``samples``."""
        self.law = law
        self._blocks = []
        for order in range(3):
            step = _step(self.law, order)
            whole, rest = divmod(samples, BLOCK)
            lengths = [BLOCK] * whole + ([rest] if rest else [])
            made = {length: _block(step, length) for length in set(lengths)}
            self._blocks.append([made[length] for length in lengths])

    def expression(self, order: int, op: FloatArray, parameters: Any) -> list[Any]:
        """Return χ and its derivatives up to ``order`` as rows of shape (1, N).

        They are ∂χ/∂f_S, ∂χ/∂f_D; then the second derivatives as in ``SECOND``. The stem before
        the first sample is the first OP, shape (N,); ``parameters`` are f_S, f_D, τ, shape (3, 1).
        """
        blocks = self._blocks[order]
        state = np.zeros(blocks[0].size1_in(0))
        state[0] = op[0]
        values = np.vstack([op, np.append(op[0], op[:-1])])
        at, current, passed = 0, ca.MX(ca.DM(state)), []
        for block in blocks:
            length = block.size2_in(1)
            part = block(current, ca.DM(values[:, at : at + length]), parameters)
            current, at = part[:, length - 1], at + length
            passed.append(part)
        rows = ca.horzcat(*passed)
        return list(ca.vertsplit(rows))[:: self.law.states]
