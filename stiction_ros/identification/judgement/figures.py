"""The figures by which friction in a valve is judged, each with a unit and a definition.

Nats are differences of log likelihood between two explanations of the same rows. An ideal valve
stands alone or beside a wave from outside, whichever explains more.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any


def _figure(unit: str, definition: str, against: str, sign: int = 0) -> Any:
    """Return a field; ``against`` completes "likely but not sure:", ``sign`` is of its effect."""
    told = {"unit": unit, "definition": definition, "against": against, "sign": sign}
    return dataclasses.field(metadata=told)


@dataclasses.dataclass(frozen=True)
class Figures:
    """What the probability of friction in one valve is computed from.

    Simulated loops are those of the recovered controller with the identified process.
    """

    gain: float = _figure(
        "nats",
        "log likelihood of friction minus that of an ideal valve, minus a price for f_S and f_D; "
        "the lesser at two rates of sampling that find the same size",
        "two rates of sampling do not both show it",
        1,
    )
    ruled_out: float = _figure(
        "nats",
        "log likelihood of an ideal valve minus that of the best friction large enough to matter, "
        "at the rate of sampling that speaks most against friction",
        "one rate of sampling speaks against it",
        -1,
    )
    repeats: float = _figure(
        "ratio",
        "how strongly the part of PV that an ideal valve does not explain returns one cycle "
        "later, divided by the gain of friction",
        "PV also repeats itself one cycle later, as beside another loop that cycles",
        -1,
    )
    loop_gone: float = _figure(
        "share",
        "part of the simulated loop's movement that goes away without the friction",
        "the simulated loop moves nearly as much without it",
        1,
    )
    moves: float = _figure(
        "count",
        "samples at which the estimated stem moves",
        "the estimated stem moves too seldom, or in nearly every sample",
    )
    controller_fit: float = _figure(
        "R²", "fit of the recovered controller to OP's moves", "the controller is hardly known"
    )
    band_share: float = _figure(
        "ratio",
        "f_S + f_D divided by the range in which OP moves",
        "its band is hardly of a size that makes this loop move",
    )
    cycle_share: float = _figure(
        "share",
        "part of the variance of PV − SP that belongs to one cycle",
        "the cycle is not of the kind that friction makes",
    )

    def to_dict(self) -> dict[str, float]:
        """Return the figures by name."""
        return dataclasses.asdict(self)


def definitions() -> Mapping[str, Mapping[str, Any]]:
    """Return ``unit``, ``definition``, ``against`` and ``sign`` of each figure by its name."""
    return {field.name: field.metadata for field in dataclasses.fields(Figures)}
