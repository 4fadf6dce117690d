"""``stiction bench valve-test``: tests in manual of simulated valves, counted."""

import argparse
import dataclasses
import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.identification.valve_test.facts import LAGS, noise_over
from stiction_ros.identification.valve_test.plan import Facts
from stiction_ros.identification.valve_test.steps import SHORTEST
from stiction_ros.online.controller.valve_test import ValveTest
from stiction_ros.online.handover.hand_over import AtOnce
from stiction_studies.field.loads import coloured
from stiction_studies.field.manual_test import MOST, ManualTest, manual_test
from stiction_studies.field.truth import ValveKind
from stiction_studies.seeds import run_seeds

FIRST, LAST = 50_000, 50_299
"""Seeds when none are given; those below 1000 are for tuning."""
KNOWN_WITHIN = 0.3
"""Gain, lag and dead time are taken as known up to factors e^±.3 before the test."""
REACH = 15.0  # %: how far OP may go
ROOM = 12.0  # % of the valve: how far PV may go


@dataclasses.dataclass(frozen=True)
class Ended:
    """One valve and how its test ended."""

    seed: int  # seed to circumstances: of the valve
    kind: str
    plant: str
    law: str
    f_s: float
    circumstances: tuple[str, ...]
    # verdict, probability, interval: of the last judgement; undecided where PV met its limit before
    # the second move
    verdict: str
    probability: float
    interval: tuple[float, float]
    moves: int  # that were made
    duration: float  # in times of dead time and lag together
    beyond: float  # of PV's limit, in standard deviations of the noise
    seconds: float  # of a judgement
    ended: str  # why the test ended

    @property
    def sticks(self) -> bool:
        """Whether there is friction."""
        return self.kind != ValveKind.HEALTHY

    @property
    def decided(self) -> bool:
        """Whether there is a verdict."""
        return self.verdict != "undecided"

    @property
    def wrong(self) -> bool:
        """Whether friction was called healthy, or the other way round."""
        return self.decided and (self.verdict == "healthy") is self.sticks

    @property
    def held(self) -> bool:
        """Whether the interval holds f_S."""
        return self.interval[0] <= self.f_s <= self.interval[1]


def facts_of(case: ManualTest) -> Facts:
    """Return what is known before a test, as a routine record would tell it roughly."""
    random = np.random.default_rng([case.seed, 48])
    off = np.exp(random.uniform(-KNOWN_WITHIN, KNOWN_WITHIN, 3))
    lag = case.answer.lag if case.settles else case.time - case.answer.dead_time
    step = case.sample_time
    wanted = case.answer.dead_time * off[1] + LAGS * lag * off[0]
    samples = max(round(wanted / step), SHORTEST + 1)
    each = case.answer.gain * (1.0 if case.settles else samples * step)
    middle = case.loop.rest
    before = case.noise * coloured(random, MOST, case.colour)
    return Facts(
        valve="V1",
        op=case.op,
        pv=middle,
        gain=each * off[2],
        noise=noise_over(before, samples),
        dead=case.answer.dead_time * off[1],
        hold=samples * step,
        op_limit=REACH,
        pv_limit=(middle - ROOM * abs(each), middle + ROOM * abs(each)),
    )


