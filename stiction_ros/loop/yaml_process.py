"""The ``process`` section of a loop model, and what its instruments can show."""

import dataclasses
import math
from typing import Any

import numpy as np

from stiction_ros import processes
from stiction_ros.checks import number
from stiction_ros.effects import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop.places import read_effects
from stiction_ros.loop.yaml_reading import Section
from stiction_ros.processes.sampled import WHOLE, equation, held, transition

_KINDS = ("arx", "state_space", "transfer_function", "stirred_tank")
WANTED = "give a system of scipy.signal or control, (num, den), or (A, B, C, D)"


@dataclasses.dataclass(frozen=True)
class Instrument:
    """Limits of one measured output; infinite where nothing is known."""

    low: float = -math.inf  # low, high: range, engineering units
    high: float = math.inf
    rate_limit: float = math.inf  # fastest credible change of the measurement, units per second


def read_process(
    section: Section, point: Section, valves: tuple[str, ...], sample_time: float
) -> processes.Process:
    """Build the process; ``point`` is the loop's operating point, read for linear kinds."""
    kind = section.choice("kind", _KINDS)
    if kind == "transfer_function":
        section = _as_arx(section, valves, sample_time)
        section.choice("kind", _KINDS)
    if kind in ("arx", "transfer_function"):
        process = _read_arx(section, point, valves)
    elif kind == "state_space":
        process = _read_state_space(section, point, valves)
    else:
        process = _read_tank(section, point, valves, sample_time)
    section.finish()
    effects = tuple(_read_filters(entry) for entry in section.sections("outputs", []))
    return processes.AlteredProcess(process, effects, sample_time) if any(effects) else process


def _read_arx(section: Section, point: Section, valves: tuple[str, ...]) -> processes.Process:
    if "measured_disturbances" in section and section.raw("measured_disturbances"):
        raise InputError(
            "an arx process has no measured disturbances",
            where=section.at("measured_disturbances"),
            fix="use kind: state_space with a matrix e",
        )
    equations = []
    for entry in section.sections("outputs"):
        name = entry.text("name")
        b_section, delays = entry.section("b"), entry.section("delay", {})
        b = {v: tuple(b_section.numbers(v).tolist()) for v in valves if v in b_section}
        b_section.finish()
        if not b:
            raise InputError("names no valve", where=b_section.where)
        delay = {v: delays.integer(v, 0) for v in b}
        delays.finish()
        _read_elsewhere(entry)
        try:
            equation = processes.ArxOutput(
                name,
                tuple(entry.numbers("a").tolist()),
                b,
                delay,
                entry.number("bias", 0.0),
                _read_noise(entry),
            )
        except InputError as error:
            raise error.within(entry.where) from None
        entry.finish()
        equations.append(equation)
    if not equations:
        raise InputError("has no output", where=section.at("outputs"))
    names = tuple(equation.name for equation in equations)
    op0, pv0 = _read_point(point, valves, names)
    return processes.ArxProcess(tuple(equations), valves, op0, pv0)


def _read_state_space(
    section: Section, point: Section, valves: tuple[str, ...]
) -> processes.Process:
    names, noise = _read_outputs(section, None)
    measured = _read_measured(section)
    a, b, c = section.matrix("a"), section.matrix("b"), section.matrix("c")
    e = section.matrix("e") if "e" in section else np.zeros((len(a), 0))
    op0, pv0 = _read_point(point, valves, names)
    entry = section.section("delay", {})
    delays = [entry.integer(valve, 0) for valve in valves]
    entry.finish()
    try:
        model = processes.LinearModel(a, b, c, e, np.zeros(len(a)), op0, pv0)
        late = model.behind_delays(delays)
        return processes.StateSpaceProcess(late, valves, names, noise, measured)
    except InputError as error:
        raise error.within(section.where) from None


def _as_arx(section: Section, valves: tuple[str, ...], sample_time: float) -> Section:
    """Return the section of continuous transfer functions as one of ARX equations."""
    outputs = []
    for entry in section.sections("outputs"):
        num, den, late = entry.section("num"), entry.section("den"), entry.section("dead_time", {})
        channels = {}
        for valve in valves:
            if valve not in num:
                continue
            dead_time = late.number(valve, 0.0, low=0.0)
            try:
                channels[valve] = held(
                    num.numbers(valve), den.numbers(valve), dead_time, sample_time
                )
            except InputError as error:
                raise error.within(f"{entry.where}.{valve}") from None
        for each in (num, den, late):
            each.finish()
        kept = {k: v for k, v in entry.values.items() if k not in ("num", "den", "dead_time")}
        outputs.append(kept | equation(channels))
    return Section({**section.values, "outputs": outputs}, section.where)


def _read_tank(
    section: Section, point: Section, valves: tuple[str, ...], sample_time: float
) -> processes.Process:
    names, noise = _read_outputs(section, ("C", "T"))
    measured = _read_measured(section)
    values = {}
    for field in dataclasses.fields(processes.TankParameters):
        if field.name in section:
            values[field.name] = section.number(field.name, above=0.0)
    if point.values:
        raise InputError(
            "a stirred tank works in absolute units about (50, 50) %",
            where=point.where,
            fix="leave operating_point out and give initial instead",
        )
    try:
        return processes.StirredTank(
            valves, names, noise, processes.TankParameters(**values), sample_time, measured
        )
    except InputError as error:
        raise error.within(section.where) from None


