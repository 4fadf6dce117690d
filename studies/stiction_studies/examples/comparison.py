"""What was identified beside what is true."""

import dataclasses
from typing import Any

import numpy as np

from stiction_ros.identification import Identification, OutputModel, ValveEstimate
from stiction_ros.processes import ArxOutput, ArxProcess, LinearModel
from stiction_studies.examples.example import Example
from stiction_studies.examples.one_step import square_error

RESPONSE_SAMPLES = 300


@dataclasses.dataclass(frozen=True)
class Against:
    """One figure: the truth, what was found, and the interval found, None where there is none."""

    true: float
    found: float
    interval: tuple[float, float] | None = None

    @property
    def error(self) -> float:
        """Found less true."""
        return self.found - self.true

    @property
    def inside(self) -> bool | None:
        """Whether the truth lies in the interval."""
        if self.interval is None:
            return None
        low, high = self.interval
        return low - 1e-9 <= self.true <= high + 1e-9

    def to_dict(self) -> dict[str, Any]:
        """Return true, found and error, and where there is an interval also that."""
        values: dict[str, Any] = {"true": self.true, "found": self.found, "error": self.error}
        if self.interval is not None:
            values |= {"interval": list(self.interval), "inside": self.inside}
        return values


@dataclasses.dataclass(frozen=True)
class ValveComparison:
    """One valve.

    Attributes:
        name, verdict: as identified.
        static_friction, dynamic_friction: f_S and f_D, %.
        stem_error: (χ − χ̂)ᵀ(χ − χ̂) over the record, %².
    """

    name: str
    verdict: str
    static_friction: Against
    dynamic_friction: Against
    stem_error: float

    def to_dict(self) -> dict[str, Any]:
        """Return JSON data."""
        return {
            "name": self.name,
            "verdict": self.verdict,
            "f_s": self.static_friction.to_dict(),
            "f_d": self.dynamic_friction.to_dict(),
            "stem_error": self.stem_error,
        }


@dataclasses.dataclass(frozen=True)
class ChannelComparison:
    """The process from one valve to one output.

    Attributes:
        output, valve: tags.
        delay: t_d, samples.
        gain: at steady state, engineering units per %; inf where a model integrates.
        response_error: largest difference of the two unit step responses over
            RESPONSE_SAMPLES samples, as a share of the output's largest true gain.
    """

    output: str
    valve: str
    delay: Against
    gain: Against
    response_error: float

    def to_dict(self) -> dict[str, Any]:
        """Return JSON data."""
        return {
            "output": self.output,
            "valve": self.valve,
            "delay": self.delay.to_dict(),
            "gain": self.gain.to_dict(),
            "response_error": self.response_error,
        }


@dataclasses.dataclass(frozen=True)
class Comparison:
    """An identification beside the truth of its example.

    Attributes:
        valves, channels: in the order of the record, channels output by output.
        stem_error: (1/m) Σ (χ − χ̂)ᵀ(χ − χ̂), %², the paper's Remark 2.
        square_error: SE, (12a) and (14), with the identified stems, delays and orders.
        true_stem_square_error: the same with the true stems and delays. Where it is the larger,
            a smaller SE did not mean a better stem.
    """

    valves: tuple[ValveComparison, ...]
    channels: tuple[ChannelComparison, ...]
    stem_error: float
    square_error: float
    true_stem_square_error: float

    def to_dict(self) -> dict[str, Any]:
        """Return JSON data."""
        return {
            "valves": [valve.to_dict() for valve in self.valves],
            "channels": [channel.to_dict() for channel in self.channels],
            "stem_error": self.stem_error,
            "square_error": self.square_error,
            "true_stem_square_error": self.true_stem_square_error,
        }


def compare(example: Example, found: Identification) -> Comparison:
    """Return what ``found`` says beside the truth of ``example``."""
    record = example.record
    assert record.stem is not None
    errors = np.sum((record.stem - found.stem) ** 2, axis=0)
    valves = tuple(
        _compare_valve(example, valve, float(errors[j])) for j, valve in enumerate(found.valves)
    )
    known = tuple(_with_true_delays(example, output) for output in found.outputs)
    return Comparison(
        valves,
        _compare_channels(example, found),
        float(errors.mean()),
        square_error(record, found.stem, found.outputs),
        square_error(record, record.stem, known),
    )


def identified_process(found: Identification) -> LinearModel:
    """Return the identified outputs (9) as one linear model about zero."""
    valves = tuple(valve.name for valve in found.valves)
    equations = tuple(ArxOutput(o.name, o.a, o.b, o.delay, o.bias) for o in found.outputs)
    zero = np.zeros(len(valves)), np.zeros(len(equations))
    return ArxProcess(equations, valves, *zero).model


def _compare_valve(example: Example, valve: ValveEstimate, stem_error: float) -> ValveComparison:
    static, dynamic = example.friction(valve.name)
    return ValveComparison(
        valve.name,
        valve.verdict.value,
        Against(static, valve.static_friction, valve.static_interval),
        Against(dynamic, valve.dynamic_friction, valve.dynamic_interval),
        stem_error,
    )


def _compare_channels(example: Example, found: Identification) -> tuple[ChannelComparison, ...]:
    truth = example.truth.process.linear(example.truth.sample_time)
    model = identified_process(found)
    apart = model.step_responses(RESPONSE_SAMPLES) - truth.step_responses(RESPONSE_SAMPLES)
    gain, true_gain = model.gain, truth.gain
    return tuple(
        ChannelComparison(
            output.name,
            valve.name,
            Against(example.delay(output.name, valve.name), output.delay[valve.name]),
            Against(float(true_gain[i, j]), float(gain[i, j])),
            float(np.abs(apart[:, i, j]).max() / np.abs(true_gain[i]).max()),
        )
        for i, output in enumerate(found.outputs)
        for j, valve in enumerate(found.valves)
    )


def _with_true_delays(example: Example, output: OutputModel) -> OutputModel:
    delays = {valve: example.delay(output.name, valve) for valve in output.delay}
    return dataclasses.replace(output, delay=delays)
