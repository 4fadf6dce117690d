"""A PI controller for each output of a loop of several valves."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.loop import Measurement, PiController


class PiControllers:
    """One PI controller per output, each with its own valve."""

    def __init__(self, controllers: Sequence[PiController]) -> None:
        self._controllers = tuple(controllers)

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        parts = [
            controller(
                dataclasses.replace(measurement, pv=measurement.pv[i : i + 1]), sp[i : i + 1]
            )
            for i, controller in enumerate(self._controllers)
        ]
        return np.concatenate(parts)
