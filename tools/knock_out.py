"""What each provider of seeds is worth: the search by evidence without it, over many records.

    python tools/knock_out.py --seeds 5:395:12

A record counts as lost where the best −2 log likelihood of any rate ends more than 5 (15) above
the best that any row of the table has found there. Seconds are of CPU, a record.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator

import numpy as np

from stiction_ros.examples.paper import example1, example2
from stiction_ros.field import field_loop
from stiction_ros.identification.evidence.rates import looks
from stiction_ros.identification.evidence.search import Provider
from stiction_ros.identification.options import IdentificationOptions
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record

LOST = (5.0, 15.0)
EXAMPLE_SEEDS = (3, 4, 5, 7)


def records(seeds: range) -> Iterator[tuple[str, Record]]:
    """Yield the group and the record of every loop."""
    for seed in seeds:
        yield "field", longest_part([field_loop(seed).record])
    for seed in EXAMPLE_SEEDS:
        yield "Example 1", example1(seed).record
        yield "Example 2", example2(seed).record


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", default="5:395:12", help="of field loops, A:B:STEP")
    seeds = range(*map(int, parser.parse_args().seeds.split(":")))
    rows: dict[str, tuple[Provider, ...]] = {"all three": tuple(Provider)}
    rows |= {f"without {out}": tuple(p for p in Provider if p is not out) for out in Provider}
    ends: dict[str, dict[str, list[float]]] = {}
    spent: dict[str, dict[str, float]] = {}
    for group, record in records(seeds):
        found, seconds = [], []
        for providers in rows.values():
            begun = time.process_time()
            told = looks(record, IdentificationOptions(), providers)
            seconds.append(time.process_time() - begun)
            found.append([look.found.best.loss for look in told])
        above = (np.array(found) - np.min(found, axis=0)).max(axis=1)
        for name, worst, used in zip(rows, above, seconds, strict=True):
            ends.setdefault(group, {}).setdefault(name, []).append(float(worst))
            spent.setdefault(group, {}).setdefault(name, 0.0)
            spent[group][name] += used
    print("| records | seeds from | lost by 5 | by 15 | s |\n|---|---|---|---|---|")
    for group, told_of in ends.items():
        for name, worst_of in told_of.items():
            counts = " | ".join(str(sum(one > limit for one in worst_of)) for limit in LOST)
            each = spent[group][name] / len(worst_of)
            print(f"| {group}, {len(worst_of)} | {name} | {counts} | {each:.2f} |")


if __name__ == "__main__":
    main()
