"""A bag of a loop that ran without ROS, message by message as the nodes publish them."""

import dataclasses
import sys
from pathlib import Path
from typing import Any

import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "records"))
from bag_making import JOINT_STATE, SECOND, Bag, joint_state

from stiction_ros import __version__
from stiction_ros.config_files import find_config
from stiction_ros.effects import Stiction
from stiction_ros.online.controller.live import ModeChange
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.estimator.live import FitUpdate
from stiction_ros.online.loop_estimator import EstimatorNodeSettings
from stiction_ros.online.session import LiveRun, Scenario, run_live
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.bag_metadata import Qos
from stiction_ros.texts import json_text

SAMPLES = 520
SCHEDULE: dict[str, Any] = {"fit_first": 400, "fit_every": 50, "fit_latency": 5}
WINDOW = 300


def settings_of_run(
    law: Stiction | None = None, window: int = WINDOW
) -> tuple[Scenario, EstimatorNodeSettings, LiveControllerSettings]:
    """Return the scenario and the settings of its two nodes; ``law`` in place of the valve's."""
    scenario = Scenario.load(find_config("siso.scenario.yaml"))
    estimator = EstimatorNodeSettings(
        **SCHEDULE,
        loop="example1",
        window=window,
        output_order=3,
        input_order=3,
        delay_low=5,
        delay_high=5,
        law="he" if law is None else str(law.law),
    )
    if law is not None:
        plant = scenario.plant.with_valve_effects({"V1": [law]})
        scenario = dataclasses.replace(scenario, plant=plant)
    given = dict(scenario.nodes["controller"]) | SCHEDULE | {"horizon": 30, "wait_for": ()}
    given |= {key: tuple(value) for key, value in given.items() if isinstance(value, list)}
    controller = LiveControllerSettings(**given)
    scenario = dataclasses.replace(scenario, estimator=estimator, controller=controller)
    return scenario, estimator, controller


def write_run(directory: Path, law: Stiction | None = None, window: int = WINDOW) -> LiveRun:
    """Run the loop and write its bag; ``law`` in place of the valve's."""
    scenario, estimator, controller = settings_of_run(law, window)
    run = run_live(scenario, samples=SAMPLES, seed=4)
    bag = Bag(BagWriter(directory))
    _config(bag, "/estimator", estimator)
    _config(bag, "/controller", controller, {"model": scenario.process.to_mapping()})
    record = run.run.record
    assert record.sp is not None
    fits = {update.end: update for update in run.fits}
    changes = {change.sample: change for change in run.changes}
    token = ""
    for k in range(SAMPLES):
        stamp = (k + 1) * SECOND
        bag.joint("/pv", stamp, {"PV1": record.pv[k, 0]})
        bag.joint("/sp", stamp, {"PV1": record.sp[k, 0]})
        bag.joint("/op", stamp, {"V1": record.op[k, 0]})
        if k in changes:
            _mode(bag, stamp, changes[k], run)
        if k % 50 == 20:
            bag.diagnostics(stamp, "estimator: status", {"sample": str(k + 1)})
        if k in fits:
            token = _fit(bag, stamp, fits[k], token)
    bag.writer.close()
    return run


def _config(bag: Bag, node: str, settings: Any, more: dict[str, Any] | None = None) -> None:
    values = {
        key: list(value) if isinstance(value, tuple) else value
        for key, value in dataclasses.asdict(settings).items()
    }
    document = {"node": node, "version": __version__, "parameters": values} | (more or {})
    bag.text(f"{node}/config", yaml.safe_dump(document, sort_keys=False), SECOND)


def _mode(bag: Bag, stamp: int, change: ModeChange, run: LiveRun) -> None:
    values = {"mode": change.mode.value, "model": change.model, "reason": change.reason}
    last = next((f for f in reversed(run.fits) if f.end < change.sample and f.loop_model), None)
    if last is not None:
        for name, friction in last.trusted.items():
            figures = friction.behaviour().figures()
            values |= {f"{name}.{key}": str(value) for key, value in figures.items()}
    bag.diagnostics(stamp, "controller: mode", values)


def _fit(bag: Bag, stamp: int, update: FitUpdate, token: str) -> str:
    if update.loop_model is not None:
        valid_from = stamp + SCHEDULE["fit_latency"] * SECOND
        token = str(valid_from)
        bag.text("/loop_model", update.loop_model.to_yaml(valid_from=valid_from), stamp)
    rows = update.identification.rows
    columns = list(zip(*rows.values(), strict=True))
    data = joint_state(stamp, list(rows), *columns, frame=token)
    bag.put("/stiction", JOINT_STATE, data, stamp, Qos(depth=100))
    values = {
        "window_end": str(stamp),
        "identification": json_text(update.identification.to_dict(), indent=None),
    }
    for name, friction in update.trusted.items():
        figures = friction.figures()
        values |= {f"{name}.trusted_{key}": str(value) for key, value in figures.items()}
    bag.diagnostics(stamp, "estimator: fit", values)
    return token
