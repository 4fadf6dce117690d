"""The estimator: pv and op in, friction and loop model out."""

from __future__ import annotations

from collections import deque
from concurrent.futures import Future
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.identification import Identification
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.estimates import figures_of, fit_status, friction_message, verdicts_of
from stiction_ros.nodes.gap_status import finding_status, look_status, monitor_status
from stiction_ros.nodes.managed import LATCHED_QOS, READER_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.messages import SECOND, to_ns, values_of
from stiction_ros.nodes.runner import run
from stiction_ros.online.live_estimator import FitUpdate, LiveEstimator, fit
from stiction_ros.online.monitoring import Monitoring
from stiction_ros.online.node_settings import EstimatorNodeSettings
from stiction_ros.online.pairing import PairedSample, Pairing
from stiction_ros.online.worker import FitWorker


class EstimatorNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.online.live_estimator.LiveEstimator`."""

    def __init__(self, **kwargs: Any) -> None:
        """Build the node ``estimator``; ``kwargs`` go to the ROS node."""
        super().__init__("estimator", EstimatorNodeSettings, **kwargs)
        self._worker: FitWorker | None = None

    def configure(self) -> None:
        self.settings.options()  # refuses what no fit can use
        name = self.settings.monitor_model
        self._watched = LoopModel.load(find_config(name)) if name else None
        self.live: LiveEstimator | None = None
        self._valves: tuple[str, ...] = ()
        self._outputs: tuple[str, ...] = ()
        self._pairs = Pairing(self.settings.sample_time)
        self._sample = 0
        self._pending: deque[tuple[int, Future[Identification]]] = deque()
        self._token = ""
        self._fits = self._failed = self._missed = 0
        self._said = "no fit yet"
        self._worker = FitWorker()
        self._done = self.create_guard_condition(self._collect)
        self._stiction = self.outlet(JointState, "stiction", SIGNAL_QOS, ("controller",))
        self._model = self.outlet(String, "loop_model", LATCHED_QOS, ("controller",))
        self.inlet(JointState, "pv", self._on_pv, READER_QOS, ("plant",))
        self.inlet(JointState, "op", self._on_op, READER_QOS, ("controller",))

    def configuration(self) -> dict[str, Any]:
        return {} if self._watched is None else {"model": self._watched.to_mapping()}

    def preparing(self) -> str:
        ready = self._worker is None or self._worker.compiled
        return "" if ready else "the fits are being compiled"

    def hardware(self) -> str:
        return str(self.settings.loop)

    def retune(self, settings: Any) -> None:
        settings.options()
        if self.live is not None:
            self.live.retune(settings)
            self.monitoring.retune(settings)

    def tasks(self) -> list[tuple[str, str, str, list[tuple[str, object]]]]:
        if self.live is None or not self.settings.monitor:
            return []
        return [monitor_status(self.monitoring, self._pairs.stamp_of)]

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        keys: list[tuple[str, object]] = [("sample", self._sample), ("fits", self._fits)]
        keys += [("failed_fits", self._failed), ("missed_samples", self._missed)]
        keys.append(("running_fits", len(self._pending)))
        return "warn" if self._missed else "ok", self._said, keys

    def finish(self) -> None:
        self._end_worker()
        super().finish()

    def on_cleanup(self, state: Any) -> Any:
        self._end_worker()
        self.destroy_guard_condition(self._done)
        return super().on_cleanup(state)

    def _end_worker(self) -> None:
        if self._worker is not None:
            self._worker.close()
            self._worker = None
            self._collect()

    # ---- samples in ------------------------------------------------------------------------

    def _on_pv(self, message: JointState) -> None:
        self._outputs = self._outputs or tuple(message.name)
        pv = values_of(message, self._outputs)
        if pv is not None:
            self._take(self._pairs.add_pv(to_ns(message.header.stamp), pv))

    def _on_op(self, message: JointState) -> None:
        self._valves = self._valves or tuple(message.name)
        op = values_of(message, self._valves)
        if op is not None:
            self._take(self._pairs.add_op(to_ns(message.header.stamp), op))

    def _take(self, samples: list[PairedSample]) -> None:
        for found in samples:
            if self.live is None:
                settings = self.settings
                names = (settings.loop, self._valves, self._outputs)
                self.live = LiveEstimator(settings, *names, settings.sample_time)
                self.monitoring = Monitoring(settings, self.live, self._watched, self._queue)
            if found.missed:
                self._skip(found)
            self.stamp, self._sample = found.stamp, found.sample + 1
            record = self.live.add(found.sample, found.op, found.pv)
            if record is not None:
                future = self._queue(fit, record, self.live.settings.options())
                self._pending.append((found.sample, future))
            look = self.monitoring.add(found.sample, found.op, found.pv)
            if look is not None:
                self.report([look_status(look, self._pairs.stamp_of)])

    def _queue(self, work: Any, *arguments: Any) -> Future[Any]:
        """Run ``work`` in the worker behind what is queued there; cancelled once that has ended."""
        if self._worker is None:
            future: Future[Any] = Future()
            future.cancel()
            return future
        future = self._worker.call(work, *arguments)
        future.add_done_callback(lambda _future: self._done.trigger())
        return future

    def _skip(self, found: PairedSample) -> None:
        """Pass over samples that never came: no window may hold them."""
        assert self.live is not None
        self.live.restart()
        self.monitoring.restart()
        self._missed += found.missed
        self.get_logger().warning(f"{found.missed} samples missed before sample {found.sample}")
        for sample in range(found.sample - found.missed, found.sample):
            if self.settings.due(sample):
                self._publish(self._pairs.stamp_of(sample), None)

    # ---- fits out --------------------------------------------------------------------------

    def _collect(self) -> None:
        """Publish every fit that is done, in order, and what the monitor has found."""
        while self._pending and self._pending[0][1].done():
            end, future = self._pending.popleft()
            if future.cancelled() or self.live is None:
                continue
            stamp = self._pairs.stamp_of(end)
            try:
                found = future.result()
            except Exception as error:  # one fit that fails must not end the estimator
                self._failed += 1
                self._said = f"window not usable: {error}"
                if not isinstance(error, InputError):
                    self._said = f"fit failed: {error!r}"
                    self.get_logger().error(self._said)
                self._publish(stamp, None)
                continue
            self._fits += 1
            update = self.live.conclude(end, found)
            self.monitoring.learn(update)
            self._announce(stamp, update)
        for finding in () if self.live is None else self.monitoring.collect():
            self.get_logger().warning(f"window to sample {finding.end}: {finding.text}")
            self.report([finding_status(finding, self._pairs.stamp_of)])

    def _announce(self, stamp: int, update: FitUpdate) -> None:
        if update.loop_model is not None:
            valid_from = stamp + self.settings.fit_latency * round(
                self.settings.sample_time * SECOND
            )
            self._token = str(valid_from)
            text = update.loop_model.to_yaml(valid_from=valid_from)
            self._model.publish(String(data=text))
        self._publish(stamp, update.identification)
        self._said = f"last window: {verdicts_of(update)}"
        self.get_logger().info(f"window to sample {update.end}: {figures_of(update)}")
        self.report([fit_status(stamp, update)])

    def _publish(self, stamp: int, found: Identification | None) -> None:
        """Publish one fit, or None for a window that was not usable."""
        self._stiction.publish(friction_message(stamp, self._token, found))


def main() -> int:
    """Run the node."""
    return run("estimator", "Identifies friction and process from op and pv.", EstimatorNode)


if __name__ == "__main__":
    raise SystemExit(main())
