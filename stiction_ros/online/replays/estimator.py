"""The estimator of a recorded run once more, from the messages that it had."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from stiction_ros import identification
from stiction_ros.errors import InputError
from stiction_ros.identification.friction import find_law
from stiction_ros.loop import LoopModel
from stiction_ros.online.estimator.live import FitUpdate, LiveEstimator, fit
from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapLook
from stiction_ros.online.monitor.monitoring import Monitoring
from stiction_ros.online.node_settings import EstimatorNodeSettings
from stiction_ros.online.pairing import PairedSample
from stiction_ros.online.replays.bag import Signal
from stiction_ros.records import Record

SECOND = 10**9


@dataclasses.dataclass(frozen=True)
class ReplayedFit:
    """One fit of the replay."""

    end: int  # last sample of the window, counted from the first sample of the run
    stamp: int  # its time, ns
    whole: bool  # whether the bag holds the whole window; otherwise the recorded fit stands in
    update: FitUpdate | None  # what the fit says; None when the window was not usable
    failure: str  # why it was not usable, or empty
    token: str  # ``valid_from`` of the loop model in force after it, as text
    model_text: str  # YAML of the loop model that it publishes, or empty

    @property
    def rows(self) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end by ``V1.f_s``, %, as ``stiction`` carries them."""
        return {} if self.update is None else self.update.identification.rows


class ReplayedEstimator:
    """Takes ``pv`` and ``op`` in the order of the bag and fits what the node fitted.

    Args:
        settings: the node's effective parameters.
        origin: stamp of sample 0 of the run, ns; None for the first ``pv`` in the bag.
        told: recorded identifications by the end of their window in ns; they stand in for
            windows that reach back before the bag, so that trust is built on all of them.
        fitter: runs one fit.
        watched: what the monitor compares with; None for the loop as it is identified.
    """

    def __init__(
        self,
        settings: EstimatorNodeSettings,
        origin: int | None = None,
        told: Mapping[int, Mapping[str, Any]] | None = None,
        fitter: Callable[..., identification.Identification] = fit,
        *,
        watched: LoopModel | None = None,
    ) -> None:
        self.settings = settings
        self.step = round(settings.sample_time * SECOND)
        self.looks: list[GapLook] = []
        self.findings: list[GapFinding] = []
        self._watched = watched
        self._monitoring: Monitoring | None = None
        self.fits: list[ReplayedFit] = []
        self.first: int | None = None
        self.samples = 0
        self.missed = 0
        self._pairs = settings.pairing()
        self._pairs.origin = origin
        self._told = told or {}
        self._fitter = fitter
        self._outputs: tuple[str, ...] = ()
        self._valves: tuple[str, ...] = ()
        self._live: LiveEstimator | None = None
        self._token = ""

    @property
    def origin(self) -> int:
        """Stamp of sample 0 of the run, ns; there must have been a ``pv``."""
        return self._pairs.stamp_of(0)

    def take(self, signal: Signal) -> list[ReplayedFit]:
        """Take one message of ``pv``, ``op`` or ``op_applied`` and return the fits due with it."""
        before = len(self.fits)
        if signal.kind == "pv":
            self._outputs = self._outputs or signal.names
            values = signal.of(self._outputs)
            paired = [] if values is None else self._pairs.add_pv(signal.stamp, values)
        else:
            self._valves = self._valves or signal.names
            values = signal.of(self._valves)
            add = self._pairs.add_op if signal.kind == "op" else self._pairs.add_applied
            paired = [] if values is None else add(signal.stamp, values)
        for sample in paired:
            self._add(sample)
        return self.fits[before:]

    def _add(self, found: PairedSample) -> None:
        settings = self.settings
        if self._live is None:
            names = (settings.loop, self._valves, self._outputs)
            self._live = LiveEstimator(settings, *names, settings.sample_time)
        if self.first is None:
            self.first = found.sample  # what came before it was not missed but not recorded
            if settings.monitor and found.sample == 0:
                self._monitoring = Monitoring(settings, self._live, self._watched)
        elif found.missed or found.begins:
            self._skip(self._live, found)
        self.missed += found.bridged
        self.samples = found.sample + 1
        record = self._live.add(found.sample, found.op, found.pv)
        if record is not None:
            self._fit(self._live, found.sample, record)
        if self._monitoring is not None:
            look = self._monitoring.add(found.sample, found.op, found.pv)
            self.looks += [] if look is None else [look]
            self.findings += self._monitoring.collect()

    def _skip(self, live: LiveEstimator, found: PairedSample) -> None:
        live.restart()
        if self._monitoring is not None:
            self._monitoring.restart()
        self.missed += found.missed
        for sample in range(found.sample - found.missed, found.sample):
            if self.settings.due(sample):
                self._unusable(sample, "samples are missing")

    def _fit(self, live: LiveEstimator, end: int, record: Record) -> None:
        whole = max(end + 1 - self.settings.window, 0) >= (self.first or 0)
        if not whole:
            mapping = self._told.get(self._pairs.stamp_of(end))
            if mapping is None:
                self._unusable(end, "the window begins before the bag", whole=False)
                return
            self._conclude(live, end, identification_of(mapping), whole=False)
            return
        try:
            found = self._fitter(record, live.options())
        except Exception as error:  # the node goes on after a fit that fails, so does its replay
            said = str(error) if isinstance(error, InputError) else repr(error)
            self._unusable(end, f"window not usable: {said}")
            return
        self._conclude(live, end, found, whole=True)

    def _conclude(
        self, live: LiveEstimator, end: int, found: identification.Identification, *, whole: bool
    ) -> None:
        stamp = self._pairs.stamp_of(end)
        update = live.conclude(end, found)
        if self._monitoring is not None:
            self._monitoring.learn(update)
        text = ""
        if update.loop_model is not None:
            settings = self.settings
            valid_from = stamp + settings.fit_latency * round(settings.sample_time * SECOND)
            self._token = str(valid_from)
            text = update.loop_model.to_yaml(valid_from=valid_from)
        self.fits.append(ReplayedFit(end, stamp, whole, update, "", self._token, text))

    def _unusable(self, end: int, why: str, *, whole: bool = True) -> None:
        stamp = self._pairs.stamp_of(end)
        self.fits.append(ReplayedFit(end, stamp, whole, None, why, self._token, ""))


