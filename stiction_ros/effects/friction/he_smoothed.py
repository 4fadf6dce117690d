"""The smoothed form of He's model, equations (5) and (6)."""

import dataclasses
import math
from typing import Any, ClassVar

from stiction_ros.effects.behaviour import Memory, parameter
from stiction_ros.effects.friction.he import HeStiction


@dataclasses.dataclass(frozen=True)
class SmoothedHeStiction(HeStiction):
    r"""He's model with its switches replaced by hyperbolic tangents.

    .. math::
        \chi_k &= \eta_1(e_k) \chi_{k-1} + (1 - \eta_1(e_k)) u_k + \eta_2(e_k) f_D \tag{5} \\
        \eta_1(e) &= \tfrac12 \tanh(\tau(e + f_S)) + \tfrac12 \tanh(\tau(-e + f_S)) \\
        \eta_2(e) &= \tfrac12 \tanh(-\tau(e + f_S)) + \tfrac12 \tanh(\tau(-e + f_S)) \tag{6}

    For τ ≥ 10⁴ its signature is that of :class:`HeStiction`.
    """

    law: ClassVar[str | None] = "he_smoothed"
    not_identified: ClassVar[str] = (
        "its smoothed switches are for optimisers, its signature is that of he"
    )

    smoothing: float = parameter("tau", "1/%", "smoothing parameter τ", low=1e-6, default=1e4)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        assert isinstance(memory, float | int)
        frictions = self.static_friction, self.dynamic_friction
        stem = float(smoothed_step(memory, value, frictions, self.smoothing, math.tanh))
        return stem, stem


def smoothed_step(
    stem: Any, value: Any, frictions: tuple[Any, Any], smoothing: Any, tanh: Any
) -> Any:
    """Return the next stem position by (5), (6); ``tanh`` is of numbers or CasADi expressions."""
    static, dynamic = frictions
    error = value - stem
    above = tanh(smoothing * (error + static))
    below = tanh(smoothing * (-error + static))
    stays = 0.5 * above + 0.5 * below
    direction = -0.5 * above + 0.5 * below
    return stays * stem + (1.0 - stays) * value + direction * dynamic
