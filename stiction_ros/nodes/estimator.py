"""The estimator: pv and op in, friction and loop model out."""

import time
from collections import Counter, deque
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any

import numpy as np
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.config_files import find_config
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification import Identification
from stiction_ros.loop import LoopModel
from stiction_ros.nodes.shared.managed import LATCHED_QOS, READER_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import SECOND, friction_message, to_ns, values_of
from stiction_ros.nodes.shared.peers import PLANTS
from stiction_ros.online.estimator.live import FitUpdate, LiveEstimator, fit
from stiction_ros.online.estimator.worker import FitWorker
from stiction_ros.online.health import stopped_after
from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapLook
from stiction_ros.online.monitor.monitoring import Monitoring
from stiction_ros.online.node_settings import EstimatorNodeSettings
from stiction_ros.online.pairing import NEW_RUN, PairedSample
from stiction_ros.texts import json_text

COUNTED = ("bridged", "repeated", "stale", "future")
SHOWN_AGAIN = 3.0  # s: a plant in lockstep shows its sample each second
FIGURES = ("gap", "baseline", "growth", "limit", "free_run_rmse", "noise_floor")  # of an output
Keys = list[tuple[str, object]]


class EstimatorNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.online.estimator.live.LiveEstimator`."""

    settings: EstimatorNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("estimator", EstimatorNodeSettings, **kwargs)
        self._worker: FitWorker | None = None

    def configure(self) -> None:
        self.settings.options()  # refuses what no fit can use
        name = self.settings.monitor_model
        self._watched = LoopModel.load(find_config(name)) if name else None
        self._forget_loop()
        self._refused: Counter[str] = Counter()
        self._heard = dict.fromkeys(("pv", "op"), time.monotonic())
        self._sample = 0
        self._token = ""
        self._fits = self._failed = 0
        self._said = "no fit yet"
        self._worker = FitWorker(self.settings.methods)
        self._done = self.create_guard_condition(self._collect)
        self._stiction = self.outlet(JointState, "stiction", SIGNAL_QOS, ("controller",))
        self._model = self.outlet(String, "loop_model", LATCHED_QOS, ("controller",))
        self.inlet(JointState, "op_applied", partial(self._on_op, applied=True), READER_QOS)
        self.inlet(JointState, "op", self._on_op, READER_QOS, ("controller",))
        self.inlet(JointState, "pv", self._on_pv, READER_QOS, PLANTS)

    def _forget_loop(self) -> None:
        self.live: LiveEstimator | None = None
        self._valves: tuple[str, ...] = ()
        self._outputs: tuple[str, ...] = ()
        self._pairs = self.settings.pairing()
        self._pending: deque[tuple[int, Future[Identification]]] = deque()
        self._strange: Counter[tuple[str, ...]] = Counter()

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
        settings.options()
        self._pairs.retune(*settings.bridges())
        if self.live is not None:
            self.live.retune(settings)
            self.monitoring.retune(settings)

    def tasks(self) -> list[tuple[str, str, str, list[tuple[str, object]]]]:
        if self.live is None or not self.settings.monitor:
            return []
        return [monitor_status(self.monitoring, self._pairs.stamp_of)]

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        counts, now = self._pairs.counts, time.monotonic()
        keys: list[tuple[str, object]] = [("sample", self._sample), ("fits", self._fits)]
        keys += [("failed_fits", self._failed), ("running_fits", len(self._pending))]
        keys += [(f"age_{name}", f"{now - heard:.3f}") for name, heard in self._heard.items()]
        keys += [("behind", self._pairs.behind)]
        keys += [("missed_samples", counts["missed"] + counts["bad"])]
        keys += [(f"{name}_samples", counts[name]) for name in COUNTED]
        keys += [("new_runs", counts["runs"])]
        keys += [(f"refused_{name}", count) for name, count in self._refused.items()]
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
        self._end_worker()
        super().finish()

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
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
        pv = self._values("pv", message, self._outputs)
        if pv is not None:
            self._outputs = self._outputs or tuple(message.name)
            self._take(self._pairs.add_pv(to_ns(message.header.stamp), pv))

    def _on_op(self, message: JointState, *, applied: bool = False) -> None:
        op = self._values("op", message, self._valves)
        if op is not None:
            self._valves = self._valves or tuple(message.name)
            add = self._pairs.add_applied if applied else self._pairs.add_op
            self._take(add(to_ns(message.header.stamp), op))

    def _values(self, topic: str, message: JointState, names: tuple[str, ...]) -> FloatArray | None:
        """Return the values of ``names``; None, and counted, where a message lacks one.

        The first message tells the tags. When many in succession have others, the first was
        a stray, or the loop is another one: all begins anew.
        """
        self._heard[topic] = time.monotonic()
        given = tuple(message.name)
        values = values_of(message, names or given) if given else None
        if values is not None:
            self._strange = Counter({k: n for k, n in self._strange.items() if k[0] != topic})
            return values
        self._refused[topic] += 1
        self.notice(f"tags of {topic}", "warn", f"{topic} without a value for each tag is left out")
        if given and len(given) == len(message.position):
            self._strange[topic, *given] += 1
        if self._strange[topic, *given] >= NEW_RUN:
            self.log.warning(f"{topic} has other tags now: all begins anew")
            self._forget_loop()
        return None

    def _take(self, samples: list[PairedSample]) -> None:
        for found in samples:
            if self.live is None:
                settings = self.settings
                names = (settings.loop, self._valves, self._outputs)
                self.live = LiveEstimator(settings, *names, settings.sample_time)
                self.monitoring = Monitoring(settings, self.live, self._watched, self._queue)
            if found.begins:
                self.log.info(f"a new run begins at stamp {found.stamp} ns")
            if found.missed or found.begins:
                self._skip(found)
            elif not np.isfinite(found.pv).all():
                self.notice("missed", "warn", f"bad samples from {found.sample} on, window anew")
            self.stamp, self._sample = found.stamp, found.sample + 1
            record = self.live.add(found.sample, found.op, found.pv)
            if record is not None:
                future = self._queue(fit, record, self.live.options())
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
        future = self._worker.submit(work, *arguments)
        future.add_done_callback(lambda _future: self._done.trigger())
        return future

    def _skip(self, found: PairedSample) -> None:
        """Pass over samples that never came: no window may hold them."""
        assert self.live is not None
        self.live.restart()
        self.monitoring.restart()
        if found.missed:
            text = f"{found.missed} samples missed before sample {found.sample}, window anew"
            self.notice("missed", "warn", text)
        for sample in range(found.sample - found.missed, found.sample):
            if self.settings.due(sample):
                self._stiction.publish(
                    friction_message(self._pairs.stamp_of(sample), self._token, {})
                )

    # ---- fits out --------------------------------------------------------------------------

    def _collect(self) -> None:
        """Publish every fit that is done, in order, and what the monitor has found."""
        while self._pending and self._pending[0][1].done():
            end, future = self._pending.popleft()
            if future.cancelled() or self.live is None:
                if self.live is not None:
                    self.live.drop(end)
                continue
            stamp = self._pairs.stamp_of(end)
            try:
                update = self.live.conclude(end, future.result())
                self.monitoring.learn(update)
            except Exception as error:  # one fit that fails must not end the estimator
                self._failed += 1
                self.live.drop(end)
                self._said = f"window not usable: {error}"
                if not isinstance(error, InputError):
                    self._said = f"fit failed: {error!r}"
                    self.log.error(self._said)
                self._stiction.publish(friction_message(stamp, self._token, {}))
                continue
            self._fits += 1
            self._announce(stamp, update)
        for finding in () if self.live is None else self.monitoring.collect():
            self.log.warning(f"window to sample {finding.end}: {finding.text}")
            self.report([finding_status(finding, self._pairs.stamp_of)])

    def _announce(self, stamp: int, update: FitUpdate) -> None:
        if update.loop_model is not None:
            valid_from = stamp + self.settings.fit_latency * round(
                self.settings.sample_time * SECOND
            )
            self._token = str(valid_from)
            text = update.loop_model.to_yaml(valid_from=valid_from)
            self._model.publish(String(data=text))
        self._stiction.publish(friction_message(stamp, self._token, update.identification.rows))
        self._said = f"last window: {verdicts_of(update)}"
        self.log.info(f"window to sample {update.end}: {figures_of(update)}")
        self.report([fit_status(stamp, update)])


def fit_status(stamp: int, update: FitUpdate) -> tuple[str, str, Keys]:
    """Return task, message and key-values of one fit, which is told once."""
    keys: Keys = [("window_end", stamp)]
    for name, friction in update.trusted.items():
        keys.append((f"{name}.trusted_law", friction.law))
        keys += [(f"{name}.trusted_{key}", value) for key, value in friction.figures().items()]
    keys.append(("identification", json_text(update.identification.to_dict(), indent=None)))
    return "fit", verdicts_of(update), keys


def verdicts_of(update: FitUpdate) -> str:
    """Return the verdicts of one fit in one line."""
    return ", ".join(f"{v.name} {v.verdict}" for v in update.identification.valves)


def figures_of(update: FitUpdate) -> str:
    """Return verdicts and frictions of one fit in one line, % of travel."""
    frictions = [
        f"{v.name}.f_s {v.static_friction:.3g}, {v.name}.f_d {v.dynamic_friction:.3g}"
        for v in update.identification.valves
    ]
    return f"{verdicts_of(update)}; {', '.join(frictions)}"


def monitor_status(
    monitoring: Monitoring, stamp_of: Callable[[int], int]
) -> tuple[str, str, str, Keys]:
    """Return level, task, message and key-values of the monitor's own status.

    Args:
        monitoring: of the node.
        stamp_of: gives the stamp of a sample, ns.
    """
    look, finding = monitoring.look, monitoring.finding
    keys: Keys = [
        ("looks", monitoring.looks),
        ("grown_looks", monitoring.grown),
        ("runs", monitoring.runs),
        ("running", monitoring.running),
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
    return "warn" if troubled else "ok", "monitor", monitoring.text, keys


def look_status(look: GapLook, stamp_of: Callable[[int], int]) -> tuple[str, str, Keys]:
    """Return task, message and key-values of one measurement, which is told once."""
    keys: Keys = [("window_end", stamp_of(look.end))]
    return "gap", look.text, [*keys, ("look", json_text(look.to_dict(), indent=None))]


def finding_status(found: GapFinding, stamp_of: Callable[[int], int]) -> tuple[str, str, Keys]:
    """Return task, message and key-values of what was found, which is told once."""
    keys: Keys = [("window_begin", stamp_of(found.begin)), ("window_end", stamp_of(found.end))]
    return "finding", found.text, [*keys, ("finding", json_text(found.to_dict(), indent=None))]
