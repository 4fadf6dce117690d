"""LoopModel: all that is known of one loop, as YAML holds it."""

import copy
import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiction_ros.effects import Behaviour, FloatArray
from stiction_ros.effects import from_mapping as effect_from_mapping
from stiction_ros.errors import InputError, foreign
from stiction_ros.loop.places import append_effect, at_place, read_effects
from stiction_ros.loop.yaml_process import Instrument, read_process
from stiction_ros.loop.yaml_reading import Section, load_yaml, parse_yaml
from stiction_ros.processes import Process


@dataclasses.dataclass(frozen=True)
class Valve:
    """A control valve: its limits in % (or None) and its effects in signal order."""

    name: str
    limits: tuple[float, float] | None
    effects: tuple[Behaviour, ...]


@dataclasses.dataclass(frozen=True)
class Disturbance:
    """An unmeasured effect that adds to an output, a further input, or the stem of a valve."""

    place: str  # tag of the output, the input or the valve
    behaviour: Behaviour  # what is added
    load: bool = False  # whether it enters the process beside the stem of a valve


@dataclasses.dataclass(frozen=True)
class PiTuning:
    """A recorded PI tuning: signed gain in % per unit of PV, integral time in seconds."""

    gain: float
    integral_time: float


@dataclasses.dataclass(frozen=True)
class LoopModel:
    """One loop: valves, process, sensors, disturbances and where it operates.

    Identification makes it, the controller is built from it, the plant simulates it, the
    discrepancy workflow extends it. The object is never changed; ``with_…`` returns another.

    Attributes:
        name: the loop's tag.
        sample_time: seconds.
        valves, process: m valves and the process with p outputs behind them.
        sensors: effects of each sensor, in the order of the outputs.
        disturbances: unmeasured effects.
        op0, pv0: operating point, shapes (m,) in % and (p,) in engineering units.
        stem_start, pv_start: where a simulation starts, same shapes.
        controller: the recorded PI tuning, or None.
        provenance: who added which effect, when, with what evidence.
        instruments: what the instrument of each output can show, in the order of the outputs.
        document: the validated YAML mapping, which :meth:`to_yaml` writes.

    Examples:
        >>> from stiction_ros import LoopModel, find_config
        >>> model = LoopModel.load(find_config("flow.loop.yaml"))
        >>> model.valve_names, model.outputs, model.sample_time
        (('V1',), ('PV1',), 1.0)
        >>> model.with_ideal_valves().valves[0].effects
        ()
    """

    name: str
    sample_time: float
    valves: tuple[Valve, ...]
    process: Process
    sensors: tuple[tuple[Behaviour, ...], ...]
    disturbances: tuple[Disturbance, ...]
    op0: FloatArray
    pv0: FloatArray
    stem_start: FloatArray
    pv_start: FloatArray
    controller: PiTuning | None
    provenance: tuple[Mapping[str, Any], ...]
    instruments: tuple[Instrument, ...]
    document: Mapping[str, Any]

    def __repr__(self) -> str:
        process = f"{self.process.kind} from {', '.join(self.valve_names)}"
        return (
            f"<LoopModel {self.name}: {process} to {', '.join(self.outputs)}, "
            f"samples of {self.sample_time:g} s>"
        )

    @classmethod
    def load(cls, path: Path | str) -> "LoopModel":
        """Read a ``*.loop.yaml`` file; anything wrong in it raises InputError.

        Args:
            path: the file.
        """
        return cls.from_mapping(load_yaml(path), str(path))

    @classmethod
    def from_yaml(cls, text: str, where: str = "loop model") -> "LoopModel":
        """Read YAML text, as the topic ``loop_model`` carries it.

        Args:
            text: the YAML text.
            where: named in messages.
        """
        return cls.from_mapping(parse_yaml(text, where), where)

    @classmethod
    def from_mapping(cls, document: Any, where: str = "loop model") -> "LoopModel":
        """Check a YAML mapping and build the loop from it.

        Args:
            document: the mapping.
            where: named in messages.

        Raises:
            InputError: naming ``where``, the key, and the mend.
        """
        top = Section(document, where)
        name = top.text("loop")
        sample_time = top.number("sample_time", above=0.0)
        valves = tuple(_read_valve(entry) for entry in top.sections("valves"))
        tags = tuple(valve.name for valve in valves)
        if not tags or len(set(tags)) != len(tags):
            raise InputError("needs at least one valve, each with a name of its own", where=where)
        section = top.section("process")
        point = top.section("operating_point", {})
        process, instruments = read_process(section, point, tags, sample_time)
        if len(set(process.outputs)) != len(process.outputs):
            raise InputError(
                "two outputs have one name", where=section.at("outputs"), fix="rename one"
            )
        op0 = process.linear(sample_time).stem0
        pv0 = process.linear(sample_time).pv0
        point.finish()
        sensors = _read_sensors(top, process.outputs)
        disturbances = tuple(
            _read_disturbance(s, process) for s in top.sections("disturbances", [])
        )
        initial = top.section("initial", {})
        stem_start = initial.named_numbers("stem", tags, op0)
        pv_start = initial.named_numbers("pv", process.outputs, pv0)
        initial.finish()
        controller = None
        if "controller" in top:
            controller = _read_pi(top.section("controller"))
        provenance = tuple(dict(entry.values) for entry in top.sections("provenance", []))
        top.integer("valid_from", 0)
        top.finish()
        return cls(
            name,
            sample_time,
            valves,
            process,
            sensors,
            disturbances,
            op0,
            pv0,
            stem_start,
            pv_start,
            controller,
            provenance,
            instruments,
            copy.deepcopy(dict(document)),
        )

    @classmethod
    def from_system(
        cls,
        system: Any,
        sample_time: float,
        dead_time: float = 0.0,
        name: str = "loop",
        **sections: Any,
    ) -> "LoopModel":
        """Return the loop of a linear process behind ideal valves V1, V2, … of 0 to 100 %.

        Args:
            system: from stems, %, to PV: a state space or the transfer function of one valve of
                scipy.signal or python-control, ``(num, den)`` with the highest power of s first,
                or ``(A, B, C, D)``; time in s. One that is not discrete by its ``dt`` is sampled
                with its stems held between samples.
            sample_time: s.
            dead_time: of all inputs, s; of a state space whole samples.
            name: tag of the loop.
            sections: of the YAML mapping, such as ``controller`` or ``operating_point``, which
                else is 50 % and a PV of 0.

        Raises:
            InputError: no linear system, one that answers at once, or no sample time.

        Examples:
            >>> from stiction_ros import HeStiction, LoopModel, simulate
            >>> tuning = {"kind": "pi", "gain": 1.0, "integral_time": 8.0}
            >>> loop = LoopModel.from_system(([0.8], [8.0, 1.0]), 1.0, controller=tuning)
            >>> sticky = loop.with_valve_effects({"V1": [HeStiction(4.0, 1.5)]})
            >>> len(simulate(sticky, samples=300))
            300
        """
        from stiction_ros.loop.yaml_process import process_of

        with foreign("system"):
            process = process_of(system, sample_time, dead_time)
        valves = list(process.get("delay", ("V1",)))
        document = {
            "loop": name,
            "sample_time": sample_time,
            "valves": [{"name": tag, "limits": [0.0, 100.0], "effects": []} for tag in valves],
            "process": process,
            "operating_point": {"op": dict.fromkeys(valves, 50.0)},
        }
        return cls.from_mapping(document | sections, name)

    @property
    def valve_names(self) -> tuple[str, ...]:
        """Tags of the m valves."""
        return tuple(valve.name for valve in self.valves)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Tags of the p outputs."""
        return self.process.outputs

    @property
    def limits(self) -> FloatArray:
        """Lower and upper limits of the valves, shape (m, 2), ±inf where there are none."""
        return np.array([valve.limits or (-np.inf, np.inf) for valve in self.valves])

    def to_mapping(self) -> dict[str, Any]:
        """Return a copy of the YAML mapping."""
        return copy.deepcopy(dict(self.document))

    def to_yaml(self, *, valid_from: int | None = None) -> str:
        """Return YAML text; ``valid_from`` in ns is set when given."""
        document = self.to_mapping()
        if valid_from is not None:
            document["valid_from"] = valid_from
        return yaml.safe_dump(document, sort_keys=False, allow_unicode=True)

    def save(self, path: Path | str) -> None:
        """Write the YAML file.

        Args:
            path: the file, ``*.loop.yaml`` by custom.
        """
        Path(path).write_text(self.to_yaml(), encoding="utf-8")

    def with_valve_effects(
        self, effects: Mapping[str, Sequence[Behaviour]], **provenance: Any
    ) -> "LoopModel":
        """Return the loop with the effects of the named valves replaced.

        Args:
            effects: valve to its new effects in signal order; none for a valve that follows OP.
            provenance: if any, one entry of the provenance.

        Raises:
            InputError: no such valve.
        """
        document = self.to_mapping()
        for name in effects:
            if name not in self.valve_names:
                raise InputError(
                    f"no valve {name!r}", where=self.name, fix=f"use {', '.join(self.valve_names)}"
                )
        for valve in document["valves"]:
            if valve["name"] in effects:
                valve["effects"] = [e.to_mapping() for e in effects[valve["name"]]]
        if provenance:
            document.setdefault("provenance", []).append(dict(provenance))
        return LoopModel.from_mapping(document, self.name)

    def with_effect(self, place: str, effect: Behaviour, **provenance: Any) -> "LoopModel":
        """Return the loop with one more effect, the last in signal order at its place.

        Args:
            place: ``valve:TAG``, ``load:TAG``, ``process:TAG``, ``sensor:TAG``, or
                ``disturbance:TAG`` with the tag of an output or of a further input.
            effect: what acts there.
            provenance: if any, one entry of the provenance.

        Raises:
            InputError: no such place, or an effect that cannot act on a process.
        """
        document = self.to_mapping()
        append_effect(document, place, effect, self.process)
        if provenance:
            document.setdefault("provenance", []).append(dict(provenance))
        return LoopModel.from_mapping(document, self.name)

    def with_ideal_valves(self) -> "LoopModel":
        """Return the loop with valves that follow OP exactly."""
        return self.with_valve_effects(dict.fromkeys(self.valve_names, ()))


def _read_valve(section: Section) -> Valve:
    name = section.text("name")
    limits = section.ends("limits") if "limits" in section else None
    effects = read_effects(section, "valve")
    section.finish()
    return Valve(name, limits, effects)


def _read_sensors(top: Section, outputs: tuple[str, ...]) -> tuple[tuple[Behaviour, ...], ...]:
    found: dict[str, tuple[Behaviour, ...]] = {}
    for section in top.sections("sensors", []):
        name = section.choice("name", outputs)
        if name in found:
            raise InputError(
                f"{name} is there twice",
                where=section.at("name"),
                fix="put all its effects into one list",
            )
        found[name] = read_effects(section, "sensor")
        section.finish()
    return tuple(found.get(name, ()) for name in outputs)


def _read_disturbance(section: Section, process: Process) -> Disturbance:
    values = dict(section.values)
    known = {"output": process.outputs, "input": process.upsets, "load": process.valves}
    keys = [key for key in known if key in values]
    if len(keys) != 1:
        raise InputError(
            "a disturbance acts on one output or one input, or is the load of one valve",
            where=section.where,
            fix=f"add output: {' | '.join(process.outputs)}",
        )
    (key,) = keys
    section.choice(key, known[key])
    place = values.pop(key)
    try:
        effect = at_place(effect_from_mapping(values), "load" if key == "load" else "disturbance")
        return Disturbance(place, effect, load=key == "load")
    except InputError as error:
        raise error.within(section.where) from None


def _read_pi(section: Section) -> PiTuning:
    section.choice("kind", ("pi",))
    tuning = PiTuning(section.number("gain"), section.number("integral_time", above=0.0))
    section.finish()
    return tuning
