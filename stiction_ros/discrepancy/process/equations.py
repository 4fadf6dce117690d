"""ARX equations of a process: read from a model, and written into one."""

import dataclasses

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxProcess, Process


@dataclasses.dataclass(frozen=True)
class Equation:
    """Coefficients of one output: a (n_a,), and per valve b and delay."""

    a: FloatArray
    b: tuple[FloatArray, ...]
    delay: tuple[int, ...]

    @property
    def denominator(self) -> FloatArray:
        """A as a polynomial in powers of q⁻¹, shape (n_a + 1,)."""
        return np.concatenate([[1.0], self.a])


def equation_of(model: LoopModel, output: int) -> Equation:
    """Return the equation of an output by its index, a valve that does not act on it without b.

    Raises:
        InputError: a process that is no ARX process.
    """
    if not isinstance(model.process, ArxProcess):
        raise InputError("the process is no arx process", where=model.name)
    own = model.process.equations[output]
    return Equation(
        np.array(own.a),
        tuple(np.array(own.b.get(v, ())) for v in model.valve_names),
        tuple(own.delay.get(v, 0) for v in model.valve_names),
    )


def with_equation(model: LoopModel, output: int, own: Equation) -> LoopModel:
    """Return the model with other coefficients and delays of one output."""
    document = model.to_mapping()
    entry = document["process"]["outputs"][output]
    each = list(zip(model.valve_names, own.b, own.delay, strict=True))
    entry["a"] = own.a.tolist()
    entry["b"] = {v: b.tolist() for v, b, _ in each if len(b)}
    entry["delay"] = {v: d for v, b, d in each if len(b)}
    return LoopModel.from_mapping(document, model.name)


def process_with(process: Process, output: int, own: Equation, sample_time: float) -> Process:
    """Return an ARX process with another equation of one output, behind its effects if any.

    Raises:
        InputError: another kind of process.
    """
    if isinstance(process, AlteredProcess):
        inner = process_with(process.inner, output, own, sample_time)
        return AlteredProcess(inner, process.effects, sample_time)
    if not isinstance(process, ArxProcess):
        raise InputError("the process is no arx process")
    acting = [j for j, b in enumerate(own.b) if len(b)]
    b = {process.valves[j]: tuple(own.b[j].tolist()) for j in acting}
    delay = {process.valves[j]: own.delay[j] for j in acting}
    known = list(process.equations)
    known[output] = dataclasses.replace(known[output], a=tuple(own.a.tolist()), b=b, delay=delay)
    return ArxProcess(tuple(known), process.valves, process.model.stem0, process.model.pv0)
