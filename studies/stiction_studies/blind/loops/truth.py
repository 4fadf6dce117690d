"""What is hidden in a blind loop, kept apart from what the workflow sees."""

import dataclasses
from typing import Any

from stiction_ros.effects import Behaviour

FAMILIES = ("single", "two", "outside")


@dataclasses.dataclass(frozen=True)
class Hidden:
    """One hidden effect: ``KIND:TAG`` or ``data``, and the behaviour itself.

    Times of the behaviour count from the first sample of the record.
    """

    place: str
    behaviour: Behaviour

    @property
    def name(self) -> tuple[str, str]:
        """Place and effect, as the workflow would name them."""
        return self.place, self.behaviour.effect

    def to_mapping(self) -> dict[str, Any]:
        """Return ``{place, effect, …}``."""
        return {"place": self.place} | self.behaviour.to_mapping()


@dataclasses.dataclass(frozen=True)
class Regime:
    """Under which circumstances a loop was recorded."""

    process: str  # kind of the base loop
    tuning: str  # ``normal`` or ``tight``
    excitation: str  # ``moves`` of the set-point, ``none``, or ``noise``: none, and larger noise
    noise: str  # white ``measurement`` noise alone, ``ar1`` noise besides it, or ``equation`` noise
    half: bool  # whether the effect has half its size


@dataclasses.dataclass(frozen=True)
class Truth:
    """The answer to one blind loop."""

    family: str  # one of :data:`FAMILIES`
    seed: int
    regime: Regime  # its circumstances
    cause: str  # name for tables: ``none``, an effect with its kind of place, or several
    hidden: tuple[Hidden, ...]  # none in a healthy loop and outside the catalogue
    outside: str = ""  # a change that the catalogue does not hold, or an empty text

    @property
    def names(self) -> frozenset[tuple[str, str]]:
        """Places and effects of what is hidden."""
        return frozenset(entry.name for entry in self.hidden)

    def to_mapping(self) -> dict[str, Any]:
        """Return the JSON mapping."""
        return {
            "family": self.family,
            "seed": self.seed,
            "regime": dataclasses.asdict(self.regime),
            "cause": self.cause,
            "hidden": [entry.to_mapping() for entry in self.hidden],
            "outside": self.outside,
        }
