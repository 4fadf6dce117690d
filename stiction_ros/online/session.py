"""A whole live loop without ROS: plant, controller and estimator in lockstep.

The nodes do the same through topics; with the same settings and seed both give the same
numbers.
"""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from stiction_ros.control import ControlMode
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import (
    ClosedLoopRun,
    LoopModel,
    Measurement,
    SetPoints,
    ValveChange,
    read_valve_changes,
    simulate_closed_loop,
)
from stiction_ros.loop.closed_loop import Controller
from stiction_ros.loop.valve_changes import valve_changes_text
from stiction_ros.loop.yaml_reading import Section, load_yaml
from stiction_ros.online.controller.live import ModeChange
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.controller.testing import ValveTestingController
from stiction_ros.online.estimator.live import FitUpdate
from stiction_ros.online.input.signal_check import SignalCheck
from stiction_ros.online.loop_estimator import EstimatorNodeSettings, Fit, LoopEstimator, Told
from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapLook
from stiction_ros.online.pairing import PairedSample
from stiction_ros.online.plain_settings import (
    FitSchedule,
    NodeSettings,
    PlantNodeSettings,
    RecorderNodeSettings,
)
from stiction_ros.settings import from_mapping as settings_from_mapping

NODE_SETTINGS: Mapping[str, type[NodeSettings]] = {
    "plant": PlantNodeSettings,
    "controller": LiveControllerSettings,
    "estimator": EstimatorNodeSettings,
    "recorder": RecorderNodeSettings,
}


def read_nodes(path: Path, without: str = "") -> dict[str, dict[str, Any]]:
    """Return the parameters of all nodes of a scenario file, by name, as written.

    A node may be named as ``controller``, or as ``/**/controller`` where the same file is for
    nodes in a namespace too.

    Args:
        path: the file.
        without: a node that may lack, and is left out.

    Raises:
        InputError: a node that lacks or is unknown, a parameter that it does not know.
    """
    top = Section(load_yaml(path), str(path))
    if "loops" in top.section("plant", {}).section("ros__parameters", {}):
        fix = "start it by stiction demo, or use stiction_ros.online.unit"
        raise InputError("holds several loops", where=str(path), fix=fix)
    nodes: dict[str, dict[str, Any]] = {}
    for name, settings in NODE_SETTINGS.items():
        key = f"/**/{name}" if f"/**/{name}" in top else name
        if name == without and key not in top:
            continue
        values = node_values(top.section(key).section("ros__parameters"))
        settings_from_mapping(settings, values, f"{path}: {name}")
        if name != without:
            nodes[name] = values
    top.finish()
    return nodes


def node_values(section: Section) -> dict[str, Any]:
    """Return the parameters of a node as ROS takes them; changes of valves may stand as a list."""
    values = dict(section.values)
    if "valve_changes" in values:
        values["valve_changes"] = valve_changes_text(values["valve_changes"])
    return values


@dataclasses.dataclass(frozen=True)
class SimulatedPlant:
    """What the plant of a scenario is told."""

    plant: LoopModel  # the loop that is simulated
    set_points: SetPoints  # schedule
    seed: int  # of its noise
    samples: int
    valve_changes: tuple[ValveChange, ...]  # valves that change in mid-run

    def with_ideal_valves(self) -> Self:
        """Return the same plant with valves that follow OP exactly, to the end."""
        return dataclasses.replace(self, plant=self.plant.with_ideal_valves(), valve_changes=())

    def run(
        self, controller: Controller, seed: int | None = None, samples: int | None = None
    ) -> ClosedLoopRun:
        """Simulate the plant under ``controller``; ``seed`` and ``samples`` in place of its own."""
        return simulate_closed_loop(
            self.plant,
            controller,
            self.set_points,
            self.samples if samples is None else samples,
            self.seed if seed is None else seed,
            valve_changes=self.valve_changes,
        )


def read_plant(values: Mapping[str, Any], path: Path) -> SimulatedPlant:
    """Return what the parameters of the plant in the scenario file ``path`` name.

    Raises:
        InputError: a parameter or a file that cannot be used.
    """
    where = f"{path}: plant"
    told = settings_from_mapping(PlantNodeSettings, values, where)
    if told.samples < 1 or not told.set_points:
        raise InputError("a scenario needs samples ≥ 1 and set_points", where=where)
    model = LoopModel.load(path.parent / told.model)
    return SimulatedPlant(
        model,
        SetPoints.load(path.parent / told.set_points, model.outputs),
        told.seed,
        told.samples,
        read_valve_changes(told.valve_changes, model.valve_names, f"{where}: valve_changes"),
    )


