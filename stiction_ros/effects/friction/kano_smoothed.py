"""Kano's model with its switches replaced by hyperbolic tangents."""

import dataclasses
import math
from typing import Any, ClassVar

from stiction_ros.effects.behaviour import Memory, parameter
from stiction_ros.effects.friction.stiction import SlipJumpPair

REST = 10.0  # OP that moves by less than REST / τ in a sample rests


@dataclasses.dataclass(frozen=True)
class SmoothedKanoStiction(SlipJumpPair):
    r"""Kano's model, differentiable, in the way of He's smoothed form (5)-(6).

    Kano's four memories u_S, stp, d and χ hold more than is needed: while the valve is
    stopped u_S = χ ± f_D, so its two thresholds are those of He, \|u − χ\| > f_S, with
    f_S = (S + J)/2 and f_D = (S − J)/2. What remains is (χ, u, d) with d = 0 at rest. With
    e_k = u_k − χ_{k−1} and σ(z) = ½(1 + tanh z)

    .. math::
        a^\pm &= \sigma(\tau(\pm d_{k-1} - \tfrac12))\, \sigma(\pm\tau(u_k - u_{k-1}) - 10)
            && \text{goes on} \\
        b^\pm &= (1 - a^+ - a^-)\, \sigma(\tau(\pm e_k - f_S)) && \text{slips} \\
        w^\pm &= a^\pm + b^\pm, \quad d_k = w^+ - w^- \\
        \chi_k &= (1 - w^+ - w^-) \chi_{k-1} + w^+ (u_k - f_D) + w^- (u_k + f_D)

    For a^± = 0 this is (5) and (6). The weights are positive and sum to one, so χ never
    leaves the range of its three modes. For τ ≥ 10⁴ the signature is that of
    :class:`~stiction_ros.effects.KanoStiction` within 10⁻⁶ % wherever OP moves by more
    than 20/τ a sample or not at all, and is further than 10/τ from a slip condition.

    Choudhury's law has no such form here: its threshold depends on the sign of the slope of
    two samples and on why the stem stuck, which are not functions of (χ, u, d).

    References:
        Kano et al. 2004 for the law, see :class:`~stiction_ros.effects.KanoStiction`; the
        smoothing is this library's, after equations (5) and (6).
    """

    law: ClassVar[str | None] = "kano_smoothed"
    not_identified: ClassVar[str] = (
        "its smoothed switches are for optimisers, its signature is that of kano"
    )

    smoothing: float = parameter("tau", "1/%", "smoothing parameter τ", low=1e-6, default=1e4)

    def rest(self, value: float) -> Memory:
        return (value, value, 0.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        figures = self.static_friction, self.dynamic_friction, self.smoothing
        stem, direction = kano_step(memory, value, figures, math.tanh)
        return (float(stem), value, float(direction)), float(stem)


def kano_step(memory: Any, value: Any, figures: tuple[Any, Any, Any], tanh: Any) -> tuple[Any, Any]:
    """Return χ and d for the memory (χ, u, d) and the figures (f_S, f_D, τ)."""
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
