"""``stiction bench identification``: our searches against the paper's methods, and their growth.

All rows of one run work on the same records, one after another in one process.
"""

import dataclasses
import time
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.identification import FitStatus, Identification, IdentificationOptions, identify
from stiction_ros.paper.grid_search import count_points
from stiction_ros.paper.methods import identify as identify_as_paper
from stiction_ros.paper.one_step_result import check_record, fit_outputs, friction_limits
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.search_log import PaperIdentification
from stiction_ros.paper.smoothed_laws import smooth_law
from stiction_ros.signals.arx_fit import ArxOrders
from stiction_studies.benches.speed.row import Row, row
from stiction_studies.examples import Example, coupled_loop, example1, example2_of_one_round

PATIENCE = 30.0  # s; a run of the exact search that took longer is not repeated
EXACT = "exact"
DEFAULT = "evidence"

EQUAL = 0.1
"""Step of a grid that is as near as the other methods in every friction parameter, %."""

Show = Callable[[float, str], None]
Progress = Callable[[float], None]


@dataclasses.dataclass(frozen=True)
class Duel:
    """One example and what the paper's methods do with it.

    Attributes:
        make: seed → example.
        title: of its rows.
        starts: M of the nonlinear programme.
        step: of the grid, %.
        order: n_a = n_b of both.
    """

    make: Callable[[int], Example]
    title: str
    starts: int
    step: float
    order: int


@dataclasses.dataclass(frozen=True)
class Plan:
    """What a run of the benchmark works through.

    Attributes:
        duels: examples on which the methods meet.
        lengths: samples N of growing records, increasing.
        valves: numbers m of valves of growing loops, the first 1.
        loop_samples: N of the growing loops.
        delay: range of delays tried in Example 1 and in its long records; None leaves the
            example's own.
        longest: records above this are left out, samples.
        repeat: runs of the exact search at a time; the median of all counts.
        seed: of all records.
        starts, grid_step, friction_limit: of the paper's methods, in place of those of the duels
            and of Δu.

    Raises:
        InputError: ``repeat`` or ``longest`` too small.
    """

    duels: tuple[Duel, ...]
    lengths: tuple[int, ...]
    valves: tuple[int, ...] = (1, 2, 3)
    loop_samples: int = 1500
    delay: tuple[int, int] | None = None
    longest: int = 100_000
    repeat: int = 3
    seed: int = 7
    starts: int | None = None
    grid_step: float | None = None
    friction_limit: float | tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if self.repeat < 1:
            raise InputError(f"{self.repeat} runs give no median", where="--repeat", fix="use 1")
        if self.seed < 0:
            raise InputError(f"{self.seed} is negative", where="--seed", fix="use 0 or more")
        if self.longest < self.lengths[0]:
            raise InputError(
                f"{self.longest} samples are below the shortest record",
                where="--longest",
                fix=f"use {self.lengths[0]} or more",
            )


LENGTHS = (2500, 5000, 10_000, 25_000, 50_000, 100_000)
FULL = Plan(
    duels=(
        Duel(example1, "Example 1", 7, 0.1, 3),
        Duel(example2_of_one_round, "Example 2, one round", 5, 1.0, 5),
    ),
    lengths=LENGTHS,
)
QUICK = Plan(
    duels=(
        Duel(example1, "Example 1", 1, 0.5, 3),
        Duel(example2_of_one_round, "Example 2, one round", 1, 2.0, 5),
    ),
    lengths=LENGTHS,
    delay=(4, 6),
    longest=10_000,
)


@dataclasses.dataclass(frozen=True)
class Timed:
    """Runs of one method on one record.

    Attributes:
        found: the answer; all runs give the same.
        times: of each run, ms.
    """

    found: Identification
    times: tuple[float, ...]

    @property
    def median(self) -> float:
        """Median time, ms."""
        return float(np.median(self.times))

    @property
    def runs(self) -> str:
        """How many runs stand behind the median."""
        return "1 run" if len(self.times) == 1 else f"median of {len(self.times)} runs"


