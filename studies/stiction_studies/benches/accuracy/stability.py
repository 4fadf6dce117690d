"""``stiction bench stability``: whether an answer holds when what should not count is changed."""

from __future__ import annotations

import argparse
import csv
import dataclasses
import functools
import itertools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_ros.intake.record_file import CsvColumns
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_studies.as_given import open_parts
from stiction_studies.benches.accuracy.answer import FOUND, METHOD, Answer, Interval, answer_of
from stiction_studies.benches.accuracy.share import Share, shares_table
from stiction_studies.seeds import run_each

FIRST, LAST = 10_000, 10_199
"""Seeds of the field's loops when neither seeds nor a folder are given."""

INDEX = "index.csv"
"""Name of the files in a folder of records that say what is known of them."""

ACTUATOR = (
    CsvColumns(op={"V1": "CV_pct"}, pv={"PV1": "F_t_h"}),
    CsvColumns(op={"V1": "CV_pct"}, pv={"PV1": "LEVEL_pct"}),
)
"""Columns of the actuator benchmark's files: the command with the flow, or with the level."""

DELAYS = ((0, 5), (0, 20), (0, 40))
ROWS = (10, 30)


@dataclasses.dataclass(frozen=True)
class Variant:
    """The same record, changed in what should not count.

    Attributes:
        name: for tables.
        unit: whether only units change: then the verdict must be the same.
        op, pv: factor and offset.
        time: factor on the sample time.
        delay: range of delays; None is the default.
        cut: what is left out at begin and end: rows above 1, below it a share of all.
    """

    name: str
    unit: bool = False
    op: tuple[float, float] = (1.0, 0.0)
    pv: tuple[float, float] = (1.0, 0.0)
    time: float = 1.0
    delay: tuple[int, int] | None = None
    cut: tuple[float, float] = (0.0, 0.0)

    def applied(self, record: Record) -> Record:
        """Return the record as it is in this variant."""
        first, last = (int(c if c > 1.0 else c * len(record)) for c in self.cut)
        part = record.part(first, len(record) - last)
        sp = None if part.sp is None else self.pv[0] * part.sp + self.pv[1]
        return dataclasses.replace(
            part,
            op=self.op[0] * part.op + self.op[1],
            pv=self.pv[0] * part.pv + self.pv[1],
            sp=sp,
            sample_time=self.time * part.sample_time,
            start=self.time * part.start,
        )


BASE = Variant("as it is")
VARIANTS = (
    BASE,
    *(Variant(f"delay {low}:{high}", delay=(low, high)) for low, high in DELAYS),
    *(Variant(f"without the first {rows}", cut=(float(rows), 0.0)) for rows in ROWS),
    *(Variant(f"without the last {rows}", cut=(0.0, float(rows))) for rows in ROWS),
    Variant("first half", cut=(0.0, 0.5)),
    Variant("second half", cut=(0.5, 0.0)),
    Variant("OP × 20 + 50", unit=True, op=(20.0, 50.0)),
    Variant("OP × -0.01", unit=True, op=(-0.01, 0.0)),
    Variant("PV × 0.001 + 7", unit=True, pv=(0.001, 7.0)),
    Variant("PV × -40", unit=True, pv=(-40.0, 0.0)),
    Variant("time × 60", unit=True, time=60.0),
    Variant("time × 0.01", unit=True, time=0.01),
)


@dataclasses.dataclass(frozen=True)
class Source:
    """Where a record comes from.

    Attributes:
        name: for tables.
        seed: of a loop of the field; None for a file.
        path: of a file.
        columns: which columns it has.
        label: whether its valve is known to stick; None where nothing is known.
    """

    name: str
    seed: int | None = None
    path: Path | None = None
    columns: CsvColumns = CsvColumns()
    label: bool | None = None

    def read(self) -> Record:
        """Return the longest good part, without a stem."""
        from stiction_studies.field import field_loop

        if self.seed is not None:
            record = longest_part([field_loop(self.seed).record])
        else:
            record = longest_part(open_parts(str(self.path), self.columns))
        return dataclasses.replace(record, stem=None)


