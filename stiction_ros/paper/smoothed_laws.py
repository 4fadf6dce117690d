r"""Friction laws that the paper's methods take: hard, and with switches of hyperbolic tangents.

.. math:: s_k = F(s_{k-1}, u_k, u_{k-1}, f_S, f_D; \tau)

The first entry is the stem; Kano's law and XCH's carry the direction of motion besides, 0 at rest.
"""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects import HeStiction, KanoStiction, SemiPhysicalStiction, XchStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.friction import simulate

OVERSHOOT = 1.99  # K of the semi-physical law, as published
SMOOTHING = 1e4
REST = 10.0  # OP that moves by less than REST / τ in a sample rests


def smoothed_step(
    stem: Any, value: Any, frictions: tuple[Any, Any], smoothing: Any, tanh: Any
) -> Any:
    r"""Return the next stem position of He's model, its switches replaced by hyperbolic tangents.

    .. math::
        \chi_k &= \eta_1(e_k) \chi_{k-1} + (1 - \eta_1(e_k)) u_k + \eta_2(e_k) f_D \tag{5} \\
        \eta_1(e) &= \tfrac12 \tanh(\tau(e + f_S)) + \tfrac12 \tanh(\tau(-e + f_S)) \\
        \eta_2(e) &= \tfrac12 \tanh(-\tau(e + f_S)) + \tfrac12 \tanh(\tau(-e + f_S)) \tag{6}

    All may be numbers or CasADi expressions, and ``tanh`` is of such.
    """
    static, dynamic = frictions
    error = value - stem
    above = tanh(smoothing * (error + static))
    below = tanh(smoothing * (-error + static))
    stays = 0.5 * above + 0.5 * below
    direction = -0.5 * above + 0.5 * below
    return stays * stem + (1.0 - stays) * value + direction * dynamic


def kano_step(memory: Any, value: Any, figures: tuple[Any, Any, Any], tanh: Any) -> tuple[Any, Any]:
    r"""Return χ and d of Kano's model, made differentiable in the way of (5) and (6).

    With the memory (χ, u, d), d = 0 at rest, the figures (f_S, f_D, τ), e_k = u_k − χ_{k−1} and
    σ(z) = ½(1 + tanh z)

    .. math::
        a^\pm &= \sigma(\tau(\pm d_{k-1} - \tfrac12))\, \sigma(\pm\tau(u_k - u_{k-1}) - 10)
            && \text{goes on} \\
        b^\pm &= (1 - a^+ - a^-)\, \sigma(\tau(\pm e_k - f_S)) && \text{slips} \\
        w^\pm &= a^\pm + b^\pm, \quad d_k = w^+ - w^- \\
        \chi_k &= (1 - w^+ - w^-) \chi_{k-1} + w^+ (u_k - f_D) + w^- (u_k + f_D)

    For a^± = 0 this is (5) and (6). The weights are positive and sum to one, so χ never leaves the
    range of its three modes.
    """
    stem, last, direction = memory[0], memory[1], memory[2]
    static, dynamic, tau = figures

    def switch(z: Any) -> Any:
        return 0.5 + 0.5 * tanh(z)

    move, error = tau * (value - last), value - stem
    up = switch(tau * (direction - 0.5)) * switch(move - REST)
    down = switch(tau * (-direction - 0.5)) * switch(-move - REST)
    stopped = 1.0 - up - down
    up = up + stopped * switch(tau * (error - static))
    down = down + stopped * switch(tau * (-error - static))
    moved = up * (value - dynamic) + down * (value + dynamic)
    return (1.0 - up - down) * stem + moved, up - down


@dataclasses.dataclass(frozen=True)
class SmoothLaw:
    """One law in both forms."""

    name: str  # of the hard law
    kind: Any  # its class
    states: int = 1  # entries of the state of the smoothed law: two are those of Kano's
    overshoot: float = 1.0  # K, by which a slip of a law with one state exceeds He's

    def step(
        self, state: Sequence[Any], op: tuple[Any, Any], figures: tuple[Any, Any, Any], tanh: Any
    ) -> list[Any]:
        """Return the next state; all may be numbers or CasADi expressions.

        Args:
            state: its entries.
            op: u_k and u_{k−1}, %.
            figures: f_S, f_D, % and τ, 1/%.
            tanh: of numbers or expressions.
        """
        if self.states > 1:
            return list(kano_step((state[0], op[1], state[1]), op[0], figures, tanh))
        follows = smoothed_step(state[0], op[0], figures[:2], figures[2], tanh)
        if self.overshoot == 1.0:
            return [follows]
        return [state[0] + self.overshoot * (follows - state[0])]

    def stems(self, op: FloatArray, friction: FloatArray, smoothing: FloatArray) -> FloatArray:
        """Return smoothed stems, shape (m, N), %, of OP, shape (N, m), %.

        Negative frictions, rows (f_S, f_D), shape (m, 2), %, count as 0, f_S below f_D as f_D.
        """
        made = np.empty(op.T.shape)
        for j, (static, dynamic) in enumerate(friction.tolist()):
            dynamic = max(dynamic, 0.0)
            column, tau = np.ascontiguousarray(op[:, j]), float(smoothing[j])
            figures = max(static, dynamic), dynamic, tau
            made[j] = _simulated(column, figures, self.states > 1, self.overshoot)
        return made

    def hard_stems(self, op: FloatArray, friction: FloatArray) -> FloatArray:
        """Return stems of the hard law, shape (m, N), %; arguments as of :meth:`stems`."""
        static = np.maximum(friction[:, 0], 0.0)
        rows = np.column_stack([static, np.clip(friction[:, 1], 0.0, static)])
        moved = zip(op.T, rows, strict=True)
        return np.array([simulate(self.kind, row[None], u, float(u[0]))[:, 0] for u, row in moved])


def smooth_law(name: str) -> SmoothLaw:
    """Return a law; InputError for one without a smoothed form."""
    if name not in SMOOTH_LAWS:
        raise InputError(
            f"the paper's methods have no smoothed form of law {name!r}",
            where="law",
            fix=f"use {' | '.join(SMOOTH_LAWS)}",
        )
    return SMOOTH_LAWS[name]


def final_smoothing(limits: FloatArray) -> FloatArray:
    """Return τ at which (5) equals (4), shape (m,), 1/%: 10⁴, more where OP spans below 10 %."""
    return np.maximum(SMOOTHING, 10.0 * SMOOTHING / np.maximum(limits, 1e-9))


_he_step, _kano_step = compiled(smoothed_step), compiled(kano_step)


@compiled
def _simulated(
    op: FloatArray, figures: tuple[float, float, float], moving: bool, overshoot: float
) -> FloatArray:
    """Return the stem, shape (N,), %, from rest at OP; ``moving`` for Kano's state."""
    stems, stem, last, direction = np.empty(len(op)), op[0], op[0], 0.0
    for k in range(len(op)):
        if moving:
            stem, direction = _kano_step((stem, last, direction), op[k], figures, math.tanh)
            last = op[k]
        else:
            follows = _he_step(stem, op[k], figures[:2], figures[2], math.tanh)
            stem = follows if overshoot == 1.0 else stem + overshoot * (follows - stem)
        stems[k] = stem
    return stems


SMOOTH_LAWS: Mapping[str, SmoothLaw] = {
    law.name: law
    for law in (
        SmoothLaw("he", HeStiction),
        SmoothLaw("kano", KanoStiction, states=2),
        SmoothLaw("xch", XchStiction, states=2),
        SmoothLaw("semi_physical", SemiPhysicalStiction, overshoot=OVERSHOOT),
    )
}
