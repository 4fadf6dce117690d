"""The page of the Example 2 study: Figure 6 with two more columns, and its table."""

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.pages.frame import framed, text
from stiction_ros.pages.plot import SCRIPT, Curve, over_time
from stiction_ros.paper.controllers.weights import ProgrammeCost
from stiction_ros.report.page import Cell, number, table
from stiction_ros.report.run.story import TANK_UNITS
from stiction_studies.examples.control_study import COLUMNS, StudyOptions, Trial
from stiction_studies.pages.control_scores import ColumnScore, mean_score, score_trial

PLANT_TITLES = {"tank": "the nonlinear tank (A.1)", "linear": "the linear plant (A.3)"}
CONTROLLERS = ("op", "free", "pv", "stem", "ink")  # colours, in the order of COLUMNS


@dataclasses.dataclass(frozen=True)
class PlantStudy:
    """All seeds on one plant.

    Attributes:
        options: what was compared.
        trial: of the first seed, which is drawn.
        scores: one mapping by column key for each seed.
        seeds: in order.
    """

    options: StudyOptions
    trial: Trial
    scores: tuple[Mapping[str, ColumnScore], ...]
    seeds: tuple[int, ...]

    @classmethod
    def of(cls, trials: Sequence[Trial]) -> "PlantStudy":
        """Score ``trials`` of one plant."""
        scores = tuple(score_trial(trial) for trial in trials)
        return cls(trials[0].options, trials[0], scores, tuple(trial.seed for trial in trials))

    @property
    def sticky(self) -> tuple[str, ...]:
        """Tags of the valves with friction."""
        return self.trial.sticky

    def means(self) -> dict[str, ColumnScore]:
        """Return the mean over the seeds by column key."""
        return {c.key: mean_score([score[c.key] for score in self.scores]) for c in COLUMNS}

    def to_dict(self) -> dict[str, Any]:
        """Return options, means and the figures of every seed."""
        return {
            "options": dataclasses.asdict(self.options),
            "seeds": list(self.seeds),
            "columns": {
                column.key: {
                    "title": column.title,
                    "mean": self.means()[column.key].to_dict(),
                    "by_seed": [score[column.key].to_dict() for score in self.scores],
                }
                for column in COLUMNS
            },
        }


_WORK = ("", "travel", "moves", "turns", "OP step")
HEAD = ("", "PV", "IAE", "ISE", "offset", "cycle", *_WORK, "ms", "p99")


def rows_of(study: PlantStudy, *, short: bool = False) -> list[list[str]]:
    """Return the table: two rows per controller, each with an output and a valve.

    ``short`` takes the short names of the controllers.
    """
    rows = []
    for column in COLUMNS:
        mean = study.means()[column.key]
        sticky = study.sticky if column.sticky else ()
        head = column.short if short else column.title
        times = [number(mean.median_ms, 2), number(mean.p99_ms, 2)]
        pairs = zip(mean.outputs.items(), mean.valves.items(), strict=True)
        for (tag, score), (valve, moved) in pairs:
            moves = [number(n) for n in (moved.moves, moved.reversals)]
            if valve not in sticky:
                moves = ["–", "–"]
            sums = [number(score.iae), number(score.ise)]
            errors = [number(score.offset, 2), number(score.amplitude, 2)]
            work = [number(moved.travel), *moves, number(moved.op_step)]
            figures = [*sums, *errors, valve, *work, *times]
            rows.append([head, tag, *figures])
            head, times = "", ["", ""]
    return rows


def report_study(studies: Sequence[PlantStudy], directory: Path) -> Path:
    """Write ``compare.html`` and return it."""
    parts = [
        "<h1>Example 2: three formulations of the paper, one exact, one without friction</h1>",
        f'<p class="soft">{text(describe(studies[0]))}</p>',
    ]
    for study in studies:
        title = PLANT_TITLES[study.options.plant]
        rows: list[list[Cell]] = [list(row) for row in rows_of(study)]
        parts += [
            f"<h2>{text(title[0].upper() + title[1:])}</h2>",
            table(HEAD, rows, texts=2),
            f"<p>{text(_choices(study))}</p>",
            figures_of(study),
        ]
    parts.append(f'<p class="soft">{text(_NOTE)}</p>')
    target = directory / "compare.html"
    page_text = framed("Example 2: controllers compared", parts, SCRIPT)
    target.write_text(page_text, encoding="utf-8")
    return target


_NOTE = (
    "Means over the seeds. IAE, ISE (minutes), offset and cycle are those of the noise-free "
    "outputs; cycle is the amplitude of the spectral line at the period of the unaware "
    "controller's cycle, a dash where that has none. Travel of the stem in %, moves and turns of "
    "a stem that sticks; OP step: the largest move of OP from one sample to the next, %. True "
    "friction: f_S = 8 and f_D = 1 on V1; controllers know it unless said. Times are of this "
    "machine and this run."
)


def describe(study: PlantStudy) -> str:
    """Return what was run, in a line."""
    options = study.options
    seeds = f"seed {study.seeds[0]}"
    if len(study.seeds) > 1:
        seeds = f"seeds {study.seeds[0]} to {study.seeds[-1]}"
    moves = "set-points of the scenario"
    if options.schedule == "held-out":
        moves = f"held-out set-points, a move every {options.hold} min"
    told = [
        seeds,
        moves,
        f"weights of SU and SI: {options.preset.value}",
        f"warm start of SE as printed: {options.warm_start.value}",
    ]
    if options.programme_cost is not ProgrammeCost.REVISED:
        told.append(f"its cost: {options.programme_cost.value}")
    if options.law != "he":
        told.append(f"law of the valve: {options.law}")
    if options.known is not None:
        pairs = ", ".join(f"{static:g} / {dynamic:g}" for static, dynamic in options.known)
        told.append(f"controllers take f_S / f_D for {pairs} %")
    return "; ".join(told)


def figures_of(study: PlantStudy) -> str:
    """Return each output under all controllers, then OP and stem of each valve that sticks."""
    trial = study.trial
    runs = [(column.title, trial.runs[column.key].run) for column in COLUMNS]
    record = runs[0][1].record
    assert record.sp is not None
    drawn = []
    for i, tag in enumerate(record.outputs):
        curves = [
            Curve(title, kind, run.pv_clean[:, i])
            for (title, run), kind in zip(runs, CONTROLLERS, strict=True)
        ]
        curves.append(Curve("SP", "sp", record.sp[:, i], steps=True))
        drawn.append(over_time(f"{tag} without noise.", record.time, curves, _axis(tag)))
    for tag in trial.sticky:
        j = record.valves.index(tag)
        for title, run in runs:
            assert run.record.stem is not None
            curves = [
                Curve("OP", "op", run.record.op[:, j], steps=True),
                Curve("stem", "stem", run.record.stem[:, j], steps=True),
            ]
            drawn.append(over_time(f"{tag} under {title}.", record.time, curves, f"{tag} (%)"))
    return (
        f"<p>Seed {trial.seed}: all controllers have the same noise and the same set-points.</p>"
        + "".join(drawn)
    )


def _axis(tag: str) -> str:
    return f"{tag} ({TANK_UNITS[tag]})"


def _choices(study: PlantStudy) -> str:
    share = study.means()["printed"].from_warm_start
    return (
        f"SE as printed: IPOPT's answer was applied in {100 * (1 - share):.1f} % of the steps, "
        f"its warm start, cheaper under the hard model, in {100 * share:.1f} %."
    )
