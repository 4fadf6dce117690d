"""The two ways to write the friction of a valve: (f_S, f_D), and (S, J).

S = f_S + f_D is the width of the band that OP crosses after a reversal, J = f_S − f_D the jump.
"""

import dataclasses
from typing import Self

import numpy as np

from stiction_ros.effects.behaviour import FloatArray, parameter
from stiction_ros.effects.friction.stiction import Stiction
from stiction_ros.effects.seen import Seen
from stiction_ros.errors import InputError

NOT_SEARCHED = "stiction is searched by the laws he and xch"  # what the laws here say to the gap


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
    def from_frictions(cls, static_friction: float, dynamic_friction: float) -> Self:
        """Build from f_S and f_D in %, other parameters at their defaults, which they must have."""
        _all_known(cls)
        return cls(static_friction, dynamic_friction)

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

    @classmethod
    def from_frictions(cls, static_friction: float, dynamic_friction: float) -> Self:
        """Build from f_S and f_D in %: S = f_S + f_D, J = f_S − f_D, others at their defaults."""
        _all_known(cls)
        return cls(static_friction + dynamic_friction, static_friction - dynamic_friction)

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


def _all_known(kind: type[Stiction]) -> None:
    """Refuse a law that two frictions do not tell all of."""
    fields = {field.name: field.default for field in dataclasses.fields(kind)}
    for entry in kind.parameters()[2:]:
        if fields[entry.attribute] is dataclasses.MISSING:
            raise InputError(
                f"f_S and f_D alone do not tell {entry.key!r} of {kind.title()}",
                fix="give all its parameters, as from_mapping takes them",
            )