class _Stages:
    """The bar of the whole run, an equal share for every timed method."""

    def __init__(self, show: Show, count: int) -> None:
        self._show, self._count, self._done = show, count, -1

    def begin(self, text: str) -> Progress:
        """Return the progress of the next stage."""
        self._done += 1
        done = self._done
        return lambda share: self._show((done + share) / self._count, text)


def identification(plan: Plan, show: Show) -> list[Row]:
    """Return all rows.

    Args:
        plan: what to work through.
        show: called with the share done, 0 to 1, and what is being done.
    """
    from stiction_ros.identification.warm_up import compile_loops

    show(0.0, "compiling")
    compile_loops((EXACT, DEFAULT))
    lengths = [n for n in plan.lengths if n <= plan.longest]
    stages = _Stages(show, 6 * len(plan.duels) + len(lengths) + len(plan.valves))
    rows = []
    for duel in plan.duels:
        rows += fight(plan, duel, stages.begin)
    rows += grow_samples(plan, lengths, stages.begin)
    rows += grow_valves(plan, stages.begin)
    return rows


def fight(plan: Plan, duel: Duel, begin: Callable[[str], Progress]) -> list[Row]:
    """Return the rows of one example: our two searches against the paper's two, run in full.

    The speed of a machine drifts in a minute, so exact runs before, between and after the others;
    the default search, by evidence, runs after the grid.
    """
    example = duel.make(plan.seed)
    if example.name == "example1":
        example = _narrowed(example, plan.delay)
    record, options = example.record, example.options
    orders = {"output_order": duel.order, "input_order": duel.order}
    shared = {**orders, "friction_limit": plan.friction_limit}
    nlp_options = PaperOptions.of(options, "nlp", **shared, starts=plan.starts or duel.starts)
    step = plan.grid_step or duel.step
    grid_options = PaperOptions.of(options, "grid", **shared, grid_step=step)
    before = timed(example, options, plan.repeat, begin(f"{duel.title}: exact"))
    nlp = timed(example, nlp_options, 1, begin(f"{duel.title}: nlp"))
    between = timed(example, options, plan.repeat, begin(f"{duel.title}: exact"))
    grid = timed(example, grid_options, 1, begin(f"{duel.title}: grid"))
    after = timed(example, options, plan.repeat, begin(f"{duel.title}: exact"))
    by_evidence = dataclasses.replace(options, method=DEFAULT)
    default = timed(example, by_evidence, plan.repeat, begin(f"{duel.title}: {DEFAULT}"))
    exact = Timed(before.found, before.times + between.times + after.times)
    scale = check_record(record, nlp_options)
    low, high = options.delay
    case = f"{duel.title}, N = {len(record)}, delay {low} to {high}"
    told = {
        one.found.method: _answer(example, one.found, scale) for one in (exact, default, nlp, grid)
    }
    limits = ", ".join(f"{limit:.3g}" for limit in friction_limits(record, nlp_options))
    assert isinstance(nlp.found, PaperIdentification)
    log = nlp.found.search
    end = f"f_max {limits} %, SE with n_a = n_b = {duel.order}"
    points = count_points(record, grid_options)
    fine = count_points(record, dataclasses.replace(grid_options, grid_step=EQUAL))
    as_near = Timed(grid.found, tuple(fine / points * time for time in grid.times))
    rivals = [
        (
            f"paper's NLP, M = {nlp_options.starts}",
            nlp,
            f"{len(log.starts)} solves, {log.capped} of them ended at their limit of iterations",
        ),
        (f"paper's grid, step {step:g} %", grid, f"{points} points, all of them worked through"),
    ]
    if step > EQUAL:
        said = f"{fine} points at the cost of one of the {points} that were worked through"
        rivals.append((f"paper's grid, step {EQUAL:g} %", as_near, said))
    return [
        row(
            case,
            (mine.found.method, name),
            mine.times,
            one.times,
            f"{told[mine.found.method]} ({mine.runs}); {told[one.found.method]}; {note}; {end}",
        )
        for mine in (exact, default)
        for name, one, note in rivals
    ]


