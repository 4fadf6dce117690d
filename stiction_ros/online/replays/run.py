"""A recorded run once more without ROS, held against what was published live."""

import math
from pathlib import Path
from typing import TypeVar

from stiction_ros import __version__
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.loop_estimator import SECOND, Fit
from stiction_ros.online.node_settings import ControllerNodeSettings, EstimatorNodeSettings
from stiction_ros.online.replays.bag import NodeConfig, ReplayBag, fit_told, read_replay_bag
from stiction_ros.online.replays.controller import Offer, ReplayedControl, replay_controller
from stiction_ros.online.replays.estimator import Progress, ReplayedEstimates, replay_estimator
from stiction_ros.online.replays.result import (
    Comparison,
    FitMatch,
    Match,
    ModeMatch,
    MonitorMatch,
    Replay,
    first_difference,
)
from stiction_ros.records.bag.run_metadata import mapping_of
from stiction_ros.settings import from_mapping

T = TypeVar("T")


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
    watched: LoopModel | None = None
    if settings.monitor and bag.estimator.model is not None:
        where = f"{bag.estimator.node}/config: model"
        watched = LoopModel.from_mapping(dict(bag.estimator.model), where)
    estimator = replay_estimator(bag, settings, origin, watched, progress)
    whole = origin >= first
    known = _trust_is_known(bag, estimator)
    fits = tuple(_match_fit(bag, estimator, fit, known) for fit in estimator.fits)
    notes += _remarks(bag)
    if estimator.missed:
        notes.append(f"{estimator.missed} samples are missing within the bag")
    if not whole:
        notes.append(_late_start(estimator, fits, known))
    control = _control(bag, estimator, origin, first, str(path))
    modes = None if control is None else _match_modes(bag, control, first, whole, known)
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
        monitor=_match_monitor(bag, estimator),
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


def _control(
    bag: ReplayBag, estimator: ReplayedEstimates, origin: int, first: int, where: str
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
    bag: ReplayBag, estimator: ReplayedEstimates, first: int, step: int
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


def _trust_is_known(bag: ReplayBag, estimator: ReplayedEstimates) -> bool:
    """Return whether trust was built on every fit of the run."""
    fits, first = estimator.fits, estimator.settings.fit_first - 1
    unusable = {stamp for stamp, told in bag.fits.items() if not told["stiction"]}
    return bool(fits and fits[0].end == first) and all(
        fit.update is not None or fit.stamp in unusable
        for fit in fits
        if fit.end in estimator.partial
    )


def _match_fit(bag: ReplayBag, estimator: ReplayedEstimates, fit: Fit, known: bool) -> FitMatch:
    """Compare one fit with ``stiction``, ``loop_model`` and the fit told in ``/diagnostics``.

    Where trust was not built on all fits of the run, what is trusted after it is not compared.
    """
    if fit.end in estimator.partial:
        taken = "" if fit.update is None else ", the recorded fit is taken"
        return FitMatch(fit, False, Match.NOT_COMPARED, f"window begins before the bag{taken}")
    if fit.stamp not in bag.fits:
        return FitMatch(fit, True, Match.NOT_COMPARED, "not in the bag")
    published = {str(model.valid_from): model.text for model in bag.models}
    text = published.get(fit.token, "") if fit.model_text else ""
    recorded = bag.fits[fit.stamp] | bag.told["identification"].get(fit.stamp, {})
    replayed = fit_told(fit.rows, fit.token) | estimator.told["identification"].get(fit.stamp, {})
    recorded["loop_model"] = mapping_of(text) or ""
    replayed["loop_model"] = mapping_of(fit.model_text) or ""
    if not known:
        trusted = [key for key in recorded if ".trusted_" in key]
        for key in ("model in force", "loop_model", *trusted):
            del recorded[key]
    difference = first_difference(recorded, replayed)
    return FitMatch(fit, True, Match.of(difference), difference)


def _match_modes(
    bag: ReplayBag, control: ReplayedControl, first: int, whole: bool, known: bool
) -> ModeMatch:
    """Compare the changes of mode; of a bag that begins late those after its first sample."""
    after = -math.inf if whole else first
    both = [tuple(c for c in told if c.stamp > after) for told in (bag.modes, control.changes)]
    before = control.changes[0].mode if control.changes and not whole else ""
    why = "" if known or whole else "what was trusted before the bag is not known"
    if why or not both[0]:
        why = why or "the bag holds no change of mode"
        return ModeMatch(both[0], both[1], Match.NOT_COMPARED, why, before)
    recorded, replayed = (
        {f"change {number}": vars(change) for number, change in enumerate(changes, start=1)}
        | {"changes of mode": len(changes)}
        for changes in both
    )
    difference = first_difference(recorded, replayed)
    return ModeMatch(both[0], both[1], Match.of(difference), difference, before)


def _match_monitor(bag: ReplayBag, estimator: ReplayedEstimates) -> MonitorMatch | None:
    """Compare measurements and findings by the end of their window; None without a monitor.

    Of the bag everything must come again; what the node was still looking into is not in it.
    """
    if not estimator.settings.monitor:
        return None
    if estimator.first:
        why = "the bag begins after the baseline"
        return MonitorMatch(0, 0, 0, 0, Match.NOT_COMPARED, why)

    def compared(kind: str, key: str) -> Comparison:
        def called(end: int) -> str:
            return f"{kind} of the window that ends at {(end - estimator.origin) / SECOND:.9g} s"

        return Comparison.of(called, bag.told[key], estimator.told[key])

    looks, findings = compared("gap", "look"), compared("finding", "finding")
    difference = looks.first_difference or findings.first_difference
    match = Match.of(difference)
    if not looks.compared and not difference:
        match, difference = Match.NOT_COMPARED, "the bag holds no measurement"
    counts = looks.compared, looks.equal, findings.compared, findings.equal
    return MonitorMatch(*counts, match, difference)


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


def _late_start(estimator: ReplayedEstimates, fits: tuple[FitMatch, ...], known: bool) -> str:
    begin = f"the bag begins at sample {estimator.first} of the run"
    compared = next((fit.fit for fit in fits if fit.match is not Match.NOT_COMPARED), None)
    if compared is None:
        return f"{begin} and holds no whole window with its fit: no fit is compared, nor op"
    trust = "trust is built on all of them" if known else "what was trusted before is not known"
    return (
        f"{begin}: op is not compared, fits are from the window that ends at "
        f"{(compared.stamp - estimator.origin) / SECOND:.9g} s, {trust}"
    )
