"""The figures by which friction in a valve is judged, each with a unit and a definition.

Nats are differences of log likelihood between two explanations of the same rows. An ideal valve
stands alone or beside a wave from outside, whichever explains more.
"""

from __future__ import annotations

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
        "by which friction beats an ideal valve beyond its price, at the weaker of two rates of "
        "sampling that agree on its size",
        "two rates of sampling do not both show it",
        1,
    )
    ruled_out: float = _figure(
        "nats",
        "by which an ideal valve beats the best friction that would matter, at the rate most "
        "against it",
        "one rate of sampling speaks against it",
        -1,
    )
    repeats: float = _figure(
        "ratio",
        "how strongly the rest that an ideal valve leaves of PV repeats itself a turn later, over "
        "what friction gains",
        "PV also repeats itself a turn later, as beside another loop that cycles",
        -1,
    )
    loop_gone: float = _figure(
        "share",
        "of the simulated loop's movement that goes away without the friction",
        "the simulated loop moves nearly as much without it",
        1,
    )
    moves: float = _figure(
        "count",
        "of samples at which the estimated stem moves",
        "the estimated stem moves too seldom, or in nearly every sample",
    )
    controller_fit: float = _figure(
        "R²", "of OP's moves by the recovered controller", "the controller is hardly known"
    )
    band_share: float = _figure(
        "ratio",
        "f_S + f_D over the range in which OP moves",
        "its band is hardly of a size that makes this loop move",
    )
    cycle_share: float = _figure(
        "share",
        "of the variance of PV − SP that is one cycle",
        "the cycle is not of the kind that friction makes",
    )

    def to_json(self) -> dict[str, float]:
        """Return the figures by name."""
        return dataclasses.asdict(self)


def definitions() -> Mapping[str, Mapping[str, Any]]:
    """Return ``unit``, ``definition``, ``against`` and ``sign`` of each figure by its name."""
    return {field.name: field.metadata for field in dataclasses.fields(Figures)}
