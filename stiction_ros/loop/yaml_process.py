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


@dataclasses.dataclass(frozen=True)
class _Output:
    """What a process of any kind says of one output."""

    name: str
    noise: processes.Noise = processes.Noise()
    effects: tuple[Behaviour, ...] = ()  # on the side of the process
    instrument: Instrument = Instrument()


def read_process(
    section: Section, point: Section, valves: tuple[str, ...], sample_time: float
) -> tuple[processes.Process, tuple[Instrument, ...]]:
    """Build the process; return it with the instrument of each output.

    The ``point`` is the loop's operating point, read for linear kinds.
    """
    kind = section.choice("kind", _KINDS)
    if kind == "transfer_function":
        section = _as_arx(section, valves, sample_time)
        section.choice("kind", _KINDS)
    if kind == "stirred_tank" and "outputs" not in section:
        entries, outputs = [], [_Output("C"), _Output("T")]
    else:
        entries = list(section.sections("outputs"))
        outputs = [_read_output(entry) for entry in entries]
    process: processes.Process
    if kind in ("arx", "transfer_function"):
        process = _read_arx(section, entries, outputs, point, valves)
    elif kind == "state_space":
        process = _read_state_space(section, outputs, point, valves)
    else:
        process = _read_tank(section, outputs, point, valves, sample_time)
    for each in (*entries, section):
        each.finish()
    effects = tuple(output.effects for output in outputs)
    if any(effects):
        process = processes.AlteredProcess(process, effects, sample_time)
    return process, tuple(output.instrument for output in outputs)


def _read_output(entry: Section) -> _Output:
    name, noise, effects = entry.text("name"), _read_noise(entry), read_effects(entry, "process")
    for i, effect in enumerate(effects):
        if effect.filter(1.0) is None:
            raise InputError(
                f"{effect.title()} cannot act on a process",
                where=f"{entry.at('effects')}[{i}]",
                fix="use gain, delay, pole or leak, or put it to a valve or a sensor",
            )
    low, high = entry.ends("range") if "range" in entry else (-math.inf, math.inf)
    rate = entry.number("rate_limit", above=0.0) if "rate_limit" in entry else math.inf
    return _Output(name, noise, effects, Instrument(low, high, rate))


def _read_arx(
    section: Section,
    entries: list[Section],
    outputs: list[_Output],
    point: Section,
    valves: tuple[str, ...],
) -> processes.Process:
    if "measured_disturbances" in section and section.raw("measured_disturbances"):
        raise InputError(
            "an arx process has no measured disturbances",
            where=section.at("measured_disturbances"),
            fix="use kind: state_space with a matrix e",
        )
    equations = []
    for entry, output in zip(entries, outputs, strict=True):
        b_section, delays = entry.section("b"), entry.section("delay", {})
        b = {v: tuple(b_section.numbers(v).tolist()) for v in valves if v in b_section}
        b_section.finish()
        if not b:
            raise InputError("names no valve", where=b_section.where)
        delay = {v: delays.integer(v, 0) for v in b}
        delays.finish()
        a, bias = tuple(entry.numbers("a").tolist()), entry.number("bias", 0.0)
        try:
            equations.append(processes.ArxOutput(output.name, a, b, delay, bias, output.noise))
        except InputError as error:
            raise error.within(entry.where) from None
    if not equations:
        raise InputError("has no output", where=section.at("outputs"))
    op0, pv0 = _read_point(point, valves, outputs)
    return processes.ArxProcess(tuple(equations), valves, op0, pv0)


def _read_state_space(
    section: Section, outputs: list[_Output], point: Section, valves: tuple[str, ...]
) -> processes.Process:
    measured = _read_measured(section)
    a, b, c = section.matrix("a"), section.matrix("b"), section.matrix("c")
    e = section.matrix("e") if "e" in section else np.zeros((len(a), 0))
    op0, pv0 = _read_point(point, valves, outputs)
    entry = section.section("delay", {})
    delays = [entry.integer(valve, 0) for valve in valves]
    entry.finish()
    try:
        model = processes.LinearModel(a, b, c, e, np.zeros(len(a)), op0, pv0)
        return processes.StateSpaceProcess(
            model.behind_delays(delays), valves, *_names_and_noise(outputs), measured
        )
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
    section: Section,
    outputs: list[_Output],
    point: Section,
    valves: tuple[str, ...],
    sample_time: float,
) -> processes.Process:
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
    parameters = processes.TankParameters(**values)
    try:
        return processes.StirredTank(
            valves, *_names_and_noise(outputs), parameters, sample_time, measured
        )
    except InputError as error:
        raise error.within(section.where) from None


def _names_and_noise(outputs: list[_Output]) -> tuple[tuple[str, ...], tuple[processes.Noise, ...]]:
    return tuple(output.name for output in outputs), tuple(output.noise for output in outputs)


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
    point: Section, valves: tuple[str, ...], outputs: list[_Output]
) -> tuple[FloatArray, FloatArray]:
    names = [output.name for output in outputs]
    stems, pvs = np.zeros(len(valves)), np.zeros(len(names))
    return point.named_numbers("op", valves, stems), point.named_numbers("pv", names, pvs)


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
