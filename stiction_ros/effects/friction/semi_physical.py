"""The semi-physical stiction model of He and Wang: He's law with an overshoot factor."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Memory, parameter
from stiction_ros.effects.friction.stiction import FrictionPair, JumpForm


@dataclasses.dataclass(frozen=True)
class SemiPhysicalStiction(FrictionPair):
    r"""Static and dynamic friction of a stem that swings past its balance of forces.

    .. math::
        e_k &= u_k - \chi_{k-1} \\
        \chi_k &= \begin{cases}
            \chi_{k-1} + K (e_k - \operatorname{sign}(e_k) f_D) & |e_k| > f_S \\
            \chi_{k-1} & |e_k| \le f_S
        \end{cases}

    The memory is the stem position χ. The bracket is the move of He's law (3); K is the
    overshoot of a stem that is hardly damped while it slips, 1.99 as published.

    What differs from :class:`~stiction_ros.effects.HeStiction`:

    - K = 1 is He's law (3). With K > 1 a slip ends beyond u ∓ f_D, and χ_k depends on
      where the stem slipped from, so the past is not forgotten with one slip.
    - Under slow OP a slip moves the stem by K (f_S − f_D), as He's law with
      f_D' = K f_D − (K − 1) f_S; for K near 2 that is negative unless f_D is near f_S.
    - After a fast move of OP the error may still exceed f_S, on the other side: the stem
      slips back at the next sample. Without friction the error shrinks by 1 − K a sample,
      so only K = 1 gives χ = u.

    References:
        Q. P. He, J. Wang: Valve stiction modeling: first-principles vs data-driven
        approaches. American Control Conference, Baltimore, 2010, 3777-3782.
        Q. P. He, J. Wang: Valve stiction quantification method based on a semiphysical
        valve stiction model. Industrial & Engineering Chemistry Research 53, 2014,
        12010-12022.
    """

    law: ClassVar[str | None] = "semi_physical"
    held: ClassVar[tuple[str, ...]] = ("k",)  # as published; every slip hangs on its last digits
    kernel: ClassVar[str] = "semi_physical_stems"

    overshoot: float = parameter("k", "1", "overshoot factor K", low=1.0, high=2.0, default=1.99)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        assert isinstance(memory, float | int)
        stem, error = float(memory), value - memory
        if error > self.static_friction:
            stem += self.overshoot * (error - self.dynamic_friction)
        elif error < -self.static_friction:
            stem += self.overshoot * (error + self.dynamic_friction)
        return stem, stem

    def jump_form(self) -> JumpForm:
        return JumpForm(self, self.static_friction, self.dynamic_friction, self.overshoot)
