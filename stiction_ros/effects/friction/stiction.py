"""What a law of stiction is, and what a controller sees of it that moves OP in steps.

Friction is written as (f_S, f_D) or as (S, J): S = f_S + f_D is the width of the band that OP
crosses after a reversal, J = f_S − f_D the jump.
"""

import dataclasses
from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, parameter
from stiction_ros.effects.friction.moving_rules import MovingRules
from stiction_ros.effects.seen import Seen
from stiction_ros.errors import InputError

SLIPS = "slips"  # the switching of He's law: a rectangle of J and S for each pattern of slips
Switching = str | type[MovingRules] | None
LEAST_MARGIN = 1e-4  # %; an error of exactly f_S does not slip


@dataclasses.dataclass(frozen=True)
class FrictionSpread:
    """Half-widths of the intervals of f_S and f_D, both in % and at least 0."""

    static: float
    dynamic: float


@dataclasses.dataclass(frozen=True)
class JumpForm:
    r"""The moves that a sticky valve can make when OP rests between them.

    .. math::
        \Delta\chi = 0 \quad\text{with } |u - \chi| \le f_S, \qquad
        |\Delta\chi| > K (f_S - f_D) \quad\text{with }
        u = \chi + \Delta\chi / K + f_D \operatorname{sign}(\Delta\chi).

    K = 1 except for the semi-physical law; below 1 a slip falls short of its end. Kano's law and
    the reconstruction of XCH's also let a stem that moved at the last sample go on by less than
    that; this is not used.
    """

    law: "Stiction"  # the behaviour it was taken from
    static_friction: float  # static_friction, dynamic_friction: f_S and f_D, %
    dynamic_friction: float
    overshoot: float = 1.0  # K, above 0
    strokes: int = 1  # samples in which OP must go the same way until the stem slips

    @property
    def least(self) -> float:
        """Smallest move of the stem, %."""
        return self.overshoot * (self.static_friction - self.dynamic_friction)

    def op(self, stem: float, wanted: float) -> float:
        """Return the OP, %, that moves the stem from ``stem`` to ``wanted`` by a slip."""
        move = wanted - stem
        return float(stem + move / self.overshoot + np.sign(move) * self.dynamic_friction)

    def inverse(self, stem: float, wanted: float) -> float:
        """Return the OP that brings the stem as near to ``wanted`` as one sample can.

        Between staying and the smallest jump the nearer is taken; staying returns ``stem``.
        """
        move = wanted - stem
        if abs(move) < max(self.least / 2.0, 1e-12):
            return float(stem)
        size = max(abs(move), self.least * (1.0 + 1e-9) + 1e-9)
        return self.op(stem, float(stem + np.copysign(size, move)))

    def slips(self, stem: float, op: float) -> bool:
        """Return whether ``op`` moves a stem that rests at ``stem``."""
        return abs(op - stem) > self.static_friction

    def way(
        self, applied: float, stem: float, op: float, under_way: Sequence[float] = ()
    ) -> list[float]:
        """Return OP, %, of the samples by which a resting stem slips as ``op`` means it to.

        Where one stroke is not enough, OP goes there in equal strokes and rests a sample behind,
        as the stem must come to rest before OP turns. Before that rest it goes on with OP.

        Args:
            applied: OP in force, %.
            stem: where the stem rests, %.
            op: where a slip ends, or anything that makes none, %.
            under_way: what is left of the way before, %.
        """
        onwards = (op - applied) * (applied - stem) > 0.0
        if len(under_way) == 1 and onwards and self.slips(stem, op):
            return [op, op]
        if under_way:
            return list(under_way)
        if self.strokes == 1 or not self.slips(stem, op):
            return [op]
        turned = (op - applied) * (op - stem) <= 0.0
        begin = stem if turned else applied
        strokes = np.linspace(begin, op, self.strokes + 1)[0 if turned else 1 :]
        return [*strokes.tolist(), op]

    def raised(self, static_friction: float) -> "JumpForm":
        """Return the form of the same law with a larger f_S, other parameters kept."""
        form = self.law.with_frictions(static_friction, self.dynamic_friction).jump_form()
        assert form is not None
        return form

    def margin(self, spread: FrictionSpread | None, share: float, floor: float) -> float:
        """Return by how much a planned jump exceeds the smallest one, %.

        It is the half-widths of the intervals, at least ``floor`` of f_S; without any ``share``.
        """
        if spread is None:
            wanted = share * self.static_friction
        else:
            wanted = max(spread.static + spread.dynamic, floor * self.static_friction)
        return self.overshoot * max(wanted, LEAST_MARGIN)


