r"""Friction laws that the paper's methods take: hard, and with switches of hyperbolic tangents.

.. math:: s_k = F(s_{k-1}, u_k, u_{k-1}, f_S, f_D; \tau)

The first entry is the stem; Kano's law and XCH's carry the direction of motion besides, 0 at rest.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.compiled import compiled
from stiction_ros.effects import HeStiction, KanoStiction, SemiPhysicalStiction, XchStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.friction.he_smoothed import smoothed_step
from stiction_ros.effects.friction.kano_smoothed import REST, kano_step
from stiction_ros.errors import InputError

OVERSHOOT = 1.99  # K of the semi-physical law, as published
SMOOTHING = 1e4

Simulated = Callable[[FloatArray, float, float, float], FloatArray]
Step = Callable[[Sequence[Any], tuple[Any, Any], tuple[Any, Any], Any, Any], list[Any]]


@dataclasses.dataclass(frozen=True)
class SmoothLaw:
    """One law in both forms."""

    name: str  # of the hard law
    kind: Any  # its class
    states: int  # entries of the state of the smoothed law
    simulated: Simulated  # stem, (N,), %, of OP (N,), f_S, f_D, % and τ, 1/%; from rest at OP
    step: Step  # state, (u_k, u_{k−1}), (f_S, f_D), τ and tanh → next state; numbers or CasADi

    def stems(self, op: FloatArray, friction: FloatArray, smoothing: FloatArray) -> FloatArray:
        """Return smoothed stems, shape (m, N), %, of OP, shape (N, m), %.

        Negative frictions, rows (f_S, f_D), shape (m, 2), %, count as 0, f_S below f_D as f_D.
        """
        made = np.empty(op.T.shape)
        for j, (static, dynamic) in enumerate(friction.tolist()):
            dynamic = max(dynamic, 0.0)
            column, tau = np.ascontiguousarray(op[:, j]), float(smoothing[j])
            made[j] = self.simulated(column, max(static, dynamic), dynamic, tau)
        return made

    def hard_stems(self, op: FloatArray, friction: FloatArray) -> FloatArray:
        """Return stems of the hard law, shape (m, N), %; arguments as of :meth:`stems`."""
        static = np.maximum(friction[:, 0], 0.0)
        rows = self.kind.rows_of_frictions(
            np.column_stack([static, np.clip(friction[:, 1], 0.0, static)])
        )
        stems = [
            self.kind.simulate_grid(row[None, :], u, float(u[0]))[:, 0]
            for u, row in zip(op.T, rows, strict=True)
        ]
        return np.array(stems)


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


@compiled
def _he(op: FloatArray, static: float, dynamic: float, smoothing: float) -> FloatArray:
    stems = np.empty(len(op))
    stem = op[0]
    for k in range(len(op)):
        error = op[k] - stem
        above = math.tanh(smoothing * (error + static))
        below = math.tanh(smoothing * (static - error))
        stays = 0.5 * above + 0.5 * below
        stem = stays * stem + (1.0 - stays) * op[k] + (0.5 * below - 0.5 * above) * dynamic
        stems[k] = stem
    return stems


@compiled
def _semi_physical(op: FloatArray, static: float, dynamic: float, smoothing: float) -> FloatArray:
    stems = np.empty(len(op))
    stem = op[0]
    for k in range(len(op)):
        error = op[k] - stem
        above = math.tanh(smoothing * (error + static))
        below = math.tanh(smoothing * (static - error))
        slips = 1.0 - 0.5 * above - 0.5 * below
        stem = stem + OVERSHOOT * (slips * error + (0.5 * below - 0.5 * above) * dynamic)
        stems[k] = stem
    return stems


@compiled
def _kano(op: FloatArray, static: float, dynamic: float, smoothing: float) -> FloatArray:
    stems = np.empty(len(op))
    stem, last, direction = op[0], op[0], 0.0
    for k in range(len(op)):
        move, error = smoothing * (op[k] - last), op[k] - stem
        onwards = 0.5 + 0.5 * math.tanh(smoothing * (direction - 0.5))
        backwards = 0.5 + 0.5 * math.tanh(smoothing * (-direction - 0.5))
        up = onwards * (0.5 + 0.5 * math.tanh(move - REST))
        down = backwards * (0.5 + 0.5 * math.tanh(-move - REST))
        stopped = 1.0 - up - down
        up += stopped * (0.5 + 0.5 * math.tanh(smoothing * (error - static)))
        down += stopped * (0.5 + 0.5 * math.tanh(smoothing * (-error - static)))
        stem = (1.0 - up - down) * stem + up * (op[k] - dynamic) + down * (op[k] + dynamic)
        direction, last = up - down, op[k]
        stems[k] = stem
    return stems


def _he_step(
    state: Sequence[Any], op: tuple[Any, Any], frictions: tuple[Any, Any], smoothing: Any, tanh: Any
) -> list[Any]:
    return [smoothed_step(state[0], op[0], frictions, smoothing, tanh)]


def _semi_physical_step(
    state: Sequence[Any], op: tuple[Any, Any], frictions: tuple[Any, Any], smoothing: Any, tanh: Any
) -> list[Any]:
    stem = state[0]
    return [stem + OVERSHOOT * (smoothed_step(stem, op[0], frictions, smoothing, tanh) - stem)]


def _kano_step(
    state: Sequence[Any], op: tuple[Any, Any], frictions: tuple[Any, Any], smoothing: Any, tanh: Any
) -> list[Any]:
    memory = state[0], op[1], state[1]
    return list(kano_step(memory, op[0], (*frictions, smoothing), tanh))


SMOOTH_LAWS: Mapping[str, SmoothLaw] = {
    law.name: law
    for law in (
        SmoothLaw("he", HeStiction, 1, _he, _he_step),
        SmoothLaw("kano", KanoStiction, 2, _kano, _kano_step),
        SmoothLaw("xch", XchStiction, 2, _kano, _kano_step),
        SmoothLaw("semi_physical", SemiPhysicalStiction, 1, _semi_physical, _semi_physical_step),
    )
}
