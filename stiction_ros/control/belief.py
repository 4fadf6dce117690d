"""Where the controller believes the stem of a sticky valve to be, and how surely."""

import numpy as np

from stiction_ros.control.jump_form import FrictionSpread, JumpForm
from stiction_ros.effects.behaviour import Memory

STARTS = 17  # stem positions followed while the true one is unknown


class ValveBelief:
    """One sticky valve: its law, the stem estimate χ̂, and an interval for it.

    At the start the stem may be anywhere within f_S of OP. Several positions of that interval
    are followed by the law; a slip that all of them make brings them together, and from this
    *first sure slip* on the stem is known as well as f_D is.
    """

    def __init__(self, form: JumpForm, spread: FrictionSpread | None = None) -> None:
        """Take ``form`` for true, its frictions uncertain by ``spread`` where that is known."""
        self.form, self.spread = form, spread
        self.stem = 0.0
        self._memory: Memory = 0.0
        self._others: list[Memory] = []
        self._positions: tuple[float, float] = (0.0, 0.0)

    def start(self, op: float, low: float = -np.inf, high: float = np.inf) -> None:
        """Begin with OP at rest at ``op``, %, the stem within f_S of it and in the limits."""
        reach = self.form.static_friction
        ends = max(op - reach, min(low, op)), min(op + reach, max(high, op))
        law = self.form.law
        self._memory, self.stem = law.rest(op), op
        starts = np.linspace(*ends, STARTS).tolist()
        self._others = [law.step(law.rest(stem), op, 0.0)[0] for stem in starts]
        self._positions = ends

    def settle(self, stem: float) -> None:
        """Take the stem to be surely at ``stem``, %, with OP at rest there."""
        self._memory, self.stem = self.form.law.rest(stem), stem
        self._others, self._positions = [], (stem, stem)

    def apply_op(self, op: float) -> float:
        """Apply ``op``, %, for one sample and return χ̂, %."""
        law = self.form.law
        self._memory, self.stem = law.step(self._memory, op, 0.0)
        if not self._others:
            self._positions = (self.stem, self.stem)
            return self.stem
        moved = [law.step(memory, op, 0.0) for memory in self._others]
        stems = [stem for _, stem in moved] + [self.stem]
        self._positions = (min(stems), max(stems))
        sure = self._positions[1] - self._positions[0] <= 1e-9
        self._others = [] if sure else [memory for memory, _ in moved]
        return self.stem

    def expected(self, op: float) -> float:
        """Return the χ̂, %, that :meth:`apply_op` would bring about; nothing changes."""
        return self.form.law.step(self._memory, op, 0.0)[1]

    @property
    def interval(self) -> tuple[float, float]:
        """Lowest and highest stem position that OP so far allows, %."""
        return self._positions

    @property
    def sure(self) -> bool:
        """Whether a slip that no start position could escape has happened."""
        return not self._others

    def raise_static(self, static_friction: float, stem: float) -> None:
        """Take f_S to be at least ``static_friction``, %: the stem has stayed at ``stem``.

        What was known of the intervals is contradicted by this and dropped.
        """
        self.form = self.form.raised(static_friction)
        self.spread = None
        self.settle(stem)
