"""Slew: an actuator whose speed is limited."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import (
    NO_SAMPLE,
    Behaviour,
    FloatArray,
    Memory,
    elapsed,
    parameter,
)


@dataclasses.dataclass(frozen=True)
class Slew(Behaviour):
    r"""The stem moves by no more than its rate allows.

    .. math::
        \chi_k = \chi_{k-1} + \min(\max(u_k - \chi_{k-1}, -r T_s), r T_s)

    The memory is (χ, time of the last sample). At the first sample no time has passed, so
    the stem is where it rested.

    Raises:
        InputError: a negative or non-finite rate.
    """

    effect: ClassVar[str] = "slew"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    signature: ClassVar[str] = "the stem ramps at one speed after large moves of OP, however large"
    minimum_data: ClassVar[str] = "moves of OP of many times rate times sample time"
    confusable: ClassVar[tuple[str, ...]] = ("valve lag", "process pole", "sensor lag")

    rate: float = parameter("rate", "%/s", "largest speed of the stem", low=0.0)

    def rest(self, value: float) -> Memory:
        return (value, NO_SAMPLE)

    def step(self, memory: Memory, value: float, time: float) -> tuple[Memory, float]:
        """Return the memory (χ, time) and the stem position χ."""
        assert isinstance(memory, tuple)
        stem, before = memory
        reach = self.rate * elapsed(before, time)
        stem = min(max(value, stem - reach), stem + reach)
        return (stem, time), stem

    @classmethod
    def simulate_grid(
        cls,
        grid: FloatArray,
        values: FloatArray,
        start: FloatArray | float,
        sample_time: float = 1.0,
    ) -> FloatArray:
        """Return stem positions, shape (N, G), for rows (rate,)."""
        reach = grid[:, 0] * sample_time
        stem = np.broadcast_to(np.asarray(start, dtype=float), reach.shape)
        out = np.empty((len(values), len(reach)))
        out[:1] = stem
        for k, value in enumerate(values[1:].tolist(), start=1):
            stem = np.minimum(np.maximum(value, stem - reach), stem + reach)
            out[k] = stem
        return out
