"""What each part of the search by evidence is worth: found, wrong and seconds without it.

    python tools/knock_out.py --seeds 0:479 --examples 0:9 --jobs 2 --log knock_out.jsonl

A record counts as lost where the best −2 log likelihood of any rate ends more than 15 above the
best that any row has found there; parts that change what is judged have no such figure. Found are
valves with friction (those of the field with six slips or more) that are called sticky or backlash;
wrong are these called healthy, and healthy ones in which friction is found. Seconds are of CPU, a
record, from its rates to the answer. ``--log`` goes on where it was broken off.
"""

import argparse
import dataclasses
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.cli.shared.searches import MANY
from stiction_ros.identification.evidence.engine import answered
from stiction_ros.identification.evidence.rates import liveliest, looks
from stiction_ros.identification.evidence.search import ALL, Parts
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.problem.preparation import prepare
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record
from stiction_studies.examples.paper import example1, example2
from stiction_studies.field import field_loop
from stiction_studies.seeds import add_jobs, run_each, seed_range

LOST = 15.0
JUDGED = ("waves", "tuning")  # parts that change what is judged
STICKY, HEALTHY, FEW = "friction", "no friction", "fewer slips"
ROWS: Mapping[str, Parts] = {"all": ALL} | {
    f"without {part.name}": dataclasses.replace(ALL, **{part.name: False})
    for part in dataclasses.fields(Parts)
}
Case = tuple[str, int]


def case_of(group: str, seed: int) -> tuple[Record, str]:
    """Return a record and what is true of its valves."""
    if group == "field":
        loop = field_loop(seed)
        healthy = loop.truth.valve.value == "healthy"
        truth = HEALTHY if healthy else STICKY if loop.judged_slips >= MANY else FEW
        return longest_part([loop.record]), truth
    return (example1 if group == "Example 1" else example2)(seed).record, STICKY


def judged(case: Case) -> dict[str, Any]:
    """Return what every row of the table says of one record."""
    record, truth = case_of(*case)
    options, rows = IdentificationOptions(), {}
    for name, parts in ROWS.items():
        begun = time.process_time()
        data, part = prepare(record, options), liveliest(record)
        seen = looks(part, options, parts)
        found = answered(record, data, part, seen, options)
        rows[name] = {
            "verdicts": [valve.verdict.value for valve in found.valves],
            "losses": [look.found.best.loss for look in seen],
            "seconds": time.process_time() - begun,
        }
    return {"case": list(case), "truth": truth, "rows": rows}


def kept(log: Path, case: Case) -> dict[str, Any]:
    """Do one record and keep what is said of it."""
    done = judged(case)
    with log.open("a", encoding="utf-8") as file:
        file.write(json.dumps(done) + "\n")
    return done


def tables(done: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| records | search | lost | found | wrong | undecided | s |"
    yield "|---|---|---|---|---|---|---|"
    groups = dict.fromkeys((one["case"][0], one["truth"]) for one in done)
    for group, truth in groups:
        records = [one for one in done if (one["case"][0], one["truth"]) == (group, truth)]
        for name in ROWS:
            rows = [one["rows"][name] for one in records]
            lost = sum(_lost(one["rows"], name) for one in records) if _comparable(name) else ""
            told = [verdict for row in rows for verdict in row["verdicts"]]
            friction = sum(verdict in ("sticky", "backlash") for verdict in told)
            healthy, open_ = told.count("healthy"), told.count("undecided")
            found = f"{friction} of {len(told)}" if truth == STICKY else ""
            wrong = {STICKY: str(healthy), HEALTHY: str(friction), FEW: str(healthy)}[truth]
            seconds = float(np.mean([row["seconds"] for row in rows]))
            yield (
                f"| {group}, {truth}, {len(records)} | {name} | {lost} | {found} | {wrong} "
                f"| {open_} | {seconds:.2f} |"
            )


def _lost(rows: Mapping[str, Mapping[str, Any]], name: str) -> bool:
    same = [np.array(row["losses"]) for key, row in rows.items() if _comparable(key)]
    return bool((np.array(rows[name]["losses"]) - np.min(same, axis=0)).max() > LOST)


def _comparable(name: str) -> bool:
    return all(part not in name for part in JUDGED)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=seed_range, default=(0, 479), help="of field loops, A:B")
    parser.add_argument("--examples", type=seed_range, default=(0, 9), help="seeds of both, A:B")
    parser.add_argument("--log", type=Path, default=Path("knock_out.jsonl"))
    add_jobs(parser)
    told = parser.parse_args()
    cases = [("field", seed) for seed in range(told.seeds[0], told.seeds[1] + 1)]
    for group in ("Example 1", "Example 2"):
        cases += [(group, seed) for seed in range(told.examples[0], told.examples[1] + 1)]
    lines = told.log.read_text(encoding="utf-8").splitlines() if told.log.exists() else []
    done = {tuple(one["case"]): one for one in map(json.loads, lines)}
    left = [case for case in cases if case not in done]
    for one in run_each(partial(kept, told.log), left, told.jobs, "without parts"):
        done[tuple(one["case"])] = one
    print("\n".join(tables([done[case] for case in cases])))


if __name__ == "__main__":
    main()
