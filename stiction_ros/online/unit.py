"""Several live loops on one plant without ROS, each with controller and estimator of its own.

Neighbours whose processes are coupled, or a cascade: the OP of an outer loop is the set-point of
an inner one. The nodes do the same through topics, each loop in a namespace; with the same
settings and seed both give the same numbers.
"""

import copy
import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import ClosedLoopRun, LoopModel, Measurement
from stiction_ros.loop.member_loops import MemberLoop, Wiring, read_member_loops
from stiction_ros.loop.yaml_reading import Section, load_yaml
from stiction_ros.online.session import (
    NODE_SETTINGS,
    LiveRun,
    LoopSession,
    Scenario,
    SimulatedPlant,
    node_values,
    read_plant,
)
from stiction_ros.records import Record
from stiction_ros.settings import from_mapping as settings_from_mapping

SHARED = ("plant", "recorder")  # nodes that all loops of a plant share
OWN = ("controller", "estimator")  # nodes of each loop


@dataclasses.dataclass(frozen=True)
class UnitScenario:
    """One scenario file of several loops on one plant.

    Examples:
        >>> from stiction_ros import find_config
        >>> from stiction_ros.online.unit import UnitScenario
        >>> UnitScenario.load(find_config("neighbours.scenario.yaml")).loops[0]
        MemberLoop(name='TC1', valves=('FV1',), outputs=('T1',))
    """

    name: str  # stem of the file
    path: Path  # the file
    # parameters by node: ``plant``, ``recorder``, ``TC1/controller`` …
    nodes: Mapping[str, Mapping[str, Any]]
    simulated: SimulatedPlant  # what the plant is told
    loops: tuple[MemberLoop, ...]  # tags of each loop
    # the scenario of each loop by itself, in the same order; its plant is the process that its
    # controller knows
    members: Mapping[str, Scenario]

    @classmethod
    def load(cls, path: Path | str) -> "UnitScenario":
        """Read a ROS parameter file whose plant has ``loops``.

        What stands under ``/**/controller`` is for the controllers of all loops, what stands under
        ``TC1: {controller: …}`` for that of one.

        Raises:
            InputError: anything missing or wrong, in one line.

        Args:
            path: the scenario.
        """
        path = Path(path)
        top = Section(load_yaml(path), str(path))
        told = {name: _parameters(top, name) for name in SHARED}
        for node, given in told.items():
            settings_from_mapping(NODE_SETTINGS[node], given, f"{path}: {node}")
        simulated = read_plant(told["plant"], path)
        plant = simulated.plant
        where = f"{path}: plant: loops"
        loops = read_member_loops(told["plant"].get("loops", ()), plant, where)
        if not loops:
            raise InputError("names no loop", where=where, fix="write NAME: VALVE -> OUTPUT")
        common = {node: _parameters(top, f"/**/{node}") for node in OWN}
        wiring, members = Wiring(plant, loops), {}
        for loop in loops:
            own = top.section(loop.name, {})
            nodes = {n: copy.deepcopy(common[n]) | _parameters(own, n) for n in OWN}
            own.finish()
            told |= {f"{loop.name}/{node}": nodes[node] for node in OWN}
            known = LoopModel.load(path.parent / str(nodes["controller"].get("model", "")))
            if (known.valve_names, known.outputs) != (loop.valves, loop.outputs):
                raise InputError(
                    f"has other tags than {loop.name} among the loops of the plant",
                    where=f"{path}: {loop.name}: controller: {known.name}",
                    fix=f"use {', '.join(loop.valves)} and {', '.join(loop.outputs)}",
                )
            moves = wiring.of(loop, simulated.set_points.values)
            schedule = dataclasses.replace(simulated.set_points, outputs=loop.outputs, values=moves)
            alone = SimulatedPlant(known, schedule, simulated.seed, simulated.samples, ())
            members[loop.name] = Scenario.of(loop.name, path, nodes, alone)
        top.finish()
        return cls(path.name.split(".")[0], path, told, simulated, tuple(loops), members)


def load_scenario(path: Path | str) -> Scenario | UnitScenario:
    """Read a scenario file of one loop or of several.

    Raises:
        InputError: anything missing or wrong, in one line.
    """
    plant = Section(load_yaml(path), str(path)).section("plant", {})
    several = "loops" in plant.section("ros__parameters", {})
    return UnitScenario.load(path) if several else Scenario.load(path)


def _parameters(top: Section, node: str) -> dict[str, Any]:
    return node_values(top.section(node, {}).section("ros__parameters", {}))


def run_unit(
    scenario: UnitScenario,
    *,
    seed: int | None = None,
    samples: int | None = None,
    ideal_valves: bool = False,
    identify: bool = True,
) -> dict[str, LiveRun]:
    """Run all loops of ``scenario`` on their plant, with their estimators and swaps.

    Args:
        scenario: what to run.
        seed, samples: in place of the scenario's.
        ideal_valves: run with valves that follow OP exactly, to the end.
        identify: whether the estimators run; without them the controllers stay as they start.

    Returns:
        What happened in each loop, by its name. An outer loop has no stem.

    Raises:
        InputError: a controller cannot be built from its process.
    """
    told = scenario.simulated.with_ideal_valves() if ideal_valves else scenario.simulated
    wiring, model = Wiring(scenario.simulated.plant, scenario.loops), told.plant
    sessions = [LoopSession(one, one.plant, identify) for one in scenario.members.values()]
    in_force, op = list[FloatArray](), list[list[FloatArray]]()

    def controllers(measurement: Measurement, sp: FloatArray) -> FloatArray:
        in_force.append(wiring.set_points(sp))
        op.append([])
        for loop, session in zip(wiring.loops, sessions, strict=True):
            seen = dataclasses.replace(measurement, pv=wiring.of(loop, measurement.pv))
            op[-1].append(session(seen, wiring.of(loop, in_force[-1])))
        return wiring.take(op[-1])

    run, found = told.run(controllers, seed, samples), {}
    for loop, session, given in zip(wiring.loops, sessions, zip(*op, strict=True), strict=True):
        columns = [model.valve_names.index(tag) for tag in loop.valves if tag in model.valve_names]
        stem = run.record.stem if len(columns) == len(loop.valves) else None
        record = Record(
            loop.name,
            model.sample_time,
            loop.valves,
            loop.outputs,
            np.array(given),
            wiring.of(loop, run.record.pv),
            wiring.of(loop, np.array(in_force)),
            None if stem is None else stem[:, columns],
        )
        found[loop.name] = session.told(ClosedLoopRun(record, wiring.of(loop, run.pv_clean)))
    return found