@dataclasses.dataclass(frozen=True)
class Scenario(SimulatedPlant):
    """One scenario file: the plant, and the parameters of all nodes of its loop.

    Attributes:
        name: stem of the file.
        path: the file.
        nodes: parameters by node name, as written.
        plant, process: the simulated loop, and the model that the controller is built from.
        set_points: schedule.
        seed, samples: of the plant.
        valve_changes: valves of the plant that change in mid-run.
        controller, estimator: settings of the two.
        monitor_model: what the monitor compares with; None for the loop as it is identified.

    Examples:
        >>> from stiction_ros import Scenario, find_config
        >>> scenario = Scenario.load(find_config("siso.scenario.yaml"))
        >>> scenario.plant.valve_names, scenario.process.valves[0].effects
        (('V1',), ())
    """

    name: str
    path: Path
    nodes: Mapping[str, Mapping[str, Any]]
    process: LoopModel
    controller: LiveControllerSettings
    estimator: EstimatorNodeSettings
    monitor_model: LoopModel | None = None

    def __repr__(self) -> str:
        return f"<Scenario {self.name}: {self.samples} samples of {self.plant!r}, seed {self.seed}>"

    @classmethod
    def load(cls, path: Path | str) -> "Scenario":
        """Read a ROS parameter file (``node: {ros__parameters: {…}}``).

        File names in it are relative to the file itself. ``valve_changes`` may be a list, which
        a ROS parameter cannot hold, or the same as YAML text.

        Raises:
            InputError: anything missing or wrong, in one line.

        Args:
            path: the scenario, ``*.scenario.yaml`` by custom.
        """
        path = Path(path)
        nodes = read_nodes(path)
        return cls.of(path.name.split(".")[0], path, nodes, read_plant(nodes["plant"], path))

    @classmethod
    def of(
        cls, name: str, path: Path, nodes: Mapping[str, Mapping[str, Any]], told: SimulatedPlant
    ) -> "Scenario":
        """Return the scenario of one loop from what its nodes are told.

        Args:
            name: of the scenario.
            path: of the file, to which file names are relative.
            nodes: parameters by node name.
            told: what its plant is told.

        Raises:
            InputError: anything missing or wrong, in one line.
        """
        model = told.plant
        checked: dict[str, Any] = {
            node: settings_from_mapping(NODE_SETTINGS[node], nodes[node], f"{path}: {node}")
            for node in ("controller", "estimator")
        }
        controller = checked["controller"]
        process = _known_loop(path, "controller", controller.model, model)
        watched: LoopModel | None = None
        if checked["estimator"].monitor_model:
            watched = _known_loop(path, "estimator", checked["estimator"].monitor_model, model)
        for key in (field.name for field in dataclasses.fields(FitSchedule)):
            own, awaited = getattr(checked["estimator"], key), getattr(controller, key)
            if own != awaited:
                raise InputError(
                    f"is {own} for the estimator and {awaited} for the controller",
                    where=f"{path}: {key}",
                    fix="give both the same value",
                )
        try:
            controller.design(process)
            checked["estimator"].options()
        except InputError as error:
            raise error.within(str(path)) from None
        return cls(
            **vars(told),
            name=name,
            path=path,
            nodes=nodes,
            process=process,
            controller=controller,
            estimator=checked["estimator"],
            monitor_model=watched,
        )


def _known_loop(path: Path, node: str, name: str, plant: LoopModel) -> LoopModel:
    """Return the model that a node is given; one of another loop than the plant's is refused."""
    known = LoopModel.load(path.parent / name)
    own, wanted = ((m.valve_names, m.outputs, m.sample_time) for m in (known, plant))
    if own != wanted:
        raise InputError(
            "has other valves, outputs or another sample time than the plant's model",
            where=f"{path}: {node}: {name}",
            fix=f"use {', '.join((*plant.valve_names, *plant.outputs))}, {plant.sample_time:g} s",
        )
    return known


