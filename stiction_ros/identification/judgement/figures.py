"""The figures by which friction in a valve is judged, each with a unit and a definition.

Nats are differences of log likelihood between two explanations of the same rows. The rivals of
friction are the ideal valve, alone and beside a wave from outside, and a PV that does not answer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray

NATS = 2.0  # below this a difference of log likelihood is a matter of chance: two parameters
REST = 0.01  # of the recorded movement: a smaller one is rest
ENDLESS = 100.0  # of it: a larger one grows without end


def _nats(definition: str) -> Any:
    return dataclasses.field(metadata={"unit": "nats", "definition": definition})


def _share(definition: str) -> Any:
    return dataclasses.field(metadata={"unit": "share", "definition": definition})


def _ratio(definition: str) -> Any:
    return dataclasses.field(metadata={"unit": "ratio", "definition": definition})


@dataclasses.dataclass(frozen=True)
class Figures:
    """What the probability of friction in one valve is computed from."""

    gain: float = _nats("friction over its best rival, the weaker of two neighbouring rates")
    largest_gain: float = _nats("friction over its best rival, at the rate that shows most")
    robust_gain: float = _nats("the same where single shocks count little (Student's t)")
    ruled_out: float = _nats("loss of the best friction that would matter, at the surest rate")
    possible: float = _nats("gain of the best friction that would matter, at the rate most for it")
    repeats: float = _ratio("how an ideal valve's rest of PV repeats itself, over the gain")
    loop_with: float = _ratio("movement of OP over the recorded one, simulated with the friction")
    loop_without: float = _ratio("the same, simulated with an ideal valve")
    loop_gone: float = _share("movement of the loop that goes away with the friction, simulated")
    band_share: float = _ratio("f_S + f_D over the range in which OP moves")
    held: float = _share("1 where the controller would hold the process found, at both rates")
    wave: float = _nats("a wave from outside over none, with an ideal valve")

    def to_json(self) -> dict[str, float]:
        """Return the figures by name."""
        return dataclasses.asdict(self)

    def features(self) -> FloatArray:
        """Return what the log odds are linear in, one for each figure, shape (F,).

        Nats and ratios enter by their logarithm: ten times the evidence is not ten times as sure.
        """
        told = []
        for field in dataclasses.fields(self):
            value, unit = getattr(self, field.name), field.metadata["unit"]
            if unit == "nats":
                value = float(np.sign(value) * np.log1p(abs(value) / NATS))
            elif unit == "ratio":
                value = float(np.log(np.clip(value, REST, ENDLESS)))
            told.append(value)
        return np.array(told)


def definitions() -> Mapping[str, tuple[str, str]]:
    """Return unit and definition of each figure by its name."""
    return MappingProxyType(
        {
            field.name: (field.metadata["unit"], field.metadata["definition"])
            for field in dataclasses.fields(Figures)
        }
    )
