"""The controller: pv and sp in, op out; swaps to what the estimator finds."""

import time
from collections import deque
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, StepResult
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.shared.managed import (
    LATCHED_QOS,
    LATCHED_READER_QOS,
    LOOKS,
    READER_QOS,
    SIGNAL_QOS,
    ManagedNode,
)
from stiction_ros.nodes.shared.messages import (
    SECOND,
    diagnosis,
    friction_message,
    joint_state,
    rows_of,
    to_ns,
    trajectory,
    values_of,
)
from stiction_ros.nodes.shared.peers import PLANTS, publishers_of
from stiction_ros.online.controller.plans import rehearse, thinned_plan
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.controller.testing import ValveTestingController
from stiction_ros.online.handover.hand_over import AtOnce
from stiction_ros.online.handover.known_friction import read_offer
from stiction_ros.online.input.port import InputPort
from stiction_ros.online.input.port_health import PortHealth, keys
from stiction_ros.online.input.samples import PortRules, Sample, SetPointPreview
from stiction_ros.texts import json_text

QUICKEST, SLOWEST = 0.02, 0.25  # s between two looks for samples that are due
LEARNS = ("auto", "valve_test")  # modes in which it waits for the fits of the estimator
DRAINED = ("op_applied", "sp", "dv", "pv")  # what is read to the end before a step, in this order


class ControllerNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.online.controller.testing.ValveTestingController`."""

    settings: LiveControllerSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("controller", LiveControllerSettings, **kwargs)
        self.listening = False  # whether a PV is for this node: it is active

    def configure(self) -> None:
        settings = self.settings
        model = self.needed("model", "loop model", "*.loop.yaml")
        self.model = LoopModel.load(find_config(model))
        lockstep = settings.pace == "lockstep"
        self.background: Executor = AtOnce() if lockstep else ThreadPoolExecutor(1, "beside")
        self.live = ValveTestingController(settings, self.model, self.background)
        if not lockstep:
            rehearse(settings, self.model)
        self._plan_names = (*self.model.outputs, *self.model.valve_names)
        self._step = round(self.model.sample_time * SECOND)
        measured = self.model.process.measured_disturbances
        self.port = InputPort(
            PortRules(
                step=self._step,
                instruments=self.model.instruments,
                lockstep=lockstep,
                period=self.model.sample_time / settings.speed,
                scheduled=settings.sp_source == "schedule",
                needs_dv=bool(measured),
            )
        )
        self._port_health = PortHealth(self.port)
        self.fits: dict[int, str] = {}  # end of window -> valid_from of the model in force
        self.models = {""}  # valid_from of the models that have come
        self.reading: deque[Future[LoopModel]] = deque()
        self._last_op: JointState | None = None
        self._waiting_since: float | None = None
        self._told = self._doubts = 0
        self._result: StepResult | None = None
        self._sent_at: float | None = None
        self._running_since = time.monotonic()
        others = ("plant", "estimator")
        self._op = self.outlet(JointState, "op", SIGNAL_QOS, others)
        self._prediction = self.outlet(JointTrajectory, "prediction", SIGNAL_QOS)
        self._mode = self.outlet(String, "mode", LATCHED_QOS)
        self._stiction = self.outlet(JointState, "stiction", SIGNAL_QOS)
        self.listen()

    def configuration(self) -> dict[str, Any]:
        return {"model": self.model.to_mapping()}

    def hardware(self) -> str:
        return self.model.name

    def activate(self) -> None:
        self.listening = False
        self.drain_signals()  # what queued up before is not answered
        self.port.rest()
        self.listening = True
        self._running_since = time.monotonic()
        self._look_for_late(self.model.sample_time / self.settings.speed)

    def deactivate(self) -> None:
        self.listening = False
        self.never("late")

    def _look_for_late(self, period: float) -> None:
        """Look several times in a ``period`` (s) what is due."""
        self.every(min(max(period / 2, QUICKEST), SLOWEST), "late", self._go_on_without)

    def close(self) -> None:
        if hasattr(self, "live"):
            self.live.close()

    def linked(self) -> None:
        self._running_since = time.monotonic()
        self.go()

    def retune(self, settings: LiveControllerSettings) -> None:
        self.live.retune(settings)
        if settings.speed != self.settings.speed:
            period = self.model.sample_time / settings.speed
            self.port.pace.retune(period)
            if self.listening:
                self._look_for_late(period)

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        now = time.monotonic()
        age = "" if self._sent_at is None else f"{now - self._sent_at:.3f}"
        last = [] if self._result is None else diagnosis(self._result)
        values = [("sample", self.port.next), ("op_age", age), *keys(self.port, now), *last]
        return "ok", "running", values

    # ---- the step --------------------------------------------------------------------------

    def go(self) -> None:
        """Step every sample that has all it needs, oldest first; not while more is taken in."""
        if not self.running or self._draining:
            return
        if self.settings.pace == "realtime":
            self.drain_signals()
        self.collect_offers()
        while self.running and self.port.ready() and self._fit_is_there():
            samples = self.port.take(time.monotonic())
            if not samples:
                return
            self._work(samples)

    def is_answered(self, stamp: int) -> bool:
        last = self._last_op
        if self.settings.pace != "lockstep" or last is None or stamp != to_ns(last.header.stamp):
            return False
        if self.running:
            self._op.publish(last)
        return True

    def _go_on_without(self) -> None:
        """Step the samples that are due and whose PV has not come."""
        self.go()
        if self.running:
            self._work(self.port.overdue(time.monotonic()))

    def look(self) -> None:
        now = time.monotonic()
        for notice in self._port_health.look(now, now - self._running_since):
            self.notice(*notice)
        if self._looks % LOOKS == 0 and len(names := publishers_of(self, "op")) > 1:
            self.notice("commanders", "error", f"op is published by {', '.join(sorted(names))}")
        patience = self.settings.fit_timeout
        if self._waiting_since is not None and now - self._waiting_since > patience:
            self.end(f"no fit came within {patience:g} s; raise fit_timeout or check the estimator")

    def _work(self, samples: tuple[Sample, ...]) -> None:
        for sample in samples:
            if sample.begins:
                self.log.info(f"sample {sample.number}: a run begins")
                if sample.given.op is None:
                    shown = ", ".join(f"{value:g}" for value in self.live.own_op)
                    self.log.warning(f"nobody tells the op in force, taken to be {shown}")
            coming, ahead = self.port.preview, None
            if coming is not None:
                horizon = self.settings.horizon
                ahead = coming.ahead(sample.sp, sample.stamp, self._step, horizon)
            result = self.live.take(sample, ahead)
            if result is not None:
                self._answer(sample.stamp, result)

    def _answer(self, stamp: int, result: StepResult) -> None:
        self.stamp = stamp
        self._last_op = joint_state(stamp, self.model.valve_names, result.op)
        self._last_op.header.frame_id = self.get_fully_qualified_name()
        self._op.publish(self._last_op)
        self._sent_at = time.monotonic()
        self.port.sent(self._sent_at)
        before, self._result = self._result, result
        if result.reason:
            self.noticed.notice("step", "warn", result.reason)
        rows, picks = thinned_plan(self.live.observed, result, self.settings.prediction_points)
        times = (picks * self.model.sample_time).tolist()
        self._prediction.publish(trajectory(stamp, self._plan_names, rows, times))
        self._tell_changes()
        if before is not None and before.strategy != result.strategy:
            self.report()

    def _tell_changes(self) -> None:
        """Publish every change of mode since the last call."""
        for change in self.live.changes[self._told :]:
            self.stamp = self.port.grid.stamp_of(change.sample)
            self._mode.publish(String(data=change.mode.value))
            self.log.info(f"sample {change.sample}: {change.mode}, {change.reason}")
            told = [("mode", change.mode.value), ("model", change.model), ("reason", change.reason)]
            laws = zip(self.model.valve_names, self.live.frictions, strict=True)
            told += [(f"{name}.law", str(one.law)) for name, one in laws if one is not None]
            self.report([("mode", change.mode.value, [*told, *self.live.known_friction()])])
            if change is self.live.tested:
                self._tell_test()
        self._told = len(self.live.changes)
        for sample, reason in self.live.doubts[self._doubts :]:
            self.log.warning(f"sample {sample}: offered model not taken, {reason}")
        self._doubts = len(self.live.doubts)

    def _tell_test(self) -> None:
        """Publish the verdict of the test that has ended, if it came to one."""
        test = self.live.test
        if test is None or test.judgement is None:
            return
        found, valve = test.judgement, test.facts.valve
        rows = {
            f"{valve}.f_s": (found.f_s, *found.f_s_interval),
            f"{valve}.f_d": (found.f_d, *found.f_d_interval),
        }
        self._stiction.publish(friction_message(self.stamp, ControlMode.VALVE_TEST, rows))
        told = json_text(found.to_dict(), indent=None)
        self.report([("valve_test", found.sentence, [("judgement", told)])])

    # ---- lockstep --------------------------------------------------------------------------

    def _fit_is_there(self) -> bool:
        """Return whether the fit that takes effect at the present sample has come."""
        if self.settings.pace != "lockstep" or self.settings.mode not in LEARNS:
            return True
        end = self.settings.awaited(self.port.next)
        if end is None:
            return True
        stamp = self.port.grid.stamp_of(end)
        if self.fits.get(stamp, "?") in self.models:
            self._waiting_since = None
            self.fits = {s: f for s, f in self.fits.items() if s > stamp}
            return True
        if self._waiting_since is None:
            self._waiting_since = time.monotonic()
        return False

    # ---- messages in -----------------------------------------------------------------------

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
                self.inlets[topic].drain()
        finally:
            self._draining = False

    def collect_offers(self) -> None:
        """Offer the loop models that have been read to the controller, in their order."""
        while self.reading and self.reading[0].done():
            try:
                model = self.reading.popleft().result()
            except Exception as error:  # whatever is sent, it must not end the loop
                said = error if isinstance(error, InputError) else type(error).__name__
                self.log.error(f"a loop model is refused: {said}")
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
            pv = values_of(message, self.model.outputs, partly=True)
            self.port.add_pv(time.monotonic(), stamp, pv)
        self.go()

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

    def _go_in_lockstep(self) -> None:
        """Step: what came may be what a sample of an earlier PV has lacked."""
        if self.settings.pace == "lockstep":
            self.go()
