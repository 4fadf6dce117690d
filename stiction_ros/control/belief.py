"""What a controller believes: the laws of its valves, where their stems are, and how surely."""

from collections.abc import Iterator, Sequence

import numpy as np

from stiction_ros.effects import Behaviour, behaviours
from stiction_ros.effects.behaviour import FloatArray, Memory
from stiction_ros.effects.friction.stiction import FrictionSpread, JumpForm, Stiction
from stiction_ros.errors import InputError

STARTS = 17  # stem positions followed while the true one is unknown


def jump_form(law: Behaviour) -> JumpForm:
    """Return the jump form of a law of stiction; InputError for a law that has none."""
    form = law.jump_form() if isinstance(law, Stiction) else None
    if form is None:
        known = [kind.law for kind in behaviours() if kind.law and _jumps(kind)]
        raise InputError(
            f"{law.title()} has no jump form, so no OP can be planned for it",
            where="friction law",
            fix=f"give the same friction by one of {', '.join(known)}",
        )
    return form


def _jumps(kind: type[Behaviour]) -> bool:
    return issubclass(kind, Stiction) and kind.jump_form is not Stiction.jump_form


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
        # lowest and highest stem position that OP so far allows, %
        self.interval: tuple[float, float] = (0.0, 0.0)

    def start(self, op: float, low: float = -np.inf, high: float = np.inf) -> None:
        """Begin with OP at rest at ``op``, %, the stem within f_S of it and in the limits."""
        reach = self.form.static_friction
        ends = max(op - reach, min(low, op)), min(op + reach, max(high, op))
        law = self.form.law
        self._memory, self.stem = law.rest(op), op
        starts = np.linspace(*ends, STARTS).tolist()
        self._others = [law.step(law.rest(stem), op, 0.0)[0] for stem in starts]
        self.interval = ends

    def settle(self, stem: float) -> None:
        """Take the stem to be surely at ``stem``, %, with OP at rest there."""
        self._memory, self.stem = self.form.law.rest(stem), stem
        self._others, self.interval = [], (stem, stem)

    def apply_op(self, op: float) -> float:
        """Apply ``op``, %, for one sample and return χ̂, %."""
        law = self.form.law
        self._memory, self.stem = law.step(self._memory, op, 0.0)
        if not self._others:
            self.interval = (self.stem, self.stem)
            return self.stem
        moved = [law.step(memory, op, 0.0) for memory in self._others]
        stems = [stem for _, stem in moved] + [self.stem]
        self.interval = (min(stems), max(stems))
        sure = self.interval[1] - self.interval[0] <= 1e-9
        self._others = [] if sure else [memory for memory, _ in moved]
        return self.stem

    def expected(self, op: float) -> float:
        """Return the χ̂, %, that :meth:`apply_op` would bring about; nothing changes."""
        return self.form.law.step(self._memory, op, 0.0)[1]

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
        """Number and belief of each valve that is taken to be sticky."""
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
