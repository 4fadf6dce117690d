"""Holds what a replay gives against what was recorded, bit for bit."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from stiction_ros.online.replays.bag import PublishedFit, ReplayBag
from stiction_ros.online.replays.estimator import ReplayedFit
from stiction_ros.online.replays.result import FitMatch, Match, ModeMatch
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
    return bool(fits and fits[0].end == first) and all(
        fit.whole or fit.update is not None or _told_unusable(bag, fit) for fit in fits
    )


def _told_unusable(bag: ReplayBag, fit: ReplayedFit) -> bool:
    published = bag.published_fits.get(fit.stamp)
    return published is not None and not published.rows


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