def identification_of(mapping: Mapping[str, Any]) -> identification.Identification:
    """Return the identification that a mapping of ``identify --json`` tells, without stems."""
    try:
        return identification.Identification(
            status=identification.FitStatus(mapping["model"]["status"]),
            reason=str(mapping["model"]["reason"]),
            method=str(mapping["model"]["method"]),
            samples=int(mapping["samples"]),
            sample_time=float(mapping["sample_time"]),
            seconds=float(mapping["seconds"]),
            valves=tuple(_valve(valve) for valve in mapping["valves"]),
            outputs=tuple(_output(output) for output in mapping["outputs"]),
            stem=np.empty((0, len(mapping["valves"]))),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"a recorded identification cannot be read ({error!r})", where="/diagnostics"
        ) from None


def _valve(valve: Mapping[str, Any]) -> identification.ValveEstimate:
    return identification.ValveEstimate(
        name=str(valve["name"]),
        verdict=identification.VerdictKind(valve["verdict"]),
        law=str(valve["law"]),
        static_friction=float(valve["f_s"]),
        static_interval=_interval(valve["f_s_interval"]),
        dynamic_friction=float(valve["f_d"]),
        dynamic_interval=_interval(valve["f_d_interval"]),
        jump=float(valve["jump"]),
        stem_start=math.nan,
        moves=0,
        evidence={},
        further={
            entry.key: float(valve[entry.key])
            for entry in find_law(str(valve["law"])).parameters()[2:]
            if entry.key in valve
        },
    )


def _output(output: Mapping[str, Any]) -> identification.OutputModel:
    return identification.OutputModel(
        name=str(output["name"]),
        a=tuple(float(value) for value in output["a"]),
        b={str(key): tuple(float(v) for v in row) for key, row in output["b"].items()},
        delay={str(key): int(value) for key, value in output["delay"].items()},
        bias=float(output["bias"]),
        noise_std=float(output["noise_std"]),
        fit_one_step=_number(output["fit_one_step"]),
        fit_free_run=_number(output["fit_free_run"]),
    )


def _interval(ends: Any) -> tuple[float, float]:
    """Return an interval; JSON has no infinity and writes null for an open end."""
    low, high = ends
    return (-math.inf if low is None else float(low), math.inf if high is None else float(high))


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
