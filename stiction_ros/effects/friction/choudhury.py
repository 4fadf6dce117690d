"""Choudhury's data-driven stiction model, S and J."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Memory
from stiction_ros.effects.friction.moving_rules import SlopeRules
from stiction_ros.effects.friction.stiction import JumpForm, SlipJumpPair, Switching

MOVING = -1.0  # a threshold that every |u − x_ss| exceeds


@dataclasses.dataclass(frozen=True)
class ChoudhuryStiction(SlipJumpPair):
    r"""Stiction told from the sign of the slope of OP, v_k = sign(u_k − u_{k−1}).

    1. v_k ≠ v_{k−1}: the stem stays. If it was moving it is stuck now, and
       x_ss = u_{k−1} is kept until it moves again.
    2. v_k = v_{k−1} = 0: the stem stays.
    3. v_k = v_{k−1} = ±1: a moving stem moves on; a stuck one slips if |u_k − x_ss|
       exceeds its threshold. Then

    .. math:: \chi_k = u_k - v_k (S - J) / 2

    The threshold is J where the stem stuck because OP rested (the paper's I = 1) and OP goes
    on in the same direction, otherwise S. The memory is (χ, u, v, x_ss, threshold upwards,
    threshold downwards); :meth:`rest` puts both thresholds at (S + J)/2.

    By rule 1 the stem misses every sample at which OP turns or starts to move, whatever the
    size of the move and even without friction; OP that rests at every other sample never
    moves it. The law is for OP that is smooth from sample to sample. For noisy OP and for
    OP in steps take :class:`~stiction_ros.effects.KanoStiction`, which was made to mend this.

    The rules are those of the 2005 paper as others cite them. After a rest of OP the paper names J
    for "no change of direction"; direction is read as that of the last motion of the stem, since J
    after a reversal would move the stem against OP. A later flowchart tests
    \|u − χ\| > (S + J)/2 at the turning sample as well (M. A. A. S. Choudhury, M. Jain,
    S. L. Shah, Journal of Process Control 18, 2008, 232-243); that is not done here.

    References:
        M. A. A. S. Choudhury, N. F. Thornhill, S. L. Shah: Modelling valve stiction. Control
        Engineering Practice 13, 2005, 641-658.
    """

    law: ClassVar[str | None] = "choudhury"
    switching: ClassVar[Switching] = SlopeRules
    kernel: ClassVar[str] = "choudhury_stems"

    def rest(self, value: float) -> Memory:
        return (value, value, 0.0, value, self.static_friction, self.static_friction)

    def jump_form(self) -> JumpForm:
        """Return the moves that the valve can make when OP rests before and after them.

        OP must go the same way twice; its rest then leaves the slip condition at f_S on both
        sides, and the return to the stem does not count as a turn.
        """
        return JumpForm(self, self.static_friction, self.dynamic_friction, strokes=2)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        assert isinstance(memory, tuple)
        stem, last, last_slope, stuck_at, up, down = memory
        slope = float((value > last) - (value < last))
        if slope != last_slope:
            if up == MOVING:
                stuck_at = last
                up = self.jump if slope == 0.0 and last_slope > 0.0 else self.stick_band
                down = self.jump if slope == 0.0 and last_slope < 0.0 else self.stick_band
        elif slope != 0.0 and abs(value - stuck_at) > (up if slope > 0.0 else down):
            stem = value - slope * self.dynamic_friction
            up = down = MOVING
        return (stem, value, slope, stuck_at, up, down), stem
