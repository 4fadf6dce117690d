"""The simulated plant: publishes pv (and sp), holds op, and owns the simulated time."""

from __future__ import annotations

from typing import Any

import numpy as np
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, Plant, SetPoints, read_valve_changes
from stiction_ros.nodes.managed import READER_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.messages import SECOND, joint_state, to_ns, to_stamp, values_of
from stiction_ros.nodes.runner import run
from stiction_ros.online.node_settings import PlantNodeSettings

LATE_SHARE = 0.01  # of the samples: more op that come too late are a warning


class PlantNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.loop.Plant`."""

    def __init__(self, **kwargs: Any) -> None:
        """Build the node ``plant``; ``kwargs`` go to the ROS node."""
        super().__init__("plant", PlantNodeSettings, **kwargs)
        self._pacer: Any = None

    def configure(self) -> None:
        settings = self.settings
        if not settings.model:
            raise InputError("no loop model", where="plant: model", fix="set it to a *.loop.yaml")
        self.model = LoopModel.load(find_config(settings.model))
        self.schedule = None
        if settings.set_points:
            path = find_config(settings.set_points)
            self.schedule = SetPoints.load(path, self.model.outputs)
        changes = read_valve_changes(
            settings.valve_changes, self.model.valve_names, "plant: valve_changes"
        )
        self.plant = Plant(self.model, settings.seed, changes)
        self._op = np.array(self.model.stem_start)
        self._step = round(self.model.sample_time * SECOND)
        self._start = round(settings.start_time * SECOND)
        self.stamp = self._start
        self._late = 0
        self._every = -(-settings.samples // 100)  # a hundred lines of progress
        self._clock_out = self.outlet(Clock, "/clock", SIGNAL_QOS)
        self._pv = self.outlet(JointState, "pv", SIGNAL_QOS, ("controller", "estimator"))
        self._sp = None
        if self.schedule is not None:
            self._sp = self.outlet(JointState, "sp", SIGNAL_QOS, ("controller",))
        self._stem = self.outlet(JointState, "stem", SIGNAL_QOS)
        self._dv = None
        if self.model.process.measured_disturbances:
            self._dv = self.outlet(JointState, "dv", SIGNAL_QOS, ("controller",))
        self.inlet(JointState, "op", self._on_op, READER_QOS, ("controller",))

    def configuration(self) -> dict[str, Any]:
        told = {"seed": self.settings.seed, "model": self.model.to_mapping()}
        return told if self.schedule is None else told | {"set_points": self.schedule.to_mapping()}

    def hardware(self) -> str:
        return self.model.name

    def linked(self) -> None:
        self._show()
        if self.settings.pace == "realtime":
            period = self.model.sample_time / self.settings.speed
            self._pacer = self.create_timer(period, self._advance)

    def deactivate(self) -> None:
        if self._pacer is not None:
            self.destroy_timer(self._pacer)
            self._pacer = None

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        text = "finished" if self.finished else "running"
        keys = [
            ("sample", self.plant.sample),
            ("pace", self.settings.pace),
            ("late_op", self._late),
        ]
        if self._late > LATE_SHARE * self.plant.sample:
            return "warn", f"{text}, op comes after its sample has passed", keys
        return "ok", text, keys

    def retune(self, settings: Any) -> None:
        if self._pacer is not None and settings.speed != self.settings.speed:
            self.deactivate()
            period = self.model.sample_time / settings.speed
            self._pacer = self.create_timer(period, self._advance)

    def _on_op(self, message: JointState) -> None:
        if not self.running:
            return
        op = values_of(message, self.model.valve_names)
        if op is None or not np.isfinite(op).all():
            self.get_logger().warning(
                f"op without finite values for {', '.join(self.model.valve_names)} is ignored"
            )
            return
        self._op = op
        if self.settings.pace == "realtime" and to_ns(message.header.stamp) < self.stamp:
            self._late += 1
        if self.settings.pace == "lockstep" and to_ns(message.header.stamp) == self.stamp:
            self._advance()

    def _advance(self) -> None:
        stem = self.plant.apply(self._op)
        self._stem.publish(joint_state(self.stamp, self.model.valve_names, stem))
        self.stamp = self._start + self.plant.sample * self._step
        if self.plant.sample == self.settings.samples:
            self.running, self.finished = False, True
        else:
            self._show()
        if self._every and self.plant.sample % self._every == 0:
            self.get_logger().info(f"sample {self.plant.sample} of {self.settings.samples}")

    def _show(self) -> None:
        measured = self.plant.measure()
        self._clock_out.publish(Clock(clock=to_stamp(self.stamp)))
        if self._dv is not None:
            names = self.model.process.measured_disturbances
            self._dv.publish(joint_state(self.stamp, names, measured.dv))
        if self._sp is not None and self.schedule is not None:
            sp = self.schedule.at(measured.time)
            self._sp.publish(joint_state(self.stamp, self.model.outputs, sp))
        self._pv.publish(joint_state(self.stamp, self.model.outputs, measured.pv))


def main() -> int:
    """Run the node."""
    return run("plant", "Simulates a loop model with sticky valves.", PlantNode)


if __name__ == "__main__":
    raise SystemExit(main())
