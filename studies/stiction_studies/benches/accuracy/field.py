"""``stiction bench field``: identification over loops that share nothing with it, counted."""

import argparse
import dataclasses
import functools
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_studies.benches.accuracy.answer import (
    FOUND,
    METHOD,
    REFUSED,
    VERDICTS,
    Answer,
    answer_of,
)
from stiction_studies.benches.accuracy.share import Share, shares_table
from stiction_studies.commands import choices
from stiction_studies.seeds import run_seeds

if TYPE_CHECKING:
    from stiction_studies.field import FieldLoop

FIRST, LAST = 10_000, 10_099
"""Seeds when none are given; those below 1000 are for tuning."""

PUT_IN = 0.15
"""Band of the friction that is put into healthy loops, of OP's range before: with it OP moves
farther, and a tenth, which matters, is left of its range."""

MANY_SLIPS = f"{choices.MANY} slips or more"
FEW_SLIPS = "fewer slips"
OTHERS = "no friction"
GROUPS = (MANY_SLIPS, FEW_SLIPS, OTHERS)


def identified(method: str, record: Record) -> Mapping[str, Any]:
    """Return the mapping of ``identify --json`` by a method, else with default options."""
    from stiction_ros.identification import IdentificationOptions, identify

    return identify(record, IdentificationOptions(method=method)).to_dict()


@dataclasses.dataclass(frozen=True)
class Judged:
    """One loop, what is true of it and what was said.

    Attributes:
        seed, kind, plant, circumstances, samples: of the loop.
        valve, law, band, f_s, f_d, causes: of its truth.
        slips: in the part that was looked at.
        answer: what was said.
        shown: −2 log likelihood that the stem which truly moved gains beyond the price of
            friction, of a healthy valve with :data:`PUT_IN` of friction; None where it was not
            asked.
    """

    seed: int
    kind: str
    plant: str
    circumstances: tuple[str, ...]
    samples: int
    valve: str
    law: str
    band: float
    f_s: float | None
    f_d: float | None
    causes: tuple[str, ...]
    slips: int
    answer: Answer
    shown: float | None = None

    @property
    def group(self) -> str:
        """One of :data:`GROUPS`."""
        if self.valve == "healthy":
            return OTHERS
        return MANY_SLIPS if self.slips >= choices.MANY else FEW_SLIPS

    @property
    def verdict(self) -> str:
        """What was said of the valve."""
        return self.answer.verdict

    @property
    def found(self) -> bool:
        """Whether friction was found."""
        return self.verdict in FOUND

    @property
    def open(self) -> bool:
        """Whether nothing was decided."""
        return self.verdict in ("undecided", REFUSED)

    @property
    def cause_right(self) -> bool | None:
        """Whether the cause is one of the true ones; None where none is told."""
        if self.answer.cause in (None, "unknown"):
            return None
        return self.answer.cause in self.causes

    def covered(self) -> dict[str, bool]:
        """Return which intervals hold the truth, of those that were given."""
        pairs = {
            "band": (self.band, self.answer.band),
            "f_s": (self.f_s, self.answer.f_s),
            "f_d": (self.f_d, self.answer.f_d),
        }
        return {
            name: interval[0] <= true <= interval[1]
            for name, (true, interval) in pairs.items()
            if true is not None and interval is not None
        }


def judge(method: str, oracle: bool, seed: int) -> Judged:
    """Identify one loop of the field by a method, else with default options.

    Args:
        method: search.
        oracle: whether to ask what the true stem shows.
        seed: of the loop.
    """
    from stiction_studies.field import field_loop

    loop = field_loop(seed)
    truth = loop.truth
    return Judged(
        seed=seed,
        kind=loop.kind,
        plant=loop.plant,
        circumstances=loop.circumstances,
        samples=len(loop.record),
        valve=truth.valve.value,
        law=truth.law,
        band=truth.band,
        f_s=truth.f_s,
        f_d=truth.f_d,
        causes=tuple(sorted(cause.value for cause in truth.causes)),
        slips=loop.judged_slips,
        answer=answer_of(loop.record, functools.partial(identified, method)),
        shown=_shown(loop) if oracle else None,
    )


