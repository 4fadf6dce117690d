"""Holds what a replay gives against what was recorded, bit for bit."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from stiction_ros.online.replays.bag import PublishedFit, ReplayBag
from stiction_ros.online.replays.estimator import ReplayedEstimator, ReplayedFit
from stiction_ros.online.replays.result import FitMatch, Match, ModeMatch, MonitorMatch
from stiction_ros.records.run.events import ModeChange
from stiction_ros.texts import json_text

_TIMES = ("seconds",)  # wall time of a fit is another each time


def match_fit(bag: ReplayBag, fit: ReplayedFit, trust_known: bool = True) -> FitMatch:
    """Compare one fit with ``stiction``, ``loop_model`` and the fit told in ``/diagnostics``.

    Where trust was not built on all fits of the run, what is trusted after it is not compared.
    """
    if not fit.whole:
        taken = "" if fit.update is None else ", the recorded fit is taken"
        return FitMatch(fit, Match.NOT_COMPARED, f"window begins before the bag{taken}")
    published = bag.published_fits.get(fit.stamp)
    if published is None:
        return FitMatch(fit, Match.NOT_COMPARED, "not in the bag")
    difference = _rows_differ(published, fit) or _identification_differs(bag, fit)
    if trust_known and not difference:
        difference = _trust_differs(bag, published, fit)
    return FitMatch(fit, Match.DIFFERENT if difference else Match.EQUAL, difference)


def trust_is_known(bag: ReplayBag, fits: Sequence[ReplayedFit], first: int) -> bool:
    """Return whether trust was built on every fit of the run, the one at sample ``first`` on."""
    unusable = {stamp for stamp, published in bag.published_fits.items() if not published.rows}
    return bool(fits and fits[0].end == first) and all(
        fit.whole or fit.update is not None or fit.stamp in unusable for fit in fits
    )


def match_modes(recorded: Sequence[ModeChange], replayed: Sequence[ModeChange]) -> ModeMatch:
    """Compare the changes of mode, with the time, model, reason and friction of each."""
    both = tuple(recorded), tuple(replayed)
    if not recorded:
        return ModeMatch(*both, Match.NOT_COMPARED, "the bag holds no change of mode")
    for number, (one, other) in enumerate(zip(*both, strict=False), start=1):
        for key in ("mode", "stamp", "model", "reason", "frictions"):
            was, found = getattr(one, key), getattr(other, key)
            if key == "frictions":
                was, found = dict(was), as_told(was, found)
            if was != found:
                said = f"change {number}: {key} recorded {was!r}, replayed {found!r}"
                return ModeMatch(*both, Match.DIFFERENT, said)
    if len(recorded) != len(replayed):
        said = f"{len(recorded)} changes of mode recorded, {len(replayed)} replayed"
        return ModeMatch(*both, Match.DIFFERENT, said)
    return ModeMatch(*both, Match.EQUAL, "")


def _rows_differ(published: PublishedFit, fit: ReplayedFit) -> str:
    rows = fit.rows
    if list(rows) != list(published.rows):
        was, found = (", ".join(names) or "nothing" for names in (published.rows, rows))
        return f"stiction names {was}, replayed {found}"
    for name, values in rows.items():
        for key, old, new in zip(
            ("value", "lower end", "upper end"), published.rows[name], values, strict=True
        ):
            if old != new and not (math.isnan(old) and math.isnan(new)):
                return f"{name}, {key}: recorded {old!r}, replayed {new!r}"
    return ""


def _identification_differs(bag: ReplayBag, fit: ReplayedFit) -> str:
    told = bag.told_fits.get(fit.stamp)
    if told is None or fit.update is None:
        return ""
    # Through text and back, as the recorded one went: JSON knows no tuples and no infinity.
    found = json.loads(json_text(fit.update.identification.to_dict(), indent=None))
    return first_difference(told.identification, as_told(told.identification, found))


def as_told(recorded: Any, found: Any) -> Any:
    """Return what was found without keys that the version that recorded did not know."""
    if isinstance(recorded, Mapping) and isinstance(found, Mapping):
        return {key: as_told(recorded[key], found[key]) for key in found if key in recorded}
    if isinstance(recorded, list) and isinstance(found, list) and len(recorded) == len(found):
        return [as_told(*pair) for pair in zip(recorded, found, strict=True)]
    return found


def _trust_differs(bag: ReplayBag, published: PublishedFit, fit: ReplayedFit) -> str:
    """Compare what is trusted after the fit, and the loop model that comes of it."""
    if published.token != fit.token:
        return f"model in force: recorded {published.token!r}, replayed {fit.token!r}"
    told = bag.told_fits.get(fit.stamp)
    if told is None or fit.update is None:
        return _model_differs(bag, fit)
    trusted = {
        f"{valve}.{key}": value
        for valve, friction in fit.update.trusted.items()
        for key, value in friction.figures().items()
    }
    trusted = as_told(told.trusted, trusted)
    return first_difference(dict(told.trusted), trusted, "trusted") or _model_differs(bag, fit)


def _model_differs(bag: ReplayBag, fit: ReplayedFit) -> str:
    if not fit.model_text:
        return ""
    valid_from = int(fit.token)
    texts = [model.text for model in bag.models if model.valid_from == valid_from]
    if not texts:
        return "loop_model: replayed one that is not in the bag"
    return "" if fit.model_text in texts else "loop_model: the recorded text is another"


def first_difference(recorded: Any, found: Any, place: str = "") -> str:
    """Return where two JSON documents differ first and how; empty when they are equal."""
    if isinstance(recorded, Mapping) and isinstance(found, Mapping):
        keys = [key for key in {**recorded, **found} if place or key not in _TIMES]
        pairs = [(str(key), recorded.get(key), found.get(key)) for key in keys]
    elif isinstance(recorded, list) and isinstance(found, list) and len(recorded) == len(found):
        pairs = [(str(k), *pair) for k, pair in enumerate(zip(recorded, found, strict=True))]
    else:
        same = recorded == found
        return "" if same else f"{place}: recorded {recorded!r}, replayed {found!r}"[:300]
    for key, was, now in pairs:
        difference = first_difference(was, now, f"{place}.{key}" if place else key)
        if difference:
            return difference
    return ""


def match_monitor(bag: ReplayBag, estimator: ReplayedEstimator) -> MonitorMatch | None:
    """Compare measurements and findings by the end of their window; None without a monitor.

    Of the bag everything must come again; what the node was still looking into is not in it.
    """
    if not estimator.settings.monitor:
        return None
    if estimator.first != 0:
        why = "the bag begins after the baseline"
        return MonitorMatch(0, 0, 0, 0, Match.NOT_COMPARED, why)
    origin, step = estimator.origin, estimator.step
    looks = {origin + look.end * step: look.to_dict() for look in estimator.looks}
    found = {origin + one.end * step: one.to_dict() for one in estimator.findings}
    gaps = _differences("gap", bag.told_gaps.looks, looks, origin)
    named = _differences("finding", bag.told_gaps.findings, found, origin)
    told, shown = len(bag.told_gaps.looks), len(bag.told_gaps.findings)
    match, difference = Match.EQUAL, ""
    if gaps or named:
        match, difference = Match.DIFFERENT, [*gaps, *named][0]
    elif not told:
        match, difference = Match.NOT_COMPARED, "the bag holds no measurement"
    return MonitorMatch(told, told - len(gaps), shown, shown - len(named), match, difference)


def _differences(
    kind: str,
    told: Mapping[int, Mapping[str, Any]],
    replayed: Mapping[int, Mapping[str, Any]],
    origin: int,
) -> list[str]:
    """Return a sentence for each recorded document that did not come again as it was."""
    found = []
    for stamp, document in told.items():
        where = f"{kind} of the window that ends at {(stamp - origin) / 1e9:.9g} s"
        if stamp not in replayed:
            found.append(f"{where}: recorded, not replayed")
            continue
        # Through text and back, as the recorded one went.
        again = json.loads(json_text(replayed[stamp], indent=None))
        difference = first_difference(document, again)
        if difference:
            found.append(f"{where}: {difference}")
    return found
