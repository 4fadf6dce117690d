"""The topics that a controller reads, handed to its input port."""

import time
from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.control import ControlMode
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.shared.managed import LATCHED_READER_QOS, READER_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import rows_of, to_ns, values_of
from stiction_ros.nodes.shared.peers import PLANTS
from stiction_ros.online.controller.testing import ValveTestingController
from stiction_ros.online.handover.hand_over import Background
from stiction_ros.online.handover.known_friction import read_offer
from stiction_ros.online.input.port import InputPort
from stiction_ros.online.input.samples import SetPointPreview
from stiction_ros.online.node_settings import ControllerNodeSettings

# What is read to the end before a step, in this order.
DRAINED = ("op_applied", "sp", "dv", "pv")


class ControllerInputs(ManagedNode):
    """A controller's topics in; the subclass steps and sets the attributes in ``configure``."""

    settings: ControllerNodeSettings
    model: LoopModel
    live: ValveTestingController
    port: InputPort
    background: Background
    listening: bool  # whether a PV is for this node: it is active
    fits: dict[int, str]  # end of window -> valid_from of the model in force
    models: set[str]  # valid_from of the models that have come
    reading: deque[Future[LoopModel]]

    @abstractmethod
    def go(self) -> None:
        """Step every sample that has all it needs."""

    def listen(self) -> None:
        """Subscribe; rclpy serves what is ready in this order."""
        external = self.settings.sp_source == "external"
        sp_qos = LATCHED_READER_QOS if external else READER_QOS
        self._draining = False
        self.inlet(JointState, "op_applied", self._on_applied, READER_QOS, PLANTS)
        self.inlet(JointState, "sp", self._on_sp, sp_qos)
        self.inlet(JointState, "dv", self._on_dv, READER_QOS)
        self.inlet(JointState, "pv", self._on_pv, READER_QOS, PLANTS)
        self.inlet(JointTrajectory, "sp_preview", self._on_preview, READER_QOS)
        self.inlet(JointState, "stiction", self._on_stiction, READER_QOS, ("estimator",))
        self.inlet(String, "loop_model", self._on_model, LATCHED_READER_QOS, ("estimator",))

    def drain_signals(self) -> None:
        """Take in what is queued of all signals, so that the newest is known."""
        self._draining = True
        try:
            for topic in DRAINED:
                self.drain(topic)
        finally:
            self._draining = False

    def collect_offers(self) -> None:
        """Offer the loop models that have been read to the controller, in their order."""
        while self.reading and self.reading[0].done():
            try:
                model = self.reading.popleft().result()
            except InputError as error:
                self.log.error(f"a loop model is refused: {error}")
                continue
            except Exception as error:  # whatever is sent, it must not end the loop
                self.log.error(f"a loop model is refused: {type(error).__name__}")
                continue
            valid_from = int(model.document.get("valid_from", 0))
            due = self.port.due(valid_from)
            if self.settings.pace == "realtime":  # a stamp of an earlier run may be far off
                due = min(due, self.port.next + self.settings.fit_latency)
            self.live.offer(model, due)
            self.models.add(str(valid_from))

    def _on_applied(self, message: JointState) -> None:
        op = values_of(message, self.model.valve_names)
        ours = message.header.frame_id in ("", self.get_fully_qualified_name())
        self.port.add_applied(time.monotonic(), to_ns(message.header.stamp), op, ours)

    def _on_pv(self, message: JointState) -> None:
        if not self.listening:
            return
        stamp = to_ns(message.header.stamp)
        if not self.is_answered(stamp):
            self.port.add_pv(time.monotonic(), stamp, measured_of(message, self.model.outputs))
        self._go()

    def _on_sp(self, message: JointState) -> None:
        sp = values_of(message, self.model.outputs)
        self.port.add_sp(time.monotonic(), to_ns(message.header.stamp), sp)
        self._go_in_lockstep()

    def _on_dv(self, message: JointState) -> None:
        dv = values_of(message, self.model.process.measured_disturbances)
        self.port.add_dv(time.monotonic(), to_ns(message.header.stamp), dv)
        self._go_in_lockstep()

    def _on_preview(self, message: JointTrajectory) -> None:
        found = rows_of(message, self.model.outputs)
        preview = None if found is None else SetPointPreview(tuple(found[0]), found[1])
        self.port.add_preview(preview)

    def _on_stiction(self, message: JointState) -> None:
        if message.header.frame_id == ControlMode.VALVE_TEST:
            return  # it is its own
        if self.settings.pace == "lockstep":  # who waits for nobody need not remember
            self.fits[to_ns(message.header.stamp)] = message.header.frame_id
        self._go_in_lockstep()

    def _on_model(self, message: String) -> None:
        self.reading.append(self.background.submit(read_offer, message.data, self.model))
        self.collect_offers()
        self._go_in_lockstep()

    @abstractmethod
    def is_answered(self, stamp: int) -> bool:
        """Answer a sample in lockstep that is shown again; tell whether it was one."""

    def _go_in_lockstep(self) -> None:
        """Step: what came may be what a sample of an earlier PV has lacked."""
        if self.settings.pace == "lockstep":
            self._go()

    def _go(self) -> None:
        if not self._draining:
            self.go()


def measured_of(message: JointState, names: Sequence[str]) -> FloatArray | None:
    """Return the values of ``names``, NaN for those without one; None when no name is there."""
    values = values_of(message, names)
    if values is not None:
        return values
    if not set(names).intersection(message.name):
        return None
    found = dict(zip(message.name, message.position, strict=False))
    return np.array([found.get(name, np.nan) for name in names], dtype=float)