def grow_samples(plan: Plan, lengths: Sequence[int], begin: Callable[[str], Progress]) -> list[Row]:
    """Return the rows of longer and longer heads of one record of Example 1's loop."""
    example = _narrowed(example1(plan.seed, samples=lengths[-1]), plan.delay)
    low, high = example.options.delay
    rows: list[Row] = []
    for count in lengths:
        part = dataclasses.replace(example, record=example.record.part(0, count))
        exact = timed(part, part.options, plan.repeat, begin(f"N = {count}: exact"))
        base = rows[0].subject_ms if rows else exact.median
        note = f"{exact.median / 1e3:.3g} s ({exact.runs}); {_friction(exact.found)}"
        left = [n for n in plan.lengths if n > count]
        if count == lengths[-1] and left:
            note += f"; N = {', '.join(map(str, left))} left out"
        names = (EXACT, f"N = {lengths[0]}, scaled")
        case = f"N = {count}, delay {low} to {high}"
        rows.append(row(case, names, exact.times, [base * (count / lengths[0])], note))
    return rows


def grow_valves(plan: Plan, begin: Callable[[str], Progress]) -> list[Row]:
    """Return the rows of loops of more and more valves, with as many outputs."""
    rows: list[Row] = []
    for count in plan.valves:
        example = coupled_loop(plan.seed, count, plan.loop_samples)
        exact = timed(example, example.options, plan.repeat, begin(f"m = {count}: exact"))
        base = rows[0].subject_ms if rows else exact.median
        true = ", ".join(
            "{} {:g}/{:g}".format(tag, *example.friction(tag)) for tag in example.record.valves
        )
        note = (
            f"p = {count}, N = {len(example.record)}, delays sought: {count**2}; "
            f"{exact.median / 1e3:.3g} s ({exact.runs}); {_friction(exact.found)} (true {true})"
        )
        names = (EXACT, "m = 1, scaled")
        rows.append(row(f"m = {count}", names, exact.times, [base * count], note))
    return rows


def timed(
    example: Example, options: IdentificationOptions | PaperOptions, repeat: int, progress: Progress
) -> Timed:
    """Identify ``repeat`` times, or fewer where one run takes longer than ``PATIENCE``.

    Args:
        example: whose record is identified.
        options: method and its options.
        repeat: wanted runs, 1 or more.
        progress: of all runs together, 0 to 1.
    """
    times: list[float] = []
    while True:
        begun = time.perf_counter()
        share = _part(progress, len(times), repeat)
        if isinstance(options, IdentificationOptions):
            found = identify(example.record, options, share)
        else:
            found = identify_as_paper(example.record, options, share)
        seconds = time.perf_counter() - begun
        times.append(seconds * 1e3)
        if len(times) == repeat or seconds > PATIENCE:
            return Timed(found, tuple(times))


def _part(progress: Progress, done: int, count: int) -> Progress:
    """Return the progress of one of ``count`` runs."""
    return lambda share: progress((done + share) / count)


def _narrowed(example: Example, delay: tuple[int, int] | None) -> Example:
    if delay is None:
        return example
    return dataclasses.replace(example, options=dataclasses.replace(example.options, delay=delay))


def _answer(example: Example, found: Identification, orders: ArxOrders) -> str:
    """Return friction, delays and SE (12a) of an answer under He's law at common orders."""
    record = example.record
    friction = np.array([[v.static_friction, v.dynamic_friction] for v in found.valves])
    delays = tuple(tuple(output.delay[tag] for tag in record.valves) for output in found.outputs)
    stems = smooth_law("he").hard_stems(record.op, friction)
    error = fit_outputs(record.pv, stems, delays, orders).squared_error
    flat = sorted({delay for line in delays for delay in line})
    told = ", ".join(map(str, flat)) if len(flat) == 1 else str([list(line) for line in delays])
    return f"{found.method}: {_friction(found)}, delay {told}, SE {error:.6g}"


def _friction(found: Identification) -> str:
    """Return f_S/f_D of every valve, and what is wrong with the answer, if anything."""
    text = "f_S/f_D " + ", ".join(
        f"{v.name} {v.static_friction:.3f}/{v.dynamic_friction:.3f}" for v in found.valves
    )
    return text if found.status is FitStatus.OK else f"{text} ({found.status}: {found.reason})"