@dataclasses.dataclass(frozen=True)
class LiveRun:
    """What happened in a live loop.

    Attributes:
        run: signals.
        stem_estimate: χ̂ of the controller in force, shape (N, m), %.
        changes: modes, the first at sample 0.
        fits: every fit in order.
        looks, findings: what the monitor measured and found, in order.

    Examples:
        >>> from stiction_ros import Scenario, find_config, run_live
        >>> live = run_live(Scenario.load(find_config("siso.scenario.yaml")), samples=60)
        >>> live.changes[0].mode.value, live.stem_estimate.shape
        ('unaware', (60, 1))
    """

    run: ClosedLoopRun
    stem_estimate: FloatArray
    changes: tuple[ModeChange, ...]
    fits: tuple[FitUpdate, ...]
    looks: tuple[GapLook, ...] = ()
    findings: tuple[GapFinding, ...] = ()

    def __repr__(self) -> str:
        modes = ", ".join(f"{change.mode} from {change.sample}" for change in self.changes)
        return f"<LiveRun of {len(self.run.record)} samples: {modes}; {len(self.fits)} fits>"

    @property
    def swap(self) -> ModeChange | None:
        """The first change to a controller that knows the friction, or None."""
        aware = (ControlMode.EMBEDDING, ControlMode.INVERSION)
        return next((c for c in self.changes if c.mode in aware and c.sample > 0), None)


class LoopSession:
    """Controller and estimator behind the plain face that a simulated loop calls."""

    def __init__(self, scenario: Scenario, plant: LoopModel, identify: bool) -> None:
        self.controller = ValveTestingController(scenario.controller, scenario.process)
        self._check = SignalCheck(scenario.process.instruments)
        self.estimator: LoopEstimator | None = None
        if identify:
            settings = dataclasses.replace(
                scenario.estimator, loop=plant.name, sample_time=plant.sample_time
            )
            self.estimator = LoopEstimator(settings, scenario.monitor_model)
            self.estimator.pairs.origin = 0
            self.estimator.tags = {"pv": plant.outputs, "op": plant.valve_names}
        self._told: list[Told] = []
        self.stems: list[FloatArray] = []
        self._latency = scenario.controller.fit_latency
        self._sample = 0

    def __call__(self, measurement: Measurement, sp: FloatArray) -> FloatArray:
        pv = self._check.measured(measurement.time, measurement.pv)
        result = self.controller.step(pv, sp, measurement.dv)
        self.stems.append(self.controller.observed.stem)
        if self.estimator is not None:
            stamp = self.estimator.pairs.stamp_of(self._sample)
            found = PairedSample(self._sample, stamp, result.op, measurement.pv)
            for told in self.estimator.add(found):
                self._told.append(told)
                if isinstance(told, Fit):
                    self._learn(told)
        self._sample += 1
        return result.op

    def _learn(self, found: Fit) -> None:
        if found.error is not None and not isinstance(found.error, InputError):
            raise found.error  # a window that cannot be used changes nothing
        if found.update is not None and found.update.loop_model is not None:
            self.controller.offer(found.update.loop_model, self._sample + self._latency)

    def told(self, run: ClosedLoopRun) -> LiveRun:
        """Return what has happened so far, with the signals of ``run``."""
        fits = (one.update for one in self._told if isinstance(one, Fit))
        return LiveRun(
            run,
            np.array(self.stems),
            tuple(self.controller.changes),
            tuple(update for update in fits if update is not None),
            tuple(one for one in self._told if isinstance(one, GapLook)),
            tuple(one for one in self._told if isinstance(one, GapFinding)),
        )


def run_live(
    scenario: Scenario,
    *,
    seed: int | None = None,
    samples: int | None = None,
    ideal_valves: bool = False,
    identify: bool = True,
) -> LiveRun:
    """Run the loop of ``scenario`` with its estimator and its swaps.

    Args:
        scenario: what to run.
        seed, samples: in place of the scenario's.
        ideal_valves: run with valves that follow OP exactly, to the end.
        identify: whether the estimator runs; without it the controller stays as it starts.

    Returns:
        Signals, every fit and every change of the controller, in order.

    Raises:
        InputError: the controller cannot be built from the scenario's process.

    Examples:
        >>> from stiction_ros import Scenario, find_config, run_live
        >>> scenario = Scenario.load(find_config("siso.scenario.yaml"))
        >>> live = run_live(scenario, seed=7, samples=60)  # too short for a swap
        >>> live.run.record.pv.shape, live.swap
        ((60, 1), None)
    """
    told = scenario.with_ideal_valves() if ideal_valves else scenario
    loop = LoopSession(scenario, told.plant, identify)
    return loop.told(told.run(loop, seed, samples))
