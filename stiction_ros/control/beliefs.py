"""What a controller believes of all valves of its loop."""

from collections.abc import Iterator, Sequence

import numpy as np

from stiction_ros.control.belief import ValveBelief
from stiction_ros.control.jump_form import FrictionSpread, JumpForm, jump_form
from stiction_ros.effects.behaviour import Behaviour, FloatArray


class ValveBeliefs(Sequence[ValveBelief | None]):
    """The belief in each valve, in their order; None for one that is taken to be healthy."""

    def __init__(
        self,
        frictions: Sequence[Behaviour | None],
        spreads: Sequence[FrictionSpread | None],
        limits: FloatArray,
    ) -> None:
        """Take what is given for each of the m valves, with ``limits`` (m, 2) of their stems."""
        self._beliefs = tuple(
            None if law is None else ValveBelief(jump_form(law), spread)
            for law, spread in zip(frictions, spreads, strict=True)
        )
        self._limits = limits.tolist()

    def __len__(self) -> int:
        return len(self._beliefs)

    def __getitem__(self, index: int) -> ValveBelief | None:  # type: ignore[override]
        return self._beliefs[index]

    @property
    def sticky(self) -> Iterator[tuple[int, ValveBelief]]:
        """The valves that are taken to be sticky, with their numbers."""
        return ((j, one) for j, one in enumerate(self._beliefs) if one is not None)

    @property
    def frictions(self) -> tuple[Behaviour | None, ...]:
        """Friction believed in now, per valve."""
        return tuple(None if one is None else one.form.law for one in self._beliefs)

    @property
    def spreads(self) -> tuple[FrictionSpread | None, ...]:
        """Half-widths of the intervals of the frictions, per valve, None where unknown."""
        return tuple(None if one is None else one.spread for one in self._beliefs)

    @property
    def forms(self) -> tuple[JumpForm | None, ...]:
        """Jump forms, per valve."""
        return tuple(None if one is None else one.form for one in self._beliefs)

    def intervals(self, stem: FloatArray) -> FloatArray:
        """Return lowest and highest stem, (m, 2), %, that the past allows; ``stem`` if healthy."""
        found = np.column_stack([stem, stem])
        for j, belief in self.sticky:
            found[j] = belief.interval
        return found

    def start(self, op: FloatArray) -> None:
        """Begin with OP at rest at ``op`` (m,), %, each stem anywhere within f_S of it."""
        for j, belief in self.sticky:
            belief.start(float(op[j]), *self._limits[j])

    def apply_op(self, op: FloatArray) -> FloatArray:
        """Apply ``op`` (m,), %, for one sample and return the stems, shape (m,), %."""
        stem = np.array(op, dtype=float)
        for j, belief in self.sticky:
            stem[j] = belief.apply_op(float(op[j]))
        return stem

    def expected(self, op: FloatArray) -> FloatArray:
        """Return the stems, shape (m,), %, that :meth:`apply_op` would bring about."""
        stem = np.array(op, dtype=float)
        for j, belief in self.sticky:
            stem[j] = belief.expected(float(op[j]))
        return stem
