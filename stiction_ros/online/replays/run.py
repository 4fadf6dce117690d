"""A recorded run once more without ROS, held against what was published live."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from stiction_ros import __version__
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.node_settings import ControllerNodeSettings, EstimatorNodeSettings
from stiction_ros.online.replays import matching
from stiction_ros.online.replays.bag import NodeConfig, ReplayBag, read_replay_bag
from stiction_ros.online.replays.controller import SECOND, Offer, ReplayedControl, replay_controller
from stiction_ros.online.replays.estimator import ReplayedEstimator
from stiction_ros.online.replays.result import FitMatch, Match, ModeMatch, Replay
from stiction_ros.settings import from_mapping

T = TypeVar("T")
Progress = Callable[[float], None]


def replay(
    path: str | Path, *, namespace: str | None = None, progress: Progress | None = None
) -> Replay:
    """Run estimator and controller over a bag as they ran live, and compare.

    The settings are those that the nodes told on ``~/config``. In lockstep, a bag that holds
    the run from its first sample gives every published number again, bit for bit. A bag that
    begins later gives equal fits from the first window that lies in it as a whole; of the
    windows before, the recorded fits are taken in, and ``op`` is not compared.

    Args:
        path: a rosbag2 directory or a ``.mcap`` file.
        namespace: of the loop, when the bag holds several.
        progress: told the share of the messages that the estimator has taken in.

    Raises:
        InputError: no such bag, no configuration of an estimator in it, or unusable settings.
    """
    bag = read_replay_bag(path, namespace=namespace)
    if bag.estimator is None:
        raise InputError(
            "holds no configuration of an estimator",
            where=str(path),
            fix="record the topics ~/config, or use stiction identify",
        )
    settings = _settings(EstimatorNodeSettings, bag.estimator, str(path))
    first = bag.stamps("pv")[0]
    origin, notes = _origin(bag, settings, first)
    estimator = _estimate(bag, settings, origin, progress)
    whole = origin >= first
    known = matching.trust_is_known(bag, estimator.fits, settings.fit_first - 1)
    fits = tuple(matching.match_fit(bag, fit, known) for fit in estimator.fits)
    notes += _remarks(bag)
    if estimator.missed:
        notes.append(f"{estimator.missed} samples are missing within the bag")
    if not whole:
        notes.append(_late_start(estimator, fits, known))
    control = _control(bag, estimator, origin, first, str(path))
    modes = None if control is None else _modes(bag, control, first, whole, known)
    notes += () if control is None else control.notes
    return Replay(
        bag=bag,
        origin=origin,
        from_first_sample=whole,
        samples=estimator.samples,
        fits=fits,
        modes=modes,
        op=None if control is None or not whole else control.op,
        notes=tuple(notes),
        monitor=matching.match_monitor(bag, estimator),
    )


def _settings(kind: type[T], config: NodeConfig, where: str) -> T:
    return from_mapping(kind, config.parameters, f"{where}: {config.node}/config")


def _origin(bag: ReplayBag, settings: EstimatorNodeSettings, first: int) -> tuple[int, list[str]]:
    """Return the stamp of sample 0 of the run, and a note when the bag does not tell it."""
    if bag.counted is None:
        said = "/diagnostics of the estimator are missing: the first pv is taken for the run's"
        return first, [said]
    stamp, count = bag.counted
    return stamp - (count - 1) * round(settings.sample_time * SECOND), []


def _estimate(
    bag: ReplayBag, settings: EstimatorNodeSettings, origin: int, progress: Progress | None
) -> ReplayedEstimator:
    told = {stamp: fit.identification for stamp, fit in bag.told_fits.items()}
    watched: LoopModel | None = None
    if settings.monitor and bag.estimator is not None and bag.estimator.model is not None:
        where = f"{bag.estimator.node}/config: model"
        watched = LoopModel.from_mapping(dict(bag.estimator.model), where)
    estimator = ReplayedEstimator(settings, origin, told, watched=watched)
    signals = [signal for signal in bag.signals if signal.kind in ("pv", "op", "op_applied")]
    for number, signal in enumerate(signals):
        if estimator.take(signal) and progress is not None:
            progress((number + 1) / len(signals))
    return estimator


def _control(
    bag: ReplayBag, estimator: ReplayedEstimator, origin: int, first: int, where: str
) -> ReplayedControl | None:
    """Replay the controller on the replayed loop models; None without its configuration."""
    config = bag.controller
    if config is None or config.model is None:
        return None
    settings = _settings(ControllerNodeSettings, config, where)
    model = LoopModel.from_mapping(dict(config.model), f"{where}: {config.node}/config: model")
    offers = _offers(bag, estimator, first, round(model.sample_time * SECOND))
    return replay_controller(bag, settings, model, offers, origin)


def _offers(
    bag: ReplayBag, estimator: ReplayedEstimator, first: int, step: int
) -> tuple[Offer, ...]:
    """Return the recorded loop models of fits before the bag, then the replayed ones."""
    origin, latency = estimator.origin, estimator.settings.fit_latency * step
    begin = max((first - origin) // step, 0)
    came = {model.valid_from: model.ops_before + begin for model in bag.models}
    earlier = [m for m in bag.models if m.valid_from - latency < first]
    replayed = [fit for fit in estimator.fits if fit.model_text]
    texts = [(m.text, m.valid_from) for m in earlier]
    texts += [(fit.model_text, int(fit.token)) for fit in replayed]
    return tuple(
        Offer(text, max((valid_from - origin) // step, came.get(valid_from, 0), begin))
        for text, valid_from in texts
    )


def _modes(
    bag: ReplayBag, control: ReplayedControl, first: int, whole: bool, known: bool
) -> ModeMatch:
    """Compare the changes of mode; of a bag that begins late those after its first sample."""
    if whole:
        return matching.match_modes(bag.modes, control.changes)
    recorded = tuple(change for change in bag.modes if change.stamp > first)
    replayed = tuple(change for change in control.changes if change.stamp > first)
    before = control.changes[0].mode if control.changes else ""
    if not known:
        why = "what was trusted before the bag is not known"
        return ModeMatch(recorded, replayed, Match.NOT_COMPARED, why, before)
    return dataclasses.replace(matching.match_modes(recorded, replayed), before=before)


def _remarks(bag: ReplayBag) -> list[str]:
    """Return what the bag itself says against equality."""
    notes = list(bag.notes)
    configs = [config for config in (bag.estimator, bag.controller) if config is not None]
    notes += [
        f"{config.node} ran version {config.version}, this is {__version__}"
        for config in configs
        if config.version != __version__
    ]
    if any(config.parameters.get("pace") == "realtime" for config in configs):
        notes.append("recorded at realtime pace: late messages may have come in another order")
    if bag.controller is None:
        notes.append("no configuration of a controller: changes of mode are not replayed")
    return notes


def _late_start(estimator: ReplayedEstimator, fits: tuple[FitMatch, ...], known: bool) -> str:
    begin = f"the bag begins at sample {estimator.first} of the run"
    compared = next((fit.fit for fit in fits if fit.match is not Match.NOT_COMPARED), None)
    if compared is None:
        return f"{begin} and holds no whole window with its fit: no fit is compared, nor op"
    trust = "trust is built on all of them" if known else "what was trusted before is not known"
    return (
        f"{begin}: op is not compared, fits are from the window that ends at "
        f"{(compared.stamp - estimator.origin) / SECOND:.9g} s, {trust}"
    )