def _shown(found: "FieldLoop") -> float | None:
    """Return what the true stem of a loop gains beyond the price; None where it is refused."""
    from stiction_studies.benches.accuracy.known_stem import beyond_price
    from stiction_studies.field import with_friction

    healthy = found.truth.valve.value == "healthy"
    loop = with_friction(found.seed, PUT_IN) if healthy else found
    if loop is None:
        return None
    first, last = loop.judged_rows
    try:
        return beyond_price(longest_part([loop.record]), loop.stem[first:last, 0])
    except InputError:
        return None


def shares(rows: Sequence[Judged]) -> list[Share]:
    """Return the rates that identification is held to."""
    much = [row for row in rows if row.group == MANY_SLIPS]
    few = [row for row in rows if row.group == FEW_SLIPS]
    others = [row for row in rows if row.group == OTHERS]
    both = [*much, *others]
    told = [row for row in both if row.answer.cause is not None]
    right = sum(row.cause_right is True for row in told)
    wrong = sum(row.cause_right is False for row in told)
    held = [row.covered() for row in much if row.found]

    def covered(name: str) -> tuple[int, int]:
        known = [entry[name] for entry in held if name in entry]
        return sum(known), len(known)

    return [
        *_what_records_hold(much, others),
        Share("friction found", sum(row.found for row in much), len(much), ">= 92 %"),
        Share("friction called healthy", _healthy(much), len(much), "<= 1 %"),
        Share("others called sticky or backlash", _found(others), len(others), "<= 1 %"),
        Share("undecided of both", sum(row.open for row in both), len(both), "<= 15 %"),
        Share("fewer slips: right or undecided", len(few) - _healthy(few), len(few), ""),
        Share("interval of the band holds the truth", *covered("band"), ">= 90 %"),
        Share("He's law: interval of f_S", *covered("f_s"), ">= 93 %"),
        Share("He's law: interval of f_D", *covered("f_d"), ">= 93 %"),
        Share("cause right", right, len(told), ">= 85 %"),
        Share("cause wrong", wrong, len(told), "<= 5 %"),
    ]


def _what_records_hold(much: Sequence[Judged], others: Sequence[Judged]) -> list[Share]:
    """Return what nobody can do better than; nothing where the oracle was not asked."""
    asked = [row for row in much if row.shown is not None]
    shown = [row for row in asked if _shows(row)]
    put_in = [row for row in others if row.shown is not None]
    if not asked and not put_in:
        return []
    return [
        Share("true stem shows its friction", len(shown), len(asked), ""),
        Share("friction found, of these", _found(shown), len(shown), ""),
        Share("friction put into others shows", sum(map(_shows, put_in)), len(put_in), ""),
    ]


def _shows(row: Judged) -> bool:
    return row.shown is not None and row.shown > 0.0


def _healthy(rows: Iterable[Judged]) -> int:
    return sum(row.verdict == "healthy" for row in rows)


def _found(rows: Iterable[Judged]) -> int:
    return sum(row.found for row in rows)


def splits(rows: Sequence[Judged]) -> dict[str, list[Judged]]:
    """Return the loops by group, valve, plant and circumstance, to see where it misses.

    Valves that slip less often stand in their own row alone.
    """
    parts: dict[str, list[Judged]] = {group: [] for group in GROUPS}
    for row in rows:
        parts[row.group].append(row)
        for name in _places(row) if row.group != FEW_SLIPS else ():
            parts.setdefault(name, []).append(row)
    named = sorted(name for name in parts if name not in GROUPS)
    return {name: parts[name] for name in (*GROUPS, *named)}


def _places(row: Judged) -> list[str]:
    named = row.group == OTHERS or row.law == row.valve
    valve = row.law if named else f"{row.valve} {row.law}"
    told = row.circumstances or ("nothing unusual",)
    return [f"valve {valve}", f"plant {row.plant}", *(f"with {name}" for name in told)]


