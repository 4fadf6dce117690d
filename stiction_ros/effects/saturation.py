"""Ends that a signal cannot pass: of a valve's travel, and of a sensor's range."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros.effects.behaviour import Behaviour, FloatArray, Memory, parameter
from stiction_ros.errors import InputError


@dataclasses.dataclass(frozen=True)
class _Limits(Behaviour):
    """y = min(max(x, low), high), without memory.

    Raises:
        InputError: limits that are not finite, or low > high.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        low, high = self._limits()
        if low > high:
            raise InputError(
                f"{low:g} is larger than high = {high:g}", where="low", fix="lower it or raise high"
            )

    def _limits(self) -> tuple[float, float]:
        low, high = (getattr(self, entry.attribute) for entry in self.parameters())
        return low, high

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        low, high = self._limits()
        return memory, min(max(value, low), high)

    @classmethod
    def simulate_grid(
        cls,
        grid: FloatArray,
        values: FloatArray,
        start: FloatArray | float,
        sample_time: float = 1.0,
    ) -> FloatArray:
        """Return outputs, shape (N, G), for rows (low, high)."""
        return np.minimum(np.maximum(values[:, None], grid[:, 0]), grid[:, 1])


@dataclasses.dataclass(frozen=True)
class Saturation(_Limits):
    """A stem that stops at ``low`` and ``high``, inside of what OP asks.

    Raises:
        InputError: limits that are not finite, or low > high.
    """

    effect: ClassVar[str] = "saturation"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    signature: ClassVar[str] = "PV does not answer while OP is beyond one value"
    minimum_data: ClassVar[str] = "OP stays beyond a limit for longer than the process settles"
    confusable: ClassVar[tuple[str, ...]] = ("valve characteristic",)

    low: float = parameter("low", "%", "lowest position of the stem")
    high: float = parameter("high", "%", "highest position of the stem")


@dataclasses.dataclass(frozen=True)
class Clip(_Limits):
    """A sensor that shows nothing below ``low`` and above ``high``.

    Raises:
        InputError: limits that are not finite, or low > high.
    """

    effect: ClassVar[str] = "clip"
    places: ClassVar[tuple[str, ...]] = ("sensor",)
    signature: ClassVar[str] = "PV rests at exactly one value, without noise, again and again"
    minimum_data: ClassVar[str] = "PV passes a limit"
    confusable: ClassVar[tuple[str, ...]] = ("sensor freeze",)

    low: float = parameter("low", "signal", "lower end of the sensor's range")
    high: float = parameter("high", "signal", "upper end of the sensor's range")
