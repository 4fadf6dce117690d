"""``stiction bench plant``: the list of a survey against what is true of a made plant."""

import argparse
import dataclasses
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_studies.benches.accuracy.answer import FOUND
from stiction_studies.benches.accuracy.share import Share, shares_table
from stiction_studies.commands import choices

TOP = 30
"""Valves that are opened first: of these at most one may be in order."""

LONGER = 1.2
"""Length of the list that must hold the sticky valves, over their number."""


@dataclasses.dataclass(frozen=True)
class Listed:
    """One loop of the list."""

    name: str  # of the loop
    place: int | None  # in the list, from 1; None where it was not judged
    sticky: bool  # whether its valve truly has friction that slips often while in automatic
    verdict: str | None  # what was said of the valve; None where it was not judged
    cause_right: bool | None  # whether the cause is one of the true ones; None where none is told
    status: str  # ``ok``, ``skipped``, ``failed`` or ``lost``, which the list does not have


def listed(truth: Mapping[str, Any], survey: Mapping[str, Any]) -> list[Listed]:
    """Return the loops of a plant as a survey lists them, the best place first.

    Args:
        truth: what ``stiction experiment plant`` writes beside its folder.
        survey: what ``stiction survey --json`` writes.
    """
    rows = {row["name"]: (place, row) for place, row in enumerate(survey["loops"], 1)}
    found = []
    for true in truth["loops"]:
        place, row = rows.get(true["name"], (None, {"status": "lost"}))
        judged = row["status"] == "ok"
        cause = row.get("cause")
        found.append(
            Listed(
                name=true["name"],
                place=place if judged else None,
                sticky=true["valve"] != "healthy" and true["slips_in_automatic"] >= choices.MANY,
                verdict=row.get("verdict") if judged else None,
                cause_right=None if cause in (None, "unknown") else cause in true["causes"],
                status=row["status"],
            )
        )
    return sorted(found, key=lambda one: (one.place is None, one.place))


def shares(rows: Sequence[Listed]) -> list[Share]:
    """Return the rates that a list is held to.

    Args:
        rows: the best place first.
    """
    sticky = sum(row.sticky for row in rows)
    placed = [row for row in rows if row.place is not None]
    top, longer = placed[:TOP], placed[: round(LONGER * sticky)]
    found = [row for row in rows if row.verdict in FOUND]
    told = [row for row in placed if row.verdict is not None]
    return [
        Share("in the list", sum(row.status != "lost" for row in rows), len(rows), "all"),
        Share("failed", sum(row.status == "failed" for row in rows), len(rows), ""),
        Share(f"in order, of the first {TOP}", _in_order(top), len(top), "<= 1"),
        Share(f"sticky, in {len(longer)} places", _sticky(longer), sticky, ">= 90 %"),
        Share("found, of the sticky", _sticky(found), sticky, ""),
        Share("sticky, of the found", _sticky(found), len(found), ""),
        Share("cause right", sum(row.cause_right is True for row in told), len(told), ">= 85 %"),
        Share("cause wrong", sum(row.cause_right is False for row in told), len(told), ""),
    ]


def _sticky(rows: Sequence[Listed]) -> int:
    return sum(row.sticky for row in rows)


def _in_order(rows: Sequence[Listed]) -> int:
    return len(rows) - _sticky(rows)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that only this benchmark has."""
    group = parser.add_argument_group("plant")
    group.add_argument("--truth", type=Path, metavar="F", help="beside the plant's folder")
    group.add_argument("--survey", type=Path, metavar="F", help="what survey --json wrote")


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark.

    Raises:
        InputError: a file is not given, cannot be read, or is something else.
    """
    rows = listed(_read(options.truth, "--truth"), _read(options.survey, "--survey"))
    rates = shares(rows)
    document = {
        "name": "plant",
        "machine": machine,
        "rates": [dataclasses.asdict(rate) | {"share": rate.share} for rate in rates],
        "loops": [dataclasses.asdict(row) for row in rows],
    }
    hand_over(options.json, document, lambda: _show(rows, rates))
    return 0


def _read(path: Path | None, option: str) -> Mapping[str, Any]:
    """Return a JSON file that lists loops."""
    if path is None:
        raise InputError("is needed", where=option, fix="name the file")
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            f"cannot be read: {error}",
            where=str(path),
            fix="--truth is what experiment plant writes, --survey what survey --json writes",
        ) from error
    if not isinstance(document, dict) or not isinstance(document.get("loops"), list):
        raise InputError(
            "lists no loops",
            where=str(path),
            fix="--truth is what experiment plant writes, --survey what survey --json writes",
        )
    return document


def _show(rows: Sequence[Listed], rates: Sequence[Share]) -> None:
    console = Console()
    console.print(shares_table(rates))
    console.print(f"statuses: {_counted(row.status for row in rows)}")
    for title, part in (
        ("sticky", [row for row in rows if row.sticky]),
        ("others", [row for row in rows if not row.sticky]),
    ):
        console.print(f"{title}: {_counted(row.verdict or 'not judged' for row in part)}")
    top = [row for row in rows[:TOP] if not row.sticky]
    if top:
        told = ", ".join(f"{row.place} {row.name}" for row in top)
        console.print(f"in order, of the first {TOP}: {told}")


def _counted(names: Any) -> str:
    return ", ".join(f"{name} {count}" for name, count in Counter(names).most_common())
