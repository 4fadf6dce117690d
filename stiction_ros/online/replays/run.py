"""A recorded run once more without ROS, held against what was published live."""

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from stiction_ros import __version__
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.loop_estimator import SECOND, EstimatorNodeSettings, Fit
from stiction_ros.online.replays.bag import NodeConfig, ReplayBag, fit_told, read_replay_bag
from stiction_ros.online.replays.controller import ReplayedControl, replay_controller
from stiction_ros.online.replays.estimator import Progress, ReplayedEstimates, replay_estimator
from stiction_ros.online.replays.result import Comparison, FitMatch, Replay
from stiction_ros.records.bag.run_metadata import mapping_of
from stiction_ros.records.run.events import ModeChange
from stiction_ros.settings import from_mapping

T = TypeVar("T")


def replay(
    path: str | Path, *, namespace: str | None = None, progress: Progress | None = None
) -> Replay:
    """Run estimator and controller over a bag as they ran live, and compare.

    The settings are those that the nodes told on ``~/config``. In lockstep, a bag that holds
    the run from its first sample gives every published number again, bit for bit. A bag that
    begins later gives equal fits from the first window that lies in it as a whole; what is trusted
    after them, ``op`` and modes are not compared.

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
    window = 0 if whole else settings.window
    fits = tuple(_match_fit(bag, estimator, fit, window) for fit in estimator.fits)
    notes += _remarks(bag)
    if estimator.missed:
        notes.append(f"{estimator.missed} samples are missing within the bag")
    if not whole:
        notes.append(
            f"the bag begins at sample {estimator.first} of the run: fits are compared from the "
            "first whole window on, what is trusted after them, op and modes are not"
        )
    control = _control(bag, estimator, str(path)) if whole else None
    notes += () if control is None else control.notes
    return Replay(
        bag=bag,
        origin=origin,
        from_first_sample=whole,
        samples=estimator.samples,
        fits=fits,
        changes=() if control is None else control.changes,
        modes=None if control is None else _compared_modes(bag.modes, control.changes),
        op=None if control is None else control.op,
        monitor=_compared_monitor(bag, estimator) if settings.monitor else None,
        notes=tuple(notes),
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


def _control(bag: ReplayBag, estimator: ReplayedEstimates, where: str) -> ReplayedControl | None:
    """Replay the controller on the replayed loop models; None without its configuration."""
    config = bag.controller
    if config is None or config.model is None:
        return None
    settings = _settings(LiveControllerSettings, config, where)
    model = LoopModel.from_mapping(dict(config.model), f"{where}: {config.node}/config: model")
    step, origin = round(model.sample_time * SECOND), estimator.origin
    came = {token: model.ops_before for token, model in bag.models.items()}
    offers = tuple(
        (fit.model_text, max((int(fit.token) - origin) // step, came.get(fit.token, 0)))
        for fit in estimator.fits
        if fit.model_text
    )
    return replay_controller(bag, settings, model, offers, origin)


def _match_fit(bag: ReplayBag, estimator: ReplayedEstimates, fit: Fit, window: int) -> FitMatch:
    """Compare one fit with ``stiction``, and with what is told of it in ``/diagnostics``.

    In a bag that begins late the fit itself, where the bag holds its ``window``, in samples; that
    is 0 for a bag of the whole run, in which also what is trusted after the fit is compared.
    """
    if window and max(fit.end + 1 - window, 0) < estimator.first:
        return FitMatch(fit, False, Comparison(difference="window begins before the bag"))
    if fit.stamp not in bag.fits:
        return FitMatch(fit, True, Comparison(difference="not in the bag"))
    model = bag.models.get(fit.token) if fit.model_text else None
    recorded = bag.fits[fit.stamp] | bag.told["identification"].get(fit.stamp, {})
    replayed = fit_told(fit.rows, fit.token) | estimator.told["identification"].get(fit.stamp, {})
    recorded["loop_model"] = "" if model is None else model.document
    replayed["loop_model"] = mapping_of(fit.model_text) or ""
    if window:
        known = ("names", "stiction", "identification")
        recorded = {key: told for key, told in recorded.items() if key in known}
    return FitMatch(fit, True, Comparison.whole(recorded, replayed))


def _compared_modes(recorded: Sequence[ModeChange], replayed: Sequence[ModeChange]) -> Comparison:
    """Compare the changes of mode, with the time, model, reason and friction of each."""
    if not recorded:
        return Comparison(difference="the bag holds no change of mode")
    was, found = (
        {f"change {number}": vars(change) for number, change in enumerate(changes, start=1)}
        | {"changes of mode": len(changes)}
        for changes in (recorded, replayed)
    )
    return Comparison.whole(was, found)


def _compared_monitor(
    bag: ReplayBag, estimator: ReplayedEstimates
) -> tuple[Comparison, Comparison]:
    """Compare measurements and findings by the end of their window.

    Of the bag everything must come again; what the node was still looking into is not in it.
    """
    if estimator.first:
        late = Comparison(difference="the bag begins after the baseline")
        return late, late

    def compared(kind: str, key: str) -> Comparison:
        def called(end: int) -> str:
            return f"{kind} of the window that ends at {(end - estimator.origin) / SECOND:.9g} s"

        return Comparison.each(called, bag.told[key], estimator.told[key])

    looks = compared("gap", "look")
    if not looks.compared:
        looks = Comparison(difference="the bag holds no measurement")
    return looks, compared("finding", "finding")


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
