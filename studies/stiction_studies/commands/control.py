"""``stiction study-control``: the exact embedding on the tank when something is not as known."""

import argparse
import dataclasses
import functools
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.errors import InputError
from stiction_ros.signals.holds import holds
from stiction_studies.commands import choices
from stiction_studies.seeds import add_jobs, add_seeds, run_seeds

if TYPE_CHECKING:
    from stiction_studies.examples.control_cases import ControlOutcome

OFFSET_LIMITS = (0.006, 0.02)  # kg/m³, °C
WIDTH = 118  # characters that the table needs
WORK = ("moves", "travel", "reversals")
CYCLE_LIMIT = 0.15  # of the amplitude that the unaware controller leaves


@dataclasses.dataclass(frozen=True)
class CaseScores:
    """One case over all seeds; outputs C and T in this order."""

    case: str  # its name
    iae_ratio: tuple[float, float]  # mean IAE over that of the stiction-free loop
    iae_limit: float | None  # what is asked for, or None
    offset: tuple[float, float]  # mean |error| at the end of the holds, in kg/m³ and °C
    # amplitude at the period of the unaware controller's cycle, as a share of its
    cycle: tuple[float, float]
    late_turns: int  # most turns of a stem in the last 60 samples of a hold
    moves: float  # moves, travel, reversals: of the sticky stems in a run, means; travel in %
    travel: float
    reversals: float
    # travel_ratio, moves_ratio: the first two over those of the unaware controller
    travel_ratio: float
    moves_ratio: float
    op_step: float  # largest move of OP from one sample to the next, %

    @property
    def met(self) -> bool:
        """Whether all that is asked for holds."""
        near = all(o <= limit for o, limit in zip(self.offset, OFFSET_LIMITS, strict=True))
        still = max(self.cycle) <= CYCLE_LIMIT
        return near and still and (self.iae_limit is None or max(self.iae_ratio) <= self.iae_limit)


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "study-control",
        description="Run the tank of Example 2 under the exact embedding on set-points that no "
        "tuning has seen, with right and wrong friction, unmeasured steps and two sticky valves, "
        "and compare the noise-free outputs with the loop without stiction. Exit code 1 when a "
        "case misses what is asked of it.",
    )
    add_seeds(parser, 101, 110)
    known = ", ".join(choices.CONTROL_CASES)
    parser.add_argument("--cases", metavar="A,B", help=f"some of {known}")
    add_jobs(parser)
    parser.add_argument("--json", metavar="F", help="write the scores; - for stdout")
    parser.set_defaults(run=run)


Runs: TypeAlias = (
    "tuple[ControlOutcome, ControlOutcome, ControlOutcome]"  # embedding, stiction-free, unaware
)


def run_seed(names: tuple[str, ...], seed: int) -> dict[str, Runs]:
    """Run one seed of every case; a plain function, so that a worker process can run it."""
    from stiction_studies.examples.control_cases import CASES, run_case, run_reference, run_unaware

    free: dict[object, ControlOutcome] = {}
    unaware: dict[object, ControlOutcome] = {}
    found = {}
    for name in names:
        case = CASES[name]
        # Many cases share what they are compared with.
        reference, cycle = (case.upset, case.own_weights), (case.upset, str(case.true))
        if reference not in free:
            free[reference] = run_reference(case, seed)
        if cycle not in unaware:
            unaware[cycle] = run_unaware(case, seed)
        found[name] = (run_case(case, seed), free[reference], unaware[cycle])
    return found


def scores(name: str, runs: list[Runs]) -> CaseScores:
    """Return the scores of the case ``name`` over ``runs``, one entry per seed."""
    from stiction_ros.signals.oscillation import amplitude, dominant_cycle
    from stiction_studies.examples.control_cases import CASES

    cycles = []
    for embedding, _, unaware in runs:
        stretches = holds(unaware.sp)
        found = dominant_cycle(unaware.error, stretches)
        if found is None:
            continue
        pair = [
            [amplitude(one.error[:, i], stretches, found.period) or 0.0 for i in range(2)]
            for one in (embedding, unaware)
        ]
        cycles.append(np.array(pair[0]) / np.maximum(pair[1], 1e-12))
    after, free = (np.mean([r[i].iae for r in runs], axis=0) for i in (0, 1))
    moves, travel, turns = (float(np.mean([getattr(r[0], key) for r in runs])) for key in WORK)
    before = [float(np.mean([getattr(r[2], key) for r in runs])) for key in WORK]
    return CaseScores(
        name,
        _pair(after / free),
        CASES[name].limit,
        _pair(np.mean([r[0].offset for r in runs], axis=0)),
        _pair(np.mean(cycles, axis=0)) if cycles else (0.0, 0.0),
        max(r[0].late_turns for r in runs),
        moves,
        travel,
        turns,
        travel / before[1],
        moves / before[0],
        max(r[0].op_step for r in runs),
    )


def _pair(values: Any) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    names = choices.CONTROL_CASES if options.cases is None else tuple(options.cases.split(","))
    for name in names:
        if name not in choices.CONTROL_CASES:
            known = ", ".join(choices.CONTROL_CASES)
            raise InputError(f"no case {name!r}", where="--cases", fix=f"use {known}")
    work = functools.partial(run_seed, names)
    seeds = run_seeds(work, options.seeds, options.jobs, "tank")
    found = [scores(name, [seed[name] for seed in seeds]) for name in names]
    hand_over(
        options.json,
        [{**dataclasses.asdict(s), "met": s.met} for s in found],
        lambda: _print(found, options.seeds),
    )
    return 0 if all(score.met for score in found) else 1


def _print(found: list[CaseScores], seeds: tuple[int, int]) -> None:
    table = Table(title=f"tank, seeds {seeds[0]} to {seeds[1]}, C and T", title_justify="left")
    table.add_column("case", no_wrap=True)
    heads = ("IAE ratio", "asked", "offset", "cycle", "late turns", "moves", "turns")
    for name in (*heads, "travel", "/ unaware", "OP step"):
        table.add_column(name, justify="right")
    table.add_column("met")
    for s in found:
        table.add_row(
            s.case,
            " ".join(f"{v:.2f}" for v in s.iae_ratio),
            "" if s.iae_limit is None else f"{s.iae_limit:g}",
            " ".join(f"{v:.4f}" for v in s.offset),
            " ".join(f"{v:.2f}" for v in s.cycle),
            str(s.late_turns),
            f"{s.moves:.0f}",
            f"{s.reversals:.0f}",
            f"{s.travel:.0f}",
            f"{s.travel_ratio:.2f}",
            f"{s.op_step:.0f}",
            "yes" if s.met else "no",
        )
    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(table)