@dataclasses.dataclass(frozen=True)
class Held:
    """One record and what was said of its variants, frictions in its own unit of OP.

    Attributes:
        source: where it comes from.
        answers: by the name of the variant.
    """

    source: Source
    answers: Mapping[str, Answer]

    @property
    def turned(self) -> bool:
        """Whether friction is found in one variant and the valve called healthy in another."""
        said = {answer.verdict for answer in self.answers.values()}
        return "healthy" in said and not said.isdisjoint(FOUND)

    @property
    def units_count(self) -> bool:
        """Whether the verdict of a variant in other units is another."""
        base = self.answers[BASE.name].verdict
        return any(self.answers[v.name].verdict != base for v in VARIANTS if v.unit)

    def overlaps(self, which: str, sure: bool) -> list[tuple[str, bool]]:
        """Return for each variant whether its interval and that of the base meet.

        The two halves are held against each other as well.

        Args:
            which: ``f_s`` or ``band``.
            sure: whether only pairs count in which friction is found both times.
        """
        pairs = [(BASE.name, variant.name) for variant in VARIANTS[1:]]
        pairs.append(("first half", "second half"))
        found = []
        for one, other in pairs:
            first, second = self.answers[one], self.answers[other]
            if sure and not {first.verdict, second.verdict} <= set(FOUND):
                continue
            a, b = getattr(first, which), getattr(second, which)
            if a is not None and b is not None:
                found.append((f"{one} | {other}", a[0] <= b[1] and b[0] <= a[1]))
        return found

    @property
    def contradicted(self) -> bool | None:
        """Whether the verdict speaks against the label; None without label or decision."""
        verdict = self.answers[BASE.name].verdict
        if self.source.label is None or verdict not in (*FOUND, "healthy"):
            return None
        return (verdict in FOUND) != self.source.label


def hold(method: str, source: Source) -> Held:
    """Identify every variant of one record by a method."""
    record = source.read()
    return Held(source, {v.name: varied(method, record, v) for v in VARIANTS})


def varied(method: str, record: Record, variant: Variant) -> Answer:
    """Return what is said of one variant, frictions in the unit of the record as it is."""
    from stiction_ros.identification import IdentificationOptions, identify

    options = IdentificationOptions(method=method)
    if variant.delay is not None:
        options = dataclasses.replace(options, delay=variant.delay)
    said = answer_of(variant.applied(record), lambda changed: identify(changed, options).to_dict())
    factor = abs(variant.op[0])

    def back(interval: Interval | None) -> Interval | None:
        return None if interval is None else (interval[0] / factor, interval[1] / factor)

    return dataclasses.replace(said, f_s=back(said.f_s), f_d=back(said.f_d), band=back(said.band))


def sources(seeds: tuple[int, int] | None, folder: Path | None) -> list[Source]:
    """Return the records of a folder and the loops of the seeds.

    Raises:
        InputError: no such folder, or none of its files is a record.
    """
    found: list[Source] = []
    if folder is not None:
        if not folder.is_dir():
            raise InputError("is no folder", where=str(folder), fix="name one with --data")
        labels = _labels(folder)
        files = sorted(path for path in folder.rglob("*.csv") if path.name != INDEX)
        for path in files:
            name = str(path.relative_to(folder).with_suffix(""))
            label = labels.get(path.stem)
            if "CV_pct" in _header(path):
                found += [
                    Source(f"{name} {_pv(columns)}", path=path, columns=columns, label=False)
                    for columns in ACTUATOR
                ]
            else:
                found.append(Source(name, path=path, label=label))
        if not found:
            raise InputError("has no CSV file", where=str(folder))
    if seeds is not None:
        found += [Source(f"field {seed}", seed=seed) for seed in range(seeds[0], seeds[1] + 1)]
    return found


def _pv(columns: CsvColumns) -> str:
    assert columns.pv is not None
    return next(iter(columns.pv.values()))


def _header(path: Path) -> list[str]:
    with path.open(encoding="utf-8-sig", errors="replace", newline="") as stream:
        return next(csv.reader(stream), [])


