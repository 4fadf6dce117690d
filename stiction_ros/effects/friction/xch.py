"""A two-state law in the parameters of He, standing in for the XCH model."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Memory
from stiction_ros.effects.friction.kano import follow
from stiction_ros.effects.friction.moving_rules import MovingRules
from stiction_ros.effects.friction.stiction import FrictionPair, JumpForm, Switching


@dataclasses.dataclass(frozen=True)
class XchStiction(FrictionPair):
    r"""He's slip condition with a moving state, so that a ramp moves the stem smoothly.

    With d = ±1 the direction of motion, d = 0 at rest, and e_k = u_k − χ_{k−1}:

    .. math::
        d_k &= \begin{cases}
            d_{k-1} & d_{k-1} (u_k - u_{k-1}) > 0 \\
            \operatorname{sign}(e_k) & |e_k| > f_S \\
            0 & \text{otherwise}
        \end{cases} \\
        \chi_k &= \begin{cases}
            u_k - d_k f_D & d_k \ne 0 \\
            \chi_{k-1} & d_k = 0
        \end{cases}

    The memory is (χ, u, d).

    **A reconstruction.** Xie, Cong and Horch improve the data-driven models until they pass
    the ISA standard tests for control valves. Their flowchart was not at hand: what is
    written here has their two parameters and the behaviour those tests ask for (no
    stick-slip on a ramp, as He's law has; a move of J after a pause, of S after a reversal,
    whatever the steps of OP), but it has not been compared with the paper. It equals
    :class:`~stiction_ros.effects.KanoStiction` with S = f_S + f_D and J = f_S − f_D.

    References:
        L. Xie, Y. Cong, A. Horch: An improved valve stiction simulation model based on ISA
        standard tests. Control Engineering Practice 21, 2013, 1359-1368.
    """

    law: ClassVar[str | None] = "xch"
    switching: ClassVar[Switching] = MovingRules
    kernel: ClassVar[str] = "following_stems"

    def rest(self, value: float) -> Memory:
        return (value, value, 0.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return follow(memory, value, self.static_friction, self.dynamic_friction)

    def jump_form(self) -> JumpForm:
        return JumpForm(self, self.static_friction, self.dynamic_friction)
