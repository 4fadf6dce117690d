"""The messages that a controller takes, sorted into what its steps use."""

from __future__ import annotations

from abc import abstractmethod

from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.managed import LATCHED_READER_QOS, READER_QOS, ManagedNode, Outlet
from stiction_ros.nodes.messages import rows_of, to_ns, values_of
from stiction_ros.online.inbox import Inbox, SetPointPreview
from stiction_ros.online.live_controller import LiveController


class ControllerInputs(ManagedNode):
    """A controller's topics in; the subclass steps and sets the attributes in ``configure``."""

    model: LoopModel
    live: LiveController
    _inbox: Inbox
    _op: Outlet
    _last_op: JointState | None
    _origin: int | None
    _sample: int
    _step: int
    _fits: dict[int, str]  # end of window -> valid_from of the model in force
    _models: set[str]

    @abstractmethod
    def _try_step(self) -> None:
        """Step every sample that has all it needs."""

    def listen(self) -> None:
        """Subscribe."""
        sp_qos = QoSProfile(depth=READER_QOS.depth)
        if self.settings.sp_source == "external":
            sp_qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        self.inlet(JointState, "pv", self._on_pv, READER_QOS, ("plant",))
        self.inlet(JointState, "sp", self._on_sp, sp_qos)
        self.inlet(JointState, "dv", self._on_dv, READER_QOS)
        self.inlet(JointTrajectory, "sp_preview", self._on_preview, READER_QOS)
        self.inlet(JointState, "stiction", self._on_stiction, READER_QOS, ("estimator",))
        self.inlet(String, "loop_model", self._on_model, LATCHED_READER_QOS, ("estimator",))

    def _on_pv(self, message: JointState) -> None:
        stamp = to_ns(message.header.stamp)
        pv = values_of(message, self.model.outputs)
        if pv is None:
            self.get_logger().warning("pv without a value for every output is ignored")
            return
        if self._origin is None:
            self._origin = stamp
        if self._last_op is not None and stamp == to_ns(self._last_op.header.stamp):
            self._op.publish(self._last_op)  # a plant that was paused shows its sample again
            return
        self._inbox.add_pv(stamp, pv)
        self._try_step()

    def _on_sp(self, message: JointState) -> None:
        sp = values_of(message, self.model.outputs)
        if sp is None:
            self.get_logger().warning("sp without a value for every output is ignored")
            return
        self._inbox.add_sp(to_ns(message.header.stamp), sp)
        self._try_step()

    def _on_dv(self, message: JointState) -> None:
        dv = values_of(message, self.model.process.measured_disturbances)
        if dv is not None:
            self._inbox.add_dv(to_ns(message.header.stamp), dv)
            self._try_step()

    def _on_preview(self, message: JointTrajectory) -> None:
        found = rows_of(message, self.model.outputs)
        if found is None:
            self.get_logger().warning("sp_preview without rising times and all outputs is ignored")
            return
        self._inbox.preview = SetPointPreview(tuple(found[0]), found[1])

    def _on_stiction(self, message: JointState) -> None:
        self._fits[to_ns(message.header.stamp)] = message.header.frame_id
        self._try_step()

    def _on_model(self, message: String) -> None:
        try:
            model = LoopModel.from_yaml(message.data, "loop_model")
        except InputError as error:
            self.get_logger().error(str(error))
            return
        valid_from = int(model.document.get("valid_from", 0))
        at = self._sample
        if self._origin is not None:
            at = max(at, (valid_from - self._origin) // self._step)
        refused = self.live.offer(model, at)
        if refused:
            self.get_logger().error(f"model refused: {refused}")
        self._models.add(str(valid_from))
        self._try_step()
