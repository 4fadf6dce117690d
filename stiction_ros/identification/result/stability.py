"""How an answer holds when the same record is looked at otherwise: at other rates, in halves."""

import dataclasses
from typing import Any

Interval = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Look:
    """One way of looking at a record."""

    name: str  # for people, such as ``rows of 4 s`` or ``first half``
    gain: float  # −2 log likelihood that friction adds there
    agrees: bool  # whether this look alone speaks for what is told of the valve
    # f_S + f_D that it does not reject, %; None where it takes the friction of the whole
    band: Interval | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return an entry of ``stability.tried`` of ``identify --json``."""
        band = None if self.band is None else list(self.band)
        return {"look": self.name, "gain": self.gain, "band": band, "agrees": self.agrees}


@dataclasses.dataclass(frozen=True)
class Stability:
    """What was tried beside the answer, and what of it agreed.

    A valve that is told to be healthy is agreed on by looks that see no friction; whatever else
    is told, by looks that see the friction that stands beside it.
    """

    tried: tuple[Look, ...]  # at least one

    @property
    def agreed(self) -> tuple[str, ...]:
        """Names of the looks that agree."""
        return tuple(look.name for look in self.tried if look.agrees)

    @property
    def share(self) -> float:
        """Share of the looks that agree, 0 to 1."""
        return len(self.agreed) / len(self.tried)

    def to_dict(self) -> dict[str, Any]:
        """Return ``valves[].stability`` of ``identify --json``."""
        return {"tried": [look.to_dict() for look in self.tried], "agreed": list(self.agreed)}


def halves(gains: Interval, unheard: float | None) -> tuple[Look, ...]:
    """Return the looks at both halves of the record.

    Args:
        gains: −2 log likelihood that the friction of the whole adds in either half.
        unheard: gain up to which a half speaks for a healthy valve; None where friction is told,
            which each half must see.
    """
    return tuple(
        Look(name, gain, gain > 0.0 if unheard is None else gain <= unheard)
        for name, gain in zip(("first half", "second half"), gains, strict=True)
    )
