"""The estimator of a running loop behind its messages: pairing, fits, monitor, what is told."""

import dataclasses
from collections import Counter, deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.identification import Identification
from stiction_ros.loop import LoopModel
from stiction_ros.online.estimator.live import EstimatorSettings, FitUpdate, LiveEstimator, fit
from stiction_ros.online.handover.hand_over import AtOnce
from stiction_ros.online.health import Notice
from stiction_ros.online.input.samples import picked
from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapLook, GapMonitor, MonitorRule
from stiction_ros.online.pairing import NEW_RUN, PairedSample, Pairing
from stiction_ros.online.plain_settings import PacedSettings
from stiction_ros.records import Record
from stiction_ros.settings import setting
from stiction_ros.texts import json_text

SECOND = 10**9
Keys = list[tuple[str, object]]


@dataclasses.dataclass(frozen=True)
class Fit:
    """One fit, as it is told."""

    end: int  # last sample of the window, counted from the first sample of the run
    stamp: int  # its time, ns
    token: str  # ``valid_from`` of the loop model in force after it, as text
    update: FitUpdate | None = None  # what the fit says; None when the window was not usable
    error: Exception | None = None  # why it was not usable
    model_text: str = ""  # YAML of the loop model that it publishes, or empty

    @property
    def rows(self) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end by ``V1.f_s``, %, as ``stiction`` carries them."""
        return {} if self.update is None else self.update.identification.rows

    @property
    def verdicts(self) -> str:
        """The verdicts in one line."""
        valves = () if self.update is None else self.update.identification.valves
        return ", ".join(f"{v.name} {v.verdict}" for v in valves)

    @property
    def failure(self) -> str:
        """Why the window was not usable; empty where it was."""
        if self.update is not None:
            return ""
        said = str(self.error) if isinstance(self.error, InputError) else repr(self.error)
        return f"window not usable: {said}"


@dataclasses.dataclass(frozen=True)
class EstimatorNodeSettings(EstimatorSettings, MonitorRule, PacedSettings):
    """The live estimator's settings, those of the monitor, and what belongs to the node."""

    loop: str = setting("loop", "name of the loop, for the models it publishes", fixed=True)
    sample_time: float = setting(1.0, "seconds between two samples", low=1e-6, fixed=True)
    monitor_model: str = setting(
        "",
        "loop model file the monitor compares with; empty for the loop as it is identified",
        fixed=True,
    )


Told = Notice | Fit | GapLook | GapFinding


