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
from stiction_ros.online.estimator.live import fit
from stiction_ros.online.health import Notice
from stiction_ros.online.loop_estimator import Fit, LoopEstimator
from stiction_ros.online.node_settings import EstimatorNodeSettings
from stiction_ros.online.replays.bag import DOCUMENTS, ReplayBag, read_status
from stiction_ros.records import Record

Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class ReplayedEstimates:
    """What the estimator told in the replay."""

    settings: EstimatorNodeSettings  # of the node
    origin: int  # stamp of sample 0 of the run, ns
    first: int  # first sample of the run that is in the bag
    samples: int  # of the run up to the end of the bag
    missed: int  # samples that are missing within the bag
    fits: tuple[Fit, ...]  # every fit that was due within the bag
    partial: frozenset[int]  # last samples of the windows that begin before the bag
    told: Mapping[str, Mapping[int, dict[str, Any]]]  # statuses, as those of the bag


def replay_estimator(
    bag: ReplayBag,
    settings: EstimatorNodeSettings,
    origin: int,
    watched: LoopModel | None = None,
    progress: Progress | None = None,
) -> ReplayedEstimates:
    """Run the estimator over the messages in the order of the bag.

    For windows that reach back before the bag the recorded fits stand in, so that trust is built on
    all of them.

    Args:
        bag: of the run.
        settings: the node's effective parameters.
        origin: stamp of sample 0 of the run, ns.
        watched: what the monitor compares with; None for the loop as it is identified.
        progress: told the share of the messages that were taken in.
    """

    def fitted(record: Record, options: Any) -> identification.Identification:
        end = round(record.start / record.sample_time) + len(record) - 1
        if max(end + 1 - settings.window, 0) >= (estimator.first or 0):
            return fit(record, options)
        partial.add(end)
        recorded = bag.told["identification"].get(estimator.pairs.stamp_of(end))
        if recorded is None:
            raise InputError("it begins before the bag")
        return identification_of(recorded["identification"])

    late = bag.stamps("pv")[0] > origin  # without the baseline
    own = dataclasses.replace(settings, monitor=settings.monitor and not late)
    estimator = LoopEstimator(own, watched, fitter=fitted)
    estimator.pairs.origin = origin
    fits: list[Fit] = []
    partial: set[int] = set()
    told: dict[str, dict[int, dict[str, Any]]] = {key: {} for key in DOCUMENTS}
    signals = [signal for signal in bag.signals if signal.kind in ("pv", "op", "op_applied")]
    for number, signal in enumerate(signals):
        for one in estimator.take(signal.kind, signal.stamp, signal.names, signal.values):
            if isinstance(one, Fit):
                fits.append(one)
                if progress is not None:
                    progress((number + 1) / len(signals))
            if isinstance(one, Notice) or (isinstance(one, Fit) and one.update is None):
                continue
            keys = estimator.status_of(one)[2]
            told[keys[-1][0]][estimator.pairs.stamp_of(one.end)] = read_status(
                {key: str(value) for key, value in keys}
            )
    first, counts = estimator.first or 0, estimator.pairs.counts
    return ReplayedEstimates(
        settings,
        origin,
        first,
        estimator.samples,
        counts["bridged"] + counts["missed"] - first,  # what came before was not recorded
        tuple(one for one in fits if one.end >= first),
        frozenset(partial),
        told,
    )


def identification_of(mapping: Mapping[str, Any]) -> identification.Identification:
    """Return the identification that a mapping of ``identify --json`` tells, without stems."""
    try:
        return identification.Identification(
            status=identification.FitStatus(mapping["model"]["status"]),
            reason=str(mapping["model"]["reason"]),
            method=str(mapping["model"]["method"]),
            samples=int(mapping["samples"]),
            sample_time=float(mapping["sample_time"]),
            seconds=math.nan,
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