def judge(seed: int) -> Ended:
    """Test the valve of a seed as a running loop does.

    PV counts until the dead time after the last move is over: what is under way comes.
    """
    case = manual_test(seed)
    facts = facts_of(case)
    hold = round(facts.hold / case.sample_time)
    late = math.ceil(case.answer.dead_time / case.sample_time) + 1
    test, op = ValveTest(facts, hold, AtOnce()), np.empty(0)
    began = time.perf_counter()
    while not test.over:
        ahead = np.append(op, np.full(hold, op[-1] if len(op) else case.op))
        for value in case.pv(ahead)[0][len(op) :].tolist():
            op = np.append(op, test.next_op(value))
            if test.over or op[-1] != ahead[len(op) - 1]:
                break
    clean = case.pv(np.append(op, np.full(late, op[-1])))[1]
    away = np.maximum(clean - facts.pv_limit[1], facts.pv_limit[0] - clean)
    found, moves = test.judgement, test.moves
    return Ended(
        seed=seed,
        kind=case.kind.value,
        plant=case.loop.process.kind,
        law=case.loop.valve.law.word if case.f_s else "ideal",
        f_s=case.f_s,
        circumstances=case.circumstances,
        verdict="undecided" if found is None else found.verdict.value,
        probability=math.nan if found is None else found.probability,
        interval=(0.0, math.inf) if found is None else found.f_s_interval,
        moves=moves,
        duration=moves * facts.hold / case.time,
        beyond=max(float(away.max()) / case.noise, 0.0),
        seconds=(time.perf_counter() - began) / max(moves - 1, 1),
        ended=test.over,
    )


def groups(rows: Sequence[Ended]) -> Mapping[str, list[Ended]]:
    """Return the rows by what they are: all, valve, law, plant, circumstance."""
    parts: dict[str, list[Ended]] = {"all": list(rows)}
    for row in rows:
        told = row.circumstances or ("nothing unusual",)
        for name in (
            "friction" if row.sticks else "no friction",
            f"law {row.law}",
            f"plant {row.plant}",
            *(f"with {one}" for one in told),
        ):
            parts.setdefault(name, []).append(row)
    return {name: parts[name] for name in sorted(parts)}


def table_row(name: str, rows: Sequence[Ended]) -> dict[str, Any]:
    """Return one row of the table, with the keys that every benchmark has."""
    found = [row for row in rows if row.sticks and row.decided and not row.wrong]
    return {
        "case": name,
        "subject": "valve-test",
        "baseline": "truth",
        "subject_ms": 1e3 * float(np.median([row.seconds for row in rows])),
        "baseline_ms": None,
        "p99_ms": None,
        "ratio": None,
        "note": "",
        "valves": len(rows),
        "decided": sum(row.decided for row in rows),
        "wrong": sum(row.wrong for row in rows),
        "held": sum(row.held for row in found),
        "found": len(found),
        "median_duration": float(np.median([row.duration for row in rows])),
        "beyond_pv_limit": max(row.beyond for row in rows),
    }


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark."""
    rows = run_seeds(judge, options.seeds or (FIRST, LAST), options.jobs or 1, "valve-test")
    table = [table_row(name, part) for name, part in groups(rows).items()]
    document = {
        "name": "valve-test",
        "machine": machine,
        "rows": table,
        "valves": [dataclasses.asdict(row) for row in rows],
    }
    hand_over(options.json, document, lambda: _show(table, rows))
    return 0


def _show(table: Sequence[Mapping[str, Any]], rows: Sequence[Ended]) -> None:
    console = Console()
    shown = Table(box=SIMPLE, padding=(0, 1, 0, 0), show_edge=False)
    for name in ("", "valves", "decided", "wrong", "f_S held", "duration", "beyond PV limit"):
        shown.add_column(name, justify="left" if not name else "right")
    for row in table:
        shown.add_row(
            row["case"],
            *(str(row[key]) for key in ("valves", "decided", "wrong")),
            f"{row['held']}/{row['found']}",
            f"{row['median_duration']:.1f}",
            f"{row['beyond_pv_limit']:.1f}",
        )
    console.print(shown)
    console.print(
        "duration: median, in times of dead time and lag; beyond PV limit: most, in standard "
        "deviations of the noise"
    )
    for title, missed in (
        ("wrong", [row.seed for row in rows if row.wrong]),
        ("undecided", [row.seed for row in rows if not row.decided]),
        ("f_S outside", [r.seed for r in rows if r.sticks and r.decided and not r.held]),
    ):
        if missed:
            console.print(f"{title}: seeds {', '.join(map(str, missed))}")
