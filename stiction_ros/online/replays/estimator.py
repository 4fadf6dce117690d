"""The estimator of a recorded run once more, from the messages that it had."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

from stiction_ros.loop import LoopModel
from stiction_ros.online.health import Notice
from stiction_ros.online.loop_estimator import EstimatorNodeSettings, Fit, LoopEstimator
from stiction_ros.online.replays.bag import DOCUMENTS, ReplayBag, read_status

Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class ReplayedEstimates:
    """What the estimator told in the replay."""

    origin: int  # stamp of sample 0 of the run, ns
    first: int  # first sample of the run that is in the bag
    samples: int  # of the run up to the end of the bag
    missed: int  # samples that are missing within the bag
    fits: tuple[Fit, ...]  # every fit that was due within the bag
    told: Mapping[str, Mapping[int, dict[str, Any]]]  # statuses, as those of the bag


def replay_estimator(
    bag: ReplayBag,
    settings: EstimatorNodeSettings,
    origin: int,
    watched: LoopModel | None = None,
    progress: Progress | None = None,
) -> ReplayedEstimates:
    """Run the estimator over the messages in the order of the bag.

    Args:
        bag: of the run.
        settings: the node's effective parameters.
        origin: stamp of sample 0 of the run, ns.
        watched: what the monitor compares with; None for the loop as it is identified.
        progress: told the share of the messages that were taken in.
    """
    late = bag.stamps("pv")[0] > origin  # without the baseline of the monitor
    own = dataclasses.replace(settings, monitor=settings.monitor and not late)
    estimator = LoopEstimator(own, watched)
    estimator.pairs.origin = origin
    fits: list[Fit] = []
    told: dict[str, dict[int, dict[str, Any]]] = {key: {} for key in DOCUMENTS}
    signals = [signal for signal in bag.signals if signal.kind in ("pv", "op", "op_applied")]
    for number, signal in enumerate(signals):
        for one in estimator.take(signal.kind, signal.stamp, signal.names, signal.values):
            if isinstance(one, Notice):
                continue
            if isinstance(one, Fit):
                fits.append(one)
                if progress is not None:
                    progress((number + 1) / len(signals))
                if one.update is None:
                    continue
            keys = {key: str(value) for key, value in estimator.status_of(one)[2]}
            kind = next(key for key in DOCUMENTS if key in keys)
            told[kind][int(keys["window_end"])] = read_status(keys)
    first, missed = estimator.first or 0, estimator.pairs.counts["missed"]
    return ReplayedEstimates(origin, first, estimator.samples, missed, tuple(fits), told)
