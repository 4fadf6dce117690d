"""Holds what a replayed monitor says against what was recorded."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from stiction_ros.online.replays.bag import ReplayBag
from stiction_ros.online.replays.estimator import ReplayedEstimator
from stiction_ros.online.replays.matching import first_difference
from stiction_ros.online.replays.result import Match, MonitorMatch
from stiction_ros.texts import json_text


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
