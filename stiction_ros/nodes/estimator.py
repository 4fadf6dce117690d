"""The estimator: pv and op in, friction and loop model out."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.shared.managed import LATCHED_QOS, READER_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import friction_message, to_ns
from stiction_ros.nodes.shared.peers import PLANTS
from stiction_ros.online.estimator.live import FitUpdate
from stiction_ros.online.estimator.worker import FitWorker
from stiction_ros.online.health import Notice, stopped_after
from stiction_ros.online.loop_estimator import EstimatorNodeSettings, Fit, Keys, LoopEstimator, Told
from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapMonitor

COUNTED = ("repeated", "stale", "future")
SHOWN_AGAIN = 3.0  # s: a plant in lockstep shows its sample each second
FIGURES = ("gap", "baseline", "growth", "limit")  # of an output


class EstimatorNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.online.loop_estimator.LoopEstimator`."""

    settings: EstimatorNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("estimator", EstimatorNodeSettings, **kwargs)
        self._worker: FitWorker | None = None

    def configure(self) -> None:
        name = self.settings.monitor_model
        self._watched = LoopModel.load(find_config(name)) if name else None
        self.estimator = LoopEstimator(self.settings, self._watched, self._queue)
        self._heard = dict.fromkeys(("pv", "op"), time.monotonic())
        self._fits = self._failed = 0
        self._said = "no fit yet"
        self._worker = FitWorker(self.settings.methods)
        self._done = self.create_guard_condition(self._collect)
        self._stiction = self.outlet(JointState, "stiction", SIGNAL_QOS, ("controller",))
        self._model = self.outlet(String, "loop_model", LATCHED_QOS, ("controller",))
        for topic, writers in (("op_applied", ()), ("op", ("controller",)), ("pv", PLANTS)):
            self.inlet(JointState, topic, partial(self._take, topic), READER_QOS, writers)

    def linked(self) -> None:
        self._heard = dict.fromkeys(self._heard, time.monotonic())

    def configuration(self) -> dict[str, Any]:
        return {} if self._watched is None else {"model": self._watched.to_mapping()}

    def preparing(self) -> str:
        ready = self._worker is None or self._worker.compiled
        return "" if ready else "the fits are being compiled"

    def hardware(self) -> str:
        return str(self.settings.loop)

    def retune(self, settings: EstimatorNodeSettings) -> None:
        self.estimator.retune(settings)

    def tasks(self) -> list[tuple[str, str, str, list[tuple[str, object]]]]:
        monitor = self.estimator.monitor
        if monitor is None or not self.settings.monitor:
            return []
        return [monitor_status(monitor, self.estimator.pairs.stamp_of)]

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        estimator, now = self.estimator, time.monotonic()
        counts = estimator.pairs.counts
        keys: list[tuple[str, object]] = [("sample", estimator.samples), ("fits", self._fits)]
        keys += [("failed_fits", self._failed), ("running_fits", estimator.running)]
        keys += [(f"age_{name}", f"{now - heard:.3f}") for name, heard in self._heard.items()]
        keys += [("behind", estimator.pairs.behind)]
        keys += [("missed_samples", counts["missed"] + counts["bad"])]
        keys += [(f"{name}_samples", counts[name]) for name in COUNTED]
        keys += [("new_runs", counts["runs"])]
        keys += [(f"refused_{name}", count) for name, count in estimator.refused.items()]
        return "ok", self._said, keys

    def look(self) -> None:
        settings, now = self.settings, time.monotonic()
        limit = SHOWN_AGAIN
        if settings.pace == "realtime":
            limit = stopped_after(settings.sample_time / settings.speed)
        if now - self._heard["pv"] > limit:
            self.notice("pv", "error", "no pv")
        elif now - self._heard["op"] > limit:
            self.notice("op", "error", "no op")

    def finish(self) -> None:
        self.close()  # so that the last fits are told
        super().finish()

    def close(self) -> None:
        if self._worker is not None:
            self._worker.close()
            self._worker = None
            self._collect()
            self.destroy_guard_condition(self._done)

    # ---- samples in, fits out ----------------------------------------------------------------

    def _take(self, topic: str, message: JointState) -> None:
        self._heard[topic.removesuffix("_applied")] = time.monotonic()
        stamp = to_ns(message.header.stamp)
        self._tell(self.estimator.take(topic, stamp, message.name, message.position))

    def _queue(self, work: Any, *arguments: Any) -> Future[Any]:
        """Run ``work`` in the worker behind what is queued there; cancelled once that has ended."""
        if self._worker is None:
            future: Future[Any] = Future()
            future.cancel()
            return future
        future = self._worker.submit(work, *arguments)
        future.add_done_callback(lambda _future: self._done.trigger())
        return future

    def _collect(self) -> None:
        self._tell(self.estimator.collect())

    def _tell(self, told: list[Told]) -> None:
        """Publish what the estimator tells, in its order."""
        self.stamp = self.estimator.stamp
        for one in told:
            if isinstance(one, Notice):
                self.notice(*one)
                continue
            if isinstance(one, Fit):
                if one.model_text:
                    self._model.publish(String(data=one.model_text))
                self._stiction.publish(friction_message(one.stamp, one.token, one.rows))
                if one.update is None:
                    self._failed += 1
                    self._said = one.failure
                    continue
                self._fits += 1
                self._said = f"last window: {one.verdicts}"
                self.log.info(f"window to sample {one.end}: {figures_of(one.update)}")
            elif isinstance(one, GapFinding):
                self.log.warning(f"window to sample {one.end}: {one.text}")
            self.report([self.estimator.status_of(one)])


def figures_of(update: FitUpdate) -> str:
    """Return verdicts and frictions of one fit in one line, % of travel."""
    return ", ".join(
        f"{v.name} {v.verdict}, f_s {v.static_friction:.3g}, f_d {v.dynamic_friction:.3g}"
        for v in update.identification.valves
    )


def monitor_status(
    monitor: GapMonitor, stamp_of: Callable[[int], int]
) -> tuple[str, str, str, Keys]:
    """Return level, task, message and key-values of the monitor's own status.

    Args:
        monitor: of the node.
        stamp_of: gives the stamp of a sample, ns.
    """
    look, finding = monitor.look, monitor.finding
    keys: Keys = [
        ("looks", monitor.looks),
        ("grown_looks", monitor.grown),
        ("runs", monitor.runs),
        ("running", monitor.running),
    ]
    if look is not None:
        keys.append(("window_end", stamp_of(look.end)))
        for output in look.outputs:
            keys += [(f"{output.name}.{key}", getattr(output, key)) for key in FIGURES]
    if finding is not None:
        keys += [
            ("verdict", finding.word),
            ("effects", "; ".join(finding.effects)),
            ("experiment", finding.document.get("experiment", "")),
            ("verdict_window_end", stamp_of(finding.end)),
        ]
    troubled = look is not None and (look.grown or bool(look.failure))
    return "warn" if troubled else "ok", "monitor", monitor.text, keys