def _read_outputs(
    section: Section, default: tuple[str, ...] | None
) -> tuple[tuple[str, ...], tuple[processes.Noise, ...]]:
    if default is not None and "outputs" not in section:
        return default, tuple(processes.Noise() for _ in default)
    names, noise = [], []
    for entry in section.sections("outputs"):
        names.append(entry.text("name"))
        noise.append(_read_noise(entry))
        _read_elsewhere(entry)
        entry.finish()
    return tuple(names), tuple(noise)


def _read_elsewhere(entry: Section) -> None:
    """Pass over what :func:`read_process` and :func:`read_instruments` read of an output."""
    for key in ("effects", "range", "rate_limit"):
        entry.raw(key, None)


def read_instruments(section: Section, outputs: tuple[str, ...]) -> tuple[Instrument, ...]:
    """Return the limits of the instrument of each output; ``section`` is the process."""
    found = {
        entry.text("name"): _read_instrument(entry) for entry in section.sections("outputs", [])
    }
    return tuple(found.get(name, Instrument()) for name in outputs)


def _read_instrument(entry: Section) -> Instrument:
    low, high = entry.ends("range") if "range" in entry else (-math.inf, math.inf)
    rate = entry.number("rate_limit", above=0.0) if "rate_limit" in entry else math.inf
    return Instrument(low, high, rate)


def _read_filters(entry: Section) -> tuple[Behaviour, ...]:
    """Return the effects on the process side of one output, which must be linear."""
    effects = read_effects(entry, "process")
    for i, effect in enumerate(effects):
        if effect.filter(1.0) is None:
            raise InputError(
                f"{effect.title()} cannot act on a process",
                where=f"{entry.at('effects')}[{i}]",
                fix="use gain, delay, pole or leak, or put it to a valve or a sensor",
            )
    return effects


def _read_measured(section: Section) -> tuple[str, ...]:
    names = section.raw("measured_disturbances", ()) or ()
    if not isinstance(names, list | tuple) or not all(isinstance(n, str) and n for n in names):
        raise InputError(
            f"{names!r} is no list of names",
            where=section.at("measured_disturbances"),
            fix="write [F_B]",
        )
    if len(set(names)) != len(names):
        raise InputError(
            "two inputs have one name", where=section.at("measured_disturbances"), fix="rename one"
        )
    return tuple(names)


def _read_noise(entry: Section) -> processes.Noise:
    if "noise" not in entry:
        return processes.Noise()
    section = entry.section("noise")
    std = section.number("std", low=0.0)
    enters = section.choice("enters", tuple(processes.NoiseEntry), processes.NoiseEntry.MEASUREMENT)
    section.finish()
    return processes.Noise(std, processes.NoiseEntry(enters))


def _read_point(
    point: Section, valves: tuple[str, ...], outputs: tuple[str, ...]
) -> tuple[FloatArray, FloatArray]:
    stems, pvs = (np.zeros(len(names)) for names in (valves, outputs))
    return point.named_numbers("op", valves, stems), point.named_numbers("pv", outputs, pvs)


def process_of(system: Any, sample_time: float, dead_time: float) -> dict[str, Any]:
    """Return the section ``process`` of ``LoopModel.from_system``."""
    step = number(sample_time, "sample_time", above=0.0)
    late = number(dead_time, "dead_time", low=0.0)
    dt, given = getattr(system, "dt", None) or None, system
    if hasattr(system, "A"):
        given = (system.A, system.B, system.C, system.D)
    elif hasattr(system, "num"):
        given = (system.num, system.den)
    if not isinstance(given, tuple) or len(given) not in (2, 4):
        raise InputError(f"{type(system).__name__} is no linear system", where="system", fix=WANTED)
    if dt not in (None, True, step):
        raise InputError(f"the system has {dt:g} s, not {step:g} s", where="sample_time")
    arrays = [np.asarray(part, dtype=float) for part in given]
    if len(arrays) == 2:
        parts = [np.atleast_1d(np.squeeze(array)) for array in arrays]
        if dt or any(part.ndim > 1 for part in parts):
            said = "a discrete transfer function" if dt else "several transfer functions"
            fix = (
                f"give a state space, or write kind: {'arx' if dt else 'transfer_function'} in YAML"
            )
            raise InputError(f"{said} cannot be taken", where="system", fix=fix)
        ratio = {"num": parts[0].tolist(), "den": parts[1].tolist(), "dead_time": late}
        entry = {"name": "PV1"} | {key: {"V1": value} for key, value in ratio.items()}
        return {"kind": "transfer_function", "outputs": [entry]}
    a, b, c, d = map(np.atleast_2d, arrays)
    delay = round(late / step)
    if d.any():
        raise InputError("PV answers at once: D is not 0", where="system", fix="add a lag")
    if abs(delay - late / step) > WHOLE:
        said = f"{late:g} s are no whole number of samples of {step:g} s"
        raise InputError(said, where="dead_time", fix="give a transfer function")
    a, b = (a, b) if dt else transition(a, b, step)
    return {
        "kind": "state_space",
        "delay": {f"V{j + 1}": delay for j in range(b.shape[1])},
        "outputs": [{"name": f"PV{i + 1}"} for i in range(len(c))],
        **{key: part.tolist() for key, part in (("a", a), ("b", b), ("c", c))},
    }