def _labels(folder: Path) -> dict[str, bool]:
    """Return what the index files say: stem of the file to whether its valve sticks."""
    labels: dict[str, bool] = {}
    for path in folder.rglob(INDEX):
        with path.open(encoding="utf-8-sig", newline="") as stream:
            for row in csv.DictReader(stream):
                name = row.get("loop") or Path(row.get("file") or "").stem
                if name and row.get("sticky") in ("0", "1"):
                    labels[name] = row["sticky"] == "1"
    return labels


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option of this benchmark alone."""
    group = parser.add_argument_group("stability")
    group.add_argument(
        "--data",
        metavar="DIR",
        help="folder of CSV records, index.csv beside them; only these unless --seeds is given",
    )


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark."""
    folder = None if options.data is None else Path(options.data)
    seeds = options.seeds
    if seeds is None and folder is None:
        seeds = (FIRST, LAST)
    wanted = sources(seeds, folder)
    work = functools.partial(hold, options.method or METHOD)
    rows = run_each(work, wanted, options.jobs or 1, f"stability: {len(wanted)} records")
    hand_over(options.json, document(rows, machine), lambda: show(rows))
    return 0


def shares(rows: Sequence[Held]) -> list[Share]:
    """Return the totals and what is wanted of them."""
    named = [row for row in rows if row.source.label is not None]
    rates = [
        Share("turns between friction and healthy", sum(r.turned for r in rows), len(rows), "0"),
        Share("another verdict in another unit", sum(r.units_count for r in rows), len(rows), "0"),
    ]
    for which, text in (("f_s", "f_S"), ("band", "band")):
        for sure, limits in ((False, ""), (True, ", friction found in both")):
            met = [held for row in rows for _, held in row.overlaps(which, sure)]
            rates.append(
                Share(f"intervals of {text} overlap{limits}", sum(met), len(met), ">= 95 %")
            )
    against = sum(row.contradicted is True for row in named)
    agreed = sum(row.contradicted is False for row in named)
    rates.append(Share("label contradicted", against, len(named), "0"))
    rates.append(Share("label met", agreed, len(named), ""))
    return rates


def table_row(row: Held) -> dict[str, Any]:
    """Return one row of the table, with the keys that every benchmark has."""
    times = [1e3 * answer.seconds for answer in row.answers.values()]
    said = [answer.verdict for answer in row.answers.values()]
    apart = {which: _apart(row.overlaps(which, False)) for which in ("f_s", "band")}
    return {
        "case": row.source.name,
        "subject": "identify",
        "baseline": BASE.name,
        "subject_ms": float(np.median(times)),
        "baseline_ms": times[0],
        "p99_ms": float(np.percentile(times, 99)),
        "ratio": times[0] / max(float(np.median(times)), 1e-9),
        "note": "turns" if row.turned else "",
        "label": row.source.label,
        "verdict": row.answers[BASE.name].verdict,
        "verdicts": {kind: len(list(same)) for kind, same in itertools.groupby(sorted(said))},
        "turned": row.turned,
        "units_count": row.units_count,
        "apart": apart,
    }


def _apart(pairs: Iterable[tuple[str, bool]]) -> list[str]:
    return [name for name, met in pairs if not met]


def document(rows: Sequence[Held], machine: str) -> dict[str, Any]:
    """Return what ``--json`` writes: every variant of every record."""
    variants = [
        {"record": row.source.name, "variant": name} | dataclasses.asdict(answer)
        for row in rows
        for name, answer in row.answers.items()
    ]
    return {
        "name": "stability",
        "machine": machine,
        "rows": [table_row(row) for row in rows],
        "rates": [dataclasses.asdict(rate) | {"share": rate.share} for rate in shares(rows)],
        "variants": variants,
    }


def show(rows: Sequence[Held]) -> None:
    """Print every record and the totals."""
    console = Console()
    table = Table("record", "label", "verdict", "of all variants", "turns", "unit", "f_S", "band")
    for row in rows:
        line = table_row(row)
        label = {True: "sticky", False: "not", None: "–"}[row.source.label]
        told = ", ".join(f"{kind} {count}" for kind, count in line["verdicts"].items())
        apart = (str(len(line["apart"][which]) or "") for which in ("f_s", "band"))
        table.add_row(
            row.source.name,
            label,
            line["verdict"],
            told,
            "yes" if row.turned else "",
            "yes" if row.units_count else "",
            *apart,
        )
    console.print(table)
    console.print("f_S, band: how many of the variants' intervals do not overlap")
    console.print(shares_table(shares(rows)))