def table_row(name: str, rows: Sequence[Judged]) -> dict[str, Any]:
    """Return one row of the table, with the keys that every benchmark has."""
    times = [1e3 * row.answer.seconds for row in rows]
    held = [entry["band"] for row in rows if row.found and "band" in (entry := row.covered())]
    counts = {verdict: sum(row.verdict == verdict for row in rows) for verdict in VERDICTS}
    return {
        "case": name,
        "subject": "identify",
        "baseline": "truth",
        "subject_ms": float(np.median(times)) if times else None,
        "baseline_ms": None,
        "p99_ms": float(np.percentile(times, 99)) if times else None,
        "ratio": None,
        "note": "",
        "loops": len(rows),
        **counts,
        "band_held": sum(held),
        "band_told": len(held),
        "cause_right": sum(row.cause_right is True for row in rows),
        "cause_wrong": sum(row.cause_right is False for row in rows),
    }


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this benchmark."""
    from stiction_studies.seeds import seed_range

    group = parser.add_argument_group(
        "field; --seeds also for gain, exports and own, --jobs for all"
    )
    group.add_argument(
        "--seeds",
        type=seed_range,
        metavar="A:B",
        help=f"seeds of the loops of the field ({FIRST}:{LAST})",
    )
    group.add_argument("--method", choices=choices.COUNTED, help=f"search ({METHOD})")
    group.add_argument(
        "--oracle",
        action="store_true",
        default=None,
        help="field: also count the loops in which the stem that truly moved shows its friction",
    )


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark."""
    seeds = options.seeds or (FIRST, LAST)
    work = functools.partial(judge, options.method or METHOD, bool(options.oracle))
    rows = run_seeds(work, seeds, options.jobs or 1, "field")
    hand_over(options.json, document(rows, machine), lambda: show(rows))
    return 0


def document(rows: Sequence[Judged], machine: str) -> dict[str, Any]:
    """Return what ``--json`` writes."""
    return {
        "name": "field",
        "machine": machine,
        "rows": [
            table_row(f"{name} · {side}" if side else name, part)
            for name, whole in splits(rows).items()
            for side, part in _sides(name, whole)
        ],
        "rates": [dataclasses.asdict(rate) | {"share": rate.share} for rate in shares(rows)],
        "loops": [dataclasses.asdict(row) | {"group": row.group} for row in rows],
    }


def _sides(name: str, rows: Sequence[Judged]) -> list[tuple[str, list[Judged]]]:
    """Return the rows with friction and those without; of a group all."""
    if name in GROUPS:
        return [("", list(rows))]
    sticks = [row for row in rows if row.group != OTHERS]
    others = [row for row in rows if row.group == OTHERS]
    return [(side, part) for side, part in (("friction", sticks), (OTHERS, others)) if part]


def show(rows: Sequence[Judged]) -> None:
    """Print the rates, the table and the loops that were missed."""
    console = Console()
    console.print(shares_table(shares(rows)))
    console.print(_counted(rows))
    console.print(
        "loops: with friction that matters; others: without; open: undecided or refused; "
        "band: intervals that hold it, where friction is found"
    )
    for title, missed in misses(rows).items():
        if missed:
            console.print(f"{title}: seeds {', '.join(map(str, missed))}")


def _counted(rows: Sequence[Judged]) -> Table:
    """Return a line for every valve, plant and circumstance, with friction and without."""
    columns = ("loops", "found", "healthy", "open", "band", "others", "called", "open", "cause")
    table = Table(box=SIMPLE, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("", no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right")
    for name, part in splits(rows).items():
        sticks = [row for row in part if row.group != OTHERS]
        others = [row for row in part if row.group == OTHERS]
        held = [entry["band"] for row in sticks if row.found and (entry := row.covered())]
        told = [row for row in part if row.answer.cause is not None]
        cells = ["–"] * len(columns)
        if sticks:
            cells[:4] = _texts(len(sticks), _found(sticks), _healthy(sticks), _open(sticks))
            cells[4] = f"{sum(held)}/{len(held)}"
        if others:
            cells[5:8] = _texts(len(others), _found(others), _open(others))
        if told:
            cells[8] = f"{sum(row.cause_right is True for row in told)}/{len(told)}"
        table.add_row(name, *cells)
    return table


def _texts(*counts: int) -> list[str]:
    return [str(count) for count in counts]


def _open(rows: Iterable[Judged]) -> int:
    return sum(row.open for row in rows)


def misses(rows: Sequence[Judged]) -> dict[str, list[int]]:
    """Return the seeds of the loops with a wrong verdict."""
    return {
        "friction called healthy": [
            row.seed for row in rows if row.group == MANY_SLIPS and row.verdict == "healthy"
        ],
        "others called sticky or backlash": [
            row.seed for row in rows if row.group == OTHERS and row.found
        ],
    }
