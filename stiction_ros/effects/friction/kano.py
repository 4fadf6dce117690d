"""Kano's data-driven stiction model: stopped and moving states, S and J."""

import dataclasses
from collections.abc import Sequence
from typing import ClassVar

from stiction_ros.effects.behaviour import FloatArray, Memory
from stiction_ros.effects.friction.moving_rules import MovingRules
from stiction_ros.effects.friction.stiction import JumpForm, SlipJumpPair, Switching


@dataclasses.dataclass(frozen=True)
class KanoStiction(SlipJumpPair):
    r"""Stiction with a moving state: once it slips, the stem follows OP until OP stops or turns.

    With d = ±1 the direction of the last motion (the friction force acts against it),
    u_S the OP at which the valve stopped, and stp = 1 while it is stopped, each sample

    1. stops a moving valve when OP rests or turns: if stp = 0 and
       Δu_k Δu_{k−1} ≤ 0, then u_S = u_{k−1} and stp = 1;
    2. releases a stopped one: backwards, d → −d, if −d (u_k − u_S) > S; onwards if
       d (u_k − u_S) > J; either sets stp = 0;
    3. moves what is released:

    .. math::
        \chi_k = \begin{cases}
            u_k - \tfrac{d}{2} (S - J) & stp = 0 \\
            \chi_{k-1} & stp = 1
        \end{cases}

    As u_S = χ + d (S − J)/2 while it is stopped, both thresholds are those of He,
    |u − χ| > f_S with f_S = (S + J)/2, and stp is d = 0: the memory is (χ, u, d). :meth:`rest`
    puts the stem in the middle of its band, so that it slips at f_S in both directions; the
    paper leaves this open. The paper also clips u to 0-100 % first; here that is the effect
    ``saturation``.

    References:
        M. Kano, H. Maruta, H. Kugemoto, K. Shimizu: Practical model and detection
        algorithm for valve stiction. 7th IFAC Symposium on Dynamics and Control of Process
        Systems, Cambridge (USA), 2004; IFAC Proceedings Volumes 37 (9), 859-864.
    """

    law: ClassVar[str | None] = "kano"
    switching: ClassVar[Switching] = MovingRules
    kernel: ClassVar[str] = "following_stems"

    def rest(self, value: float) -> Memory:
        return (value, value, 0.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        return follow(memory, value, self.static_friction, self.dynamic_friction)

    @classmethod
    def kernel_figures(cls, grid: FloatArray, sample_time: float) -> Sequence[FloatArray]:
        return (grid[:, 0] + grid[:, 1]) / 2.0, (grid[:, 0] - grid[:, 1]) / 2.0

    def jump_form(self) -> JumpForm:
        return JumpForm(self, self.static_friction, self.dynamic_friction)


def follow(memory: Memory, value: float, static: float, dynamic: float) -> tuple[Memory, float]:
    """Advance the memory (χ, u, d) of a valve with a moving state by a sample of OP.

    It moves on while OP goes on, and slips as He's law does; d = 0 at rest.
    """
    assert isinstance(memory, tuple)
    stem, last, direction = memory
    error = value - stem
    if direction * (value - last) <= 0.0:
        direction = float((error > 0.0) - (error < 0.0)) if abs(error) > static else 0.0
    if direction != 0.0:
        stem = value - direction * dynamic
    return (stem, value, direction), stem
