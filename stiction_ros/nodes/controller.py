"""The controller: pv and sp in, op out; swaps to what the estimator finds."""

from __future__ import annotations

from typing import Any

from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.config_files import find_config
from stiction_ros.control import StepResult
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.controller_inputs import ControllerInputs
from stiction_ros.nodes.managed import LATCHED_QOS, SIGNAL_QOS
from stiction_ros.nodes.messages import SECOND, diagnosis, joint_state, trajectory
from stiction_ros.nodes.runner import run
from stiction_ros.online.inbox import Inbox
from stiction_ros.online.live_controller import LiveController
from stiction_ros.online.node_settings import ControllerNodeSettings


class ControllerNode(ControllerInputs):
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
        self._origin = None
        self._sample = 0
        self._last_op = None
        measured = self.model.process.measured_disturbances
        needs_dv = bool(measured) and settings.pace == "lockstep"
        self._inbox = Inbox(settings.sp_source == "schedule", needs_dv)
        self._fits, self._models = {}, {""}
        self._waiting_since: int | None = None
        self._told = self._doubts = 0
        self._held = ""
        self._result: StepResult | None = None
        others = ("plant", "estimator")
        self._op = self.outlet(JointState, "op", SIGNAL_QOS, others)
        self._prediction = self.outlet(JointTrajectory, "prediction", SIGNAL_QOS)
        self._mode = self.outlet(String, "mode", LATCHED_QOS)
        self.listen()

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
        last = [] if self._result is None else diagnosis(self._result)
        return level, self._held or "running", [("sample", self._sample), *last]

    # ---- the step --------------------------------------------------------------------------

    def _try_step(self) -> None:
        """Step every sample that has all it needs, oldest first."""
        while self.running:
            sample = self._inbox.first()
            if sample is None or not self._fit_is_there():
                return
            self._inbox.used(sample)
            stamp, coming = sample.stamp, self._inbox.preview
            ahead = coming and coming.ahead(sample.sp, stamp, self._step, self.settings.horizon)
            result = self.live.step(sample.pv, sample.sp, sample.dv, ahead)
            self.stamp = stamp
            self._last_op = joint_state(stamp, self.model.valve_names, result.op)
            self._last_op.header.frame_id = self.get_fully_qualified_name()
            self._op.publish(self._last_op)
            self._sample += 1
            before, self._result, self._held = self._result, result, result.reason
            rows, picks = self.live.prediction(result, self.settings.prediction_points)
            times = (picks * self.model.sample_time).tolist()
            self._prediction.publish(trajectory(stamp, self._plan_names, rows, times))
            self._tell_changes()
            if before is not None and before.strategy != result.strategy:
                self.report()

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
        for sample, reason in self.live.doubts[self._doubts :]:
            self.get_logger().warning(f"sample {sample}: offered model not taken, {reason}")
        self._doubts = len(self.live.doubts)

    def _fail(self, reason: str) -> None:
        self.failure, self._held = reason, reason
        self.get_logger().error(f"{reason}; raise fit_timeout or check the estimator")
        self.running, self.finished = False, True


def main() -> int:
    """Run the node."""
    return run("controller", "Model predictive control that learns of stiction.", ControllerNode)


if __name__ == "__main__":
    raise SystemExit(main())