@dataclasses.dataclass(frozen=True)
class Stiction(Behaviour):
    """What holds for every friction law that does not say otherwise."""

    effect: ClassVar[str] = "stiction"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = (
        "let OP reverse by more than the friction that matters, as a cycle does"
    )
    separation: ClassVar[str] = (
        "ramp OP slowly through a reversal and back, and record the stem: at the end of a "
        "rest, a stem with stiction jumps and a stem with backlash follows OP smoothly"
    )
    family: ClassVar[str] = "friction"
    least: ClassVar[float] = 0.1  # %
    # For `stiction identify`.
    # how its switching patterns are listed, so that a search can be exact: ``SLIPS``, or the rules
    # of a law with a moving state. The exact search refuses a law with None, the default search
    # takes it
    switching: ClassVar[Switching] = None
    # keys of further parameters that stay at their defaults, which is said: constants of the law.
    # All others are identified
    held: ClassVar[tuple[str, ...]] = ()
    told_of_step: ClassVar[tuple[str, ...]] = (*Behaviour.told_of_step, *("switching", "jump_form"))

    def jump_form(self) -> JumpForm | None:
        """Return the moves that it can make when OP rests between them; None for no form."""
        return None

    def figures(self) -> dict[str, float]:
        """Return its parameters by their keys, f_S and f_D among them."""
        return {entry.key: getattr(self, entry.attribute) for entry in self.parameters()}

    def with_frictions(self, static_friction: float, dynamic_friction: float) -> Self:
        """Return the law with another f_S and f_D, %, all else kept."""
        both = {"static_friction": static_friction, "dynamic_friction": dynamic_friction}
        return dataclasses.replace(self, **both)


@dataclasses.dataclass(frozen=True)
class FrictionPair(Stiction):
    """A stiction law with static friction f_S and dynamic friction f_D, 0 ≤ f_D ≤ f_S."""

    static_friction: float = parameter("f_s", "%", "static friction band f_S", low=0.0)
    dynamic_friction: float = parameter("f_d", "%", "dynamic friction f_D", low=0.0)

    @classmethod
    def reference(cls, seen: Seen) -> tuple[float, ...]:
        return (1.0, 0.5)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.dynamic_friction > self.static_friction:
            raise InputError(
                f"{self.dynamic_friction:g} is larger than f_s = {self.static_friction:g}",
                where="f_d",
                fix="dynamic friction cannot exceed static friction, so lower f_d or raise f_s",
            )

    @classmethod
    def rows_of_frictions(cls, grid: FloatArray) -> FloatArray:
        """Return rows (f_S, f_D), %, as they are, shape (G, 2)."""
        return grid

    @property
    def jump(self) -> float:
        """Smallest move of the stem under He's law, J = f_S − f_D, in %."""
        return self.static_friction - self.dynamic_friction

    @property
    def stick_band(self) -> float:
        """Deadband plus stickband, S = f_S + f_D, in %."""
        return self.static_friction + self.dynamic_friction


@dataclasses.dataclass(frozen=True)
class SlipJumpPair(Stiction):
    """A stiction law with deadband plus stickband S and slip jump J.

    J = 0 is a pure deadband, J < S the undershoot, J = S no offset, J > S the overshoot
    case, whose dynamic friction f_D = (S − J)/2 is negative.
    """

    stick_band: float = parameter("s", "%", "deadband plus stickband S", low=0.0)
    jump: float = parameter("j", "%", "slip jump J of the stem", low=0.0)

    def figures(self) -> dict[str, float]:
        both = {"f_s": self.static_friction, "f_d": self.dynamic_friction}
        return both | super().figures()

    def with_frictions(self, static_friction: float, dynamic_friction: float) -> Self:
        band, jump = static_friction + dynamic_friction, static_friction - dynamic_friction
        return dataclasses.replace(self, stick_band=band, jump=jump)

    @classmethod
    def rows_of_frictions(cls, grid: FloatArray) -> FloatArray:
        """Return rows (S, J), %, of rows (f_S, f_D), shape (G, 2)."""
        return np.column_stack([grid[:, 0] + grid[:, 1], grid[:, 0] - grid[:, 1]])

    @property
    def static_friction(self) -> float:
        """Lead of OP over the stem at which it slips, f_S = (S + J)/2, in %."""
        return (self.stick_band + self.jump) / 2.0

    @property
    def dynamic_friction(self) -> float:
        """Distance that the moving stem keeps from OP, f_D = (S − J)/2, in %."""
        return (self.stick_band - self.jump) / 2.0


FrictionLaw = FrictionPair | SlipJumpPair
"""A stiction law that can be identified; parameters behind the first two are searched as well."""
