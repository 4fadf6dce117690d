"""How an output answers a step of one stem, by the identified process."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.result import OutputModel
from stiction_ros.signals.arx import step_response

RISEN = 0.632  # share of the whole answer that a first-order process has given after one lag
# times by which an answer that does not settle grows from a quarter of the record to its half: 2
# for an integrator, 1.4 for a lag of a quarter of the record, 1.6 for one of a half
GROWS = 1.5


@dataclasses.dataclass(frozen=True)
class StepAnswer:
    """The answer to 1 % of stem."""

    output: str  # tag
    dead_time: float  # s, until PV begins to answer: the delay and the sample that shows it
    # s from then on until 63 % of the answer; None where it does not settle within half the record,
    # which cannot be told from an integrator
    lag: float | None
    values: FloatArray  # PV after each sample, engineering units per %, shape (H,)
    noise: float  # standard deviation of what one sample of PV brings that is new, same units
    sample_time: float  # s

    @classmethod
    def of(cls, model: OutputModel, valve: str, samples: int, sample_time: float) -> "StepAnswer":
        """Return the answer within half a record.

        Args:
            model: of the output.
            valve: tag.
            samples: of the record.
            sample_time: s.
        """
        count = max(samples // 2, model.delay[valve] + 3)
        values = step_response(model.a, model.b[valve], model.delay[valve], count)
        return cls.of_values(model.name, values, model.noise_std, sample_time)

    @classmethod
    def of_values(
        cls, output: str, values: FloatArray, noise: float, sample_time: float
    ) -> "StepAnswer":
        """Return the answer that has these values.

        Args:
            output: tag.
            values: PV after each sample, engineering units per %, shape (H,).
            noise: standard deviation of what one sample of PV brings that is new, same units.
            sample_time: s.
        """
        wait = int(np.argmax(values != 0.0))
        reached, before = (np.abs(part).max() for part in (values, values[: len(values) // 2 + 1]))
        lag = None
        if reached <= GROWS * before:
            risen = np.flatnonzero(np.abs(values[wait:]) >= RISEN * reached)
            lag = float(risen[0] * sample_time)
        return cls(output, wait * sample_time, lag, values, noise, sample_time)

    def after(self, seconds: float) -> float:
        """Return |PV| a time after the step, engineering units per %."""
        row = min(round(seconds / self.sample_time), len(self.values) - 1)
        return float(abs(self.values[row]))

    @property
    def clearness(self) -> float:
        """Largest answer over the noise, per %."""
        return float(np.abs(self.values).max()) / max(self.noise, 1e-300)
