"""He's data-driven stiction model, equations (3) and (4)."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects.behaviour import Memory
from stiction_ros.effects.friction.stiction import SLIPS, FrictionPair, JumpForm, Switching


@dataclasses.dataclass(frozen=True)
class HeStiction(FrictionPair):
    r"""Static and dynamic friction of a sliding-stem valve.

    .. math::
        \chi_k = \begin{cases}
            u_k - f_D & u_k - \chi_{k-1} > f_S \\
            u_k + f_D & u_k - \chi_{k-1} < -f_S \\
            \chi_{k-1} & |u_k - \chi_{k-1}| \le f_S
        \end{cases} \tag{4}

    The memory is the stem position χ. The smallest move of the stem is the
    :attr:`jump` J = f_S − f_D.

    Examples:
        >>> import numpy as np
        >>> from stiction_ros import HeStiction
        >>> valve = HeStiction(static_friction=4.0, dynamic_friction=1.5)
        >>> valve.simulate(np.array([50.0, 53.0, 55.0, 54.0])).tolist()
        [50.0, 50.0, 53.5, 53.5]
    """

    law: ClassVar[str | None] = "he"
    switching: ClassVar[Switching] = SLIPS
    kernel: ClassVar[str] = "he_stems"

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        """Return the stem χ, %, twice, as memory and as output, of OP ``value``, %, by (4)."""
        assert isinstance(memory, float | int)
        error = value - memory
        if error > self.static_friction:
            stem = value - self.dynamic_friction
        elif error < -self.static_friction:
            stem = value + self.dynamic_friction
        else:
            stem = float(memory)
        return stem, stem

    def jump_form(self) -> JumpForm:
        """Return the moves that the valve can make when OP rests between them."""
        return JumpForm(self, self.static_friction, self.dynamic_friction)
