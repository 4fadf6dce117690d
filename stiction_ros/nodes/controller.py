"""The controller: pv and sp in, op out; swaps to what the estimator finds."""

from __future__ import annotations

from typing import Any

from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.config_files import find_config
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.managed import (
    LATCHED_QOS,
    LATCHED_READER_QOS,
    READER_QOS,
    SIGNAL_QOS,
    ManagedNode,
)
from stiction_ros.nodes.messages import SECOND, joint_state, to_ns, trajectory, values_of
from stiction_ros.nodes.runner import run
from stiction_ros.online.live_controller import LiveController
from stiction_ros.online.node_settings import ControllerNodeSettings


class ControllerNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.online.live_controller.LiveController`."""

    def __init__(self, **kwargs: Any) -> None:
        """Build the node ``controller``; ``kwargs`` go to the ROS node."""
        super().__init__("controller", ControllerNodeSettings, **kwargs)
        self._wall = RosClock(clock_type=ClockType.STEADY_TIME)

    def configure(self) -> None:
        settings = self.settings
        if not settings.model:
            raise InputError(
                "no loop model", where="controller: model", fix="set it to a *.loop.yaml"
            )
        self.model = LoopModel.load(find_config(settings.model))
        self.live = LiveController(settings, self.model)
        self._plan_names = (*self.model.outputs, *self.model.valve_names)
        self._step = round(self.model.sample_time * SECOND)
        self._origin: int | None = None
        self._sample = 0
        self._pv: dict[int, FloatArray] = {}
        self._sp: dict[int, FloatArray] = {}
        self._dv: dict[int, FloatArray] = {}
        self._last_sp: FloatArray | None = None
        self._last_op: JointState | None = None
        measured = self.model.process.measured_disturbances
        self._needs_dv = bool(measured) and settings.pace == "lockstep"
        self._fits: dict[int, str] = {}  # end of window -> valid_from of the model in force
        self._models: set[str] = {""}
        self._waiting_since: int | None = None
        self._told = 0
        self._held = ""
        others = ("plant", "estimator")
        self._op = self.outlet(JointState, "op", SIGNAL_QOS, others)
        self._prediction = self.outlet(JointTrajectory, "prediction", SIGNAL_QOS)
        self._mode = self.outlet(String, "mode", LATCHED_QOS)
        sp_qos = QoSProfile(depth=READER_QOS.depth)
        if settings.sp_source == "external":
            sp_qos.durability = DurabilityPolicy.TRANSIENT_LOCAL
        self.inlet(JointState, "pv", self._on_pv, READER_QOS, ("plant",))
        self.inlet(JointState, "sp", self._on_sp, sp_qos)
        self.inlet(JointState, "dv", self._on_dv, READER_QOS)
        self.inlet(JointState, "stiction", self._on_stiction, READER_QOS, ("estimator",))
        self.inlet(String, "loop_model", self._on_model, LATCHED_READER_QOS, ("estimator",))

    def configuration(self) -> dict[str, Any]:
        return {"model": self.model.to_mapping()}

    def hardware(self) -> str:
        return self.model.name

    def linked(self) -> None:
        self._try_step()

    def retune(self, settings: Any) -> None:
        self.live.retune(settings)

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        if self._waiting_since is not None and not self.failure:
            waited = (self._wall.now().nanoseconds - self._waiting_since) / SECOND
            if waited > self.settings.fit_timeout:
                self._fail(f"no fit came within {self.settings.fit_timeout:g} s")
        level = "warn" if self._held else "ok"
        return level, self._held or "running", [("sample", self._sample)]

    # ---- messages in -----------------------------------------------------------------------

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
        self._pv[stamp] = pv
        self._try_step()

    def _on_sp(self, message: JointState) -> None:
        sp = values_of(message, self.model.outputs)
        if sp is None:
            self.get_logger().warning("sp without a value for every output is ignored")
            return
        self._last_sp = sp
        if self.settings.sp_source == "schedule":
            self._sp[to_ns(message.header.stamp)] = sp
        self._try_step()

    def _on_dv(self, message: JointState) -> None:
        dv = values_of(message, self.model.process.measured_disturbances)
        if dv is not None:
            self._dv[to_ns(message.header.stamp)] = dv

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

    # ---- the step --------------------------------------------------------------------------

    def _try_step(self) -> None:
        """Step every sample that has all it needs, oldest first."""
        while self.running and self._pv:
            stamp = min(self._pv)
            sp = self._sp.get(stamp) if self.settings.sp_source == "schedule" else self._last_sp
            dv = self._dv.get(stamp)
            if sp is None or (dv is None and self._needs_dv) or not self._fit_is_there():
                return
            for queue in (self._sp, self._dv):
                for old in [s for s in queue if s <= stamp]:
                    del queue[old]
            result = self.live.step(self._pv.pop(stamp), sp, dv)
            self.stamp = stamp
            self._last_op = joint_state(stamp, self.model.valve_names, result.op)
            self._op.publish(self._last_op)
            self._sample += 1
            self._held = result.reason
            rows, picks = self.live.prediction(result, self.settings.prediction_points)
            times = (picks * self.model.sample_time).tolist()
            self._prediction.publish(trajectory(stamp, self._plan_names, rows, times))
            self._tell_changes()

    def _fit_is_there(self) -> bool:
        """Return whether the fit that takes effect at the present sample has come."""
        if self.settings.pace != "lockstep" or self.settings.mode != "auto":
            return True
        end = self.settings.awaited(self._sample)
        if end is None or self._origin is None:
            return True
        stamp = self._origin + end * self._step
        if self._fits.get(stamp, "?") in self._models:
            self._waiting_since = None
            self._fits = {s: f for s, f in self._fits.items() if s > stamp}
            return True
        if self._waiting_since is None:
            self._waiting_since = self._wall.now().nanoseconds
        return False

    def _tell_changes(self) -> None:
        """Publish every change of mode since the last call."""
        for change in self.live.changes[self._told :]:
            if self._origin is not None:
                self.stamp = self._origin + change.sample * self._step
            self._mode.publish(String(data=change.mode.value))
            self.get_logger().info(f"sample {change.sample}: {change.mode}, {change.reason}")
            keys = [("mode", change.mode.value), ("model", change.model), ("reason", change.reason)]
            self.report([("mode", change.mode.value, [*keys, *self.live.known_friction()])])
        self._told = len(self.live.changes)

    def _fail(self, reason: str) -> None:
        self.failure, self._held = reason, reason
        self.get_logger().error(f"{reason}; raise fit_timeout or check the estimator")
        self.running, self.finished = False, True


def main() -> int:
    """Run the node."""
    return run("controller", "Model predictive control that learns of stiction.", ControllerNode)


if __name__ == "__main__":
    raise SystemExit(main())
