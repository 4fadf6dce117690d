"""The noise that was found against the one that the model declares."""

import dataclasses
import math
from typing import Any

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.likelihood.seen_noise import seen_noise
from stiction_ros.texts import spoken

LARGER = 1.25  # times the declared standard deviation, beyond which they disagree
LAGS = 20
SOME_STEPS = 3.0  # of the rounding


@dataclasses.dataclass(frozen=True)
class OutputNoise:
    """The noise of one output, units of the output."""

    name: str  # tag
    # standard deviation of the innovations as the model has it; NaN where the model declares none
    declared: float
    # of those that the declared noise and what the sensor does to the values, such as rounding,
    # make together; NaN where none is declared
    expected: float
    found: float  # of those that the answer leaves, under the declared form
    disagrees: bool  # whether they are larger than declared, or depend on each other
    memory: int  # samples after which the strongest dependence comes; 0 where there is none

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``gap --json``; a missing declaration is null."""
        return {
            "declared": None if math.isnan(self.declared) else self.declared,
            "found": self.found,
            "disagrees": self.disagrees,
        }


def check_noise(base: Baseline) -> tuple[OutputNoise, ...]:
    """Return declared and found noise of every output under a model."""
    found = []
    runs = base.run.runs
    seen = seen_noise(base.run.model, runs.lattices, runs.unseen)
    for i, (name, declared) in enumerate(
        zip(base.run.model.outputs, declared_noise(base.run.model), strict=True)
    ):
        fit, quantum = base.noise[i], runs.quanta[i]
        if declared is None:
            found.append(OutputNoise(name, math.nan, math.nan, fit.innovation_std, False, 0))
            continue
        shown = max(seen[i], key=lambda form: form.std)
        expected = math.sqrt(shown.std**2 + (0.0 if len(shown.ar) else quantum**2 / 12.0))
        memory = _memory(base, i) if fit.enlarged else 0
        disagrees = fit.enlarged or fit.innovation_std > LARGER * expected
        found.append(
            OutputNoise(name, declared.std, expected, fit.innovation_std, disagrees, memory)
        )
    return tuple(found)


def spans_steps(base: Baseline, output: int) -> bool:
    """Tell whether what an answer leaves of an output spans some steps of its rounding.

    Rounding of a slow signal is no white noise: within a few steps no law of the noise is told,
    and none stands against an effect.
    """
    rows = base.blocks[output].train
    left = float(np.std(base.noise[output].residual[rows]))
    return left >= SOME_STEPS * base.run.runs.quanta[output]


def _memory(base: Baseline, output: int) -> int:
    """Return the lag at which what is left depends on itself most."""
    rows = base.blocks[output].scored
    values = np.where(rows, base.noise[output].residual, 0.0)
    values = values - values[rows].mean() * rows
    whole = float(values @ values)
    if whole <= 0.0:
        return 0
    shares = [float(values[lag:] @ values[:-lag]) / whole for lag in range(1, LAGS + 1)]
    return 1 + int(np.argmax(np.abs(shares)))


def noise_sentences(noises: tuple[OutputNoise, ...], sample_time: float) -> list[str]:
    """Return where and how far the noise is another than declared, for people."""
    said = []
    for each in noises:
        if not each.disagrees:
            continue
        size = f"{each.name}: innovations of {each.found:.3g} where the model declares "
        size += f"{each.declared:.3g}"
        if each.memory:
            size += f", and they depend on each other over {spoken(each.memory * sample_time)}"
        said.append(size)
    return said