class LoopEstimator:
    """Takes messages as they come and returns what is to be told, in order.

    Attributes:
        pairs: what pairs PV and OP.
        live, monitor: estimator and monitor; None before the first sample.
        tags: of ``pv`` and ``op``, as the first message of each told them.
        refused: messages that lacked a tag, by ``pv`` and ``op``.
        first, samples: number of the first sample, None before it; one more than that of the last.
        stamp: of the last sample, ns.
        token: ``valid_from`` of the loop model in force, as text.
    """

    def __init__(
        self,
        settings: EstimatorNodeSettings,
        watched: LoopModel | None = None,
        submit: Callable[..., "Future[Any]"] | None = None,
    ) -> None:
        """Start empty.

        Args:
            settings: of estimator and monitor; those that no fit can use are refused.
            watched: what the monitor compares with; None for the loop as it is identified.
            submit: runs a function beside the loop, one after the other; None does it at once.
        """
        settings.options()
        self.settings, self._watched = settings, watched
        self._submit = submit or AtOnce().submit
        self.refused: Counter[str] = Counter()
        self.samples = self.stamp = 0
        self.token = ""
        self._begin()

    def _begin(self) -> None:
        self.pairs = Pairing(self.settings.sample_time)
        self.live: LiveEstimator | None = None
        self.monitor: GapMonitor | None = None
        self.tags: dict[str, tuple[str, ...]] = {"pv": (), "op": ()}
        self.first: int | None = None
        self._pending: deque[tuple[int, Record, Future[Identification]]] = deque()
        self._strange: Counter[tuple[str, ...]] = Counter()

    def retune(self, settings: EstimatorNodeSettings) -> None:
        """Change settings from the next sample on."""
        settings.options()
        self.settings = settings
        if self.live is not None and self.monitor is not None:
            self.live.retune(settings)
            self.monitor.retune(settings)

    # ---- messages in -----------------------------------------------------------------------

    def take(
        self, topic: str, stamp: int, tags: Sequence[str], values: Sequence[float]
    ) -> list[Told]:
        """Take in a message of ``pv``, ``op`` or ``op_applied``; the first ones tell the tags.

        One that lacks a tag is left out. When many in succession have other tags, the first was
        a stray, or the loop is another one: all begins anew.
        """
        kind, given = topic.removesuffix("_applied"), tuple(tags)
        known = self.tags[kind] or given
        found = picked(given, values, known) if known else None
        if found is None:
            return self._refuse(kind, given, len(given) == len(values))
        self.tags[kind] = known
        self._strange = Counter({k: n for k, n in self._strange.items() if k[0] != kind})
        pairs = self.pairs
        add = {"pv": pairs.add_pv, "op": pairs.add_op, "op_applied": pairs.add_applied}[topic]
        return [told for sample in add(stamp, found) for told in self.add(sample)]

    def _refuse(self, kind: str, given: tuple[str, ...], whole: bool) -> list[Told]:
        self.refused[kind] += 1
        text = f"{kind} without a value for each tag is left out"
        if given and whole:
            self._strange[kind, *given] += 1
        if self._strange[kind, *given] >= NEW_RUN:
            text = f"{kind} has other tags now: all begins anew"
            self._begin()
        return [Notice(f"tags of {kind}", "warn", text)]

    def add(self, found: PairedSample) -> list[Told]:
        settings = self.settings
        if self.live is None or self.monitor is None:
            loop = (settings.loop, self.tags["op"], self.tags["pv"], settings.sample_time)
            self.live = LiveEstimator(settings, *loop)
            self.monitor = GapMonitor(settings, *loop, self._watched, self._submit)
            self.first = found.sample
        told: list[Told] = []
        if found.begins:
            self.live.restart()
            self.monitor.restart()
            told.append(Notice("run", "warn", f"a new run begins at stamp {found.stamp} ns"))
        self.stamp, self.samples = found.stamp, found.sample + 1
        record = self.live.add(found.sample, found.op, found.pv)
        if not len(self.live.window):
            text = f"too many samples lack up to {found.sample}, window anew"
            told.append(Notice("missed", "warn", text))
        if record is not None:
            future = self._submit(fit, record, self.live.options())
            self._pending.append((found.sample, record, future))
            told += self.collect()
        look = self.monitor.add(found.sample, found.op, found.pv)
        return [*told, *([] if look is None else [look]), *self.collect()]

    # ---- fits out --------------------------------------------------------------------------

    def collect(self) -> list[Told]:
        """Return every fit that is done, in order, and what the monitor has found."""
        told: list[Told] = []
        if self.live is None or self.monitor is None:
            return told
        while self._pending and self._pending[0][2].done():
            end, record, future = self._pending.popleft()
            if not future.cancelled():
                told.append(self._concluded(end, record, future, self.live, self.monitor))
        return told + list(self.monitor.collect())

    def _concluded(
        self,
        end: int,
        record: Record,
        found: Future[Identification],
        live: LiveEstimator,
        monitor: GapMonitor,
    ) -> Fit:
        stamp, text = self.pairs.stamp_of(end), ""
        try:
            update = live.conclude(end, found.result(), record)
            monitor.learn(live, update)
        except Exception as error:  # one fit that fails must not end the estimator
            return Fit(end, stamp, self.token, error=error)
        if update.loop_model is not None:
            step = round(self.settings.sample_time * SECOND)
            valid_from = stamp + self.settings.fit_latency * step
            self.token = str(valid_from)
            text = update.loop_model.to_yaml(valid_from=valid_from)
        return Fit(end, stamp, self.token, update, model_text=text)

    @property
    def running(self) -> int:
        """How many fits are being made."""
        return len(self._pending)

    def status_of(self, told: Fit | GapLook | GapFinding) -> tuple[str, str, Keys]:
        """Return task, message and key-values of the status that tells a result, once."""
        keys: Keys = [("window_end", self.pairs.stamp_of(told.end))]
        if isinstance(told, GapFinding):
            keys.insert(0, ("window_begin", self.pairs.stamp_of(told.begin)))
        if not isinstance(told, Fit):
            task, key = ("gap", "look") if isinstance(told, GapLook) else ("finding", "finding")
            return task, told.text, [*keys, (key, json_text(told.to_dict(), indent=None))]
        assert told.update is not None
        for name, friction in told.update.trusted.items():
            keys.append((f"{name}.trusted_law", friction.law))
            keys += [(f"{name}.trusted_{key}", value) for key, value in friction.figures().items()]
        document = told.update.identification.to_dict()
        return "fit", told.verdicts, [*keys, ("identification", json_text(document, indent=None))]
