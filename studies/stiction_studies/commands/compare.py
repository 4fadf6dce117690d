"""``stiction demo tank --compare``: Example 2 under five controllers, without ROS."""

import argparse
import functools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over, write_json
from stiction_ros.errors import InputError, storing
from stiction_studies.commands import choices
from stiction_studies.seeds import run_seeds, seed_range

if TYPE_CHECKING:
    from stiction_studies.examples.control_study import StudyOptions, Trial

LABELS = ("", "PV")  # heads of the columns of words
SEEDS = (101, 103)
OPTIONS = (
    *("plant", "seeds", "preset", "warm_start", "programme_cost", "law", "known", "schedule"),
    *("hold", "jobs", "json"),
)
FOLDER = "tank_compare"


def add_options(parser: Any) -> None:
    """Add ``--compare`` and what goes with it."""
    group = parser.add_argument_group(
        "comparison", "tank alone, simulated without ROS; results in DIR/" + FOLDER
    )
    group.add_argument(
        "--compare",
        action="store_true",
        help="Figure 6: unaware, inversion and embedding as printed, exact, no friction",
    )
    group.add_argument("--plant", choices=choices.PLANTS, help="linear is (A.3) (default: both)")
    group.add_argument(
        "--seeds", type=seed_range, metavar="A:B", help="seeds from A to B (101:103)"
    )
    group.add_argument(
        "--preset",
        choices=choices.PRESETS,
        help="weights of SU, SI and the loop without friction (own)",
    )
    group.add_argument(
        "--warm-start",
        choices=choices.WARM_STARTS,
        help="start of the embedding as printed (compensation)",
    )
    group.add_argument(
        "--programme-cost",
        choices=choices.PROGRAMME_COSTS,
        help="cost of the embedding as printed: (22), or the plain (19a) (revised)",
    )
    group.add_argument(
        "--law",
        choices=choices.PRINTED_LAWS,
        help="friction law of the sticky valve and its controllers (he)",
    )
    group.add_argument(
        "--known",
        type=frictions,
        metavar="F_S,F_D[/F_S,F_D]",
        help="friction of each valve as the controllers know it (default: the truth)",
    )
    group.add_argument(
        "--schedule", choices=choices.SCHEDULES, help="set-points drawn for each seed (held-out)"
    )
    group.add_argument("--hold", type=int, metavar="MIN", help="minutes between moves (120)")
    group.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="number of processes; to measure times take 1 (all cores)",
    )
    group.add_argument("--json", metavar="F", help="write all scores; - for stdout")


def frictions(text: str) -> tuple[tuple[float, float], ...]:
    """Return ``F_S,F_D`` of each valve, valves parted by ``/``."""
    try:
        rows = tuple(tuple(float(word) for word in row.split(",")) for row in text.split("/"))
        return tuple((static, dynamic) for static, dynamic in rows)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is no friction, write 8,1/0,0") from None


def refuse_options(options: argparse.Namespace) -> None:
    """Raise InputError when an option of the comparison was given without it."""
    for key in OPTIONS:
        if getattr(options, key) is not None:
            raise InputError(
                "belongs to the comparison",
                where=f"--{key.replace('_', '-')}",
                fix="add --compare, or leave it out",
            )


def run(options: argparse.Namespace) -> int:
    """Run the comparison."""
    _check(options)
    from stiction_studies.examples.control_study import run_trial
    from stiction_studies.examples.paper import PLANTS
    from stiction_studies.pages.control_report import PlantStudy, report_study

    directory = Path(options.out) / FOLDER
    _make(directory)
    studies = []
    for plant in PLANTS[::-1] if options.plant is None else (options.plant,):
        work = functools.partial(run_trial, _study(options, plant))
        seeds = options.seeds or SEEDS
        jobs = os.cpu_count() or 1 if options.jobs is None else options.jobs
        trials: list[Trial] = run_seeds(work, seeds, jobs, f"compare on {plant}")
        studies.append(PlantStudy.of(trials))
    page = report_study(studies, directory)
    document = {study.options.plant: study.to_dict() for study in studies}
    write_json(str(directory / "compare.json"), document)
    hand_over(options.json, document, lambda: _print(studies, page))
    return 0


def _study(options: argparse.Namespace, plant: str) -> "StudyOptions":
    from stiction_ros.paper.controllers.weights import ProgrammeCost, WarmStart, WeightPreset
    from stiction_studies.examples.control_study import StudyOptions

    chosen: dict[str, Any] = {
        "preset": WeightPreset(options.preset or WeightPreset.OWN),
        "warm_start": WarmStart(options.warm_start or WarmStart.COMPENSATION),
        "programme_cost": ProgrammeCost(options.programme_cost or ProgrammeCost.REVISED),
        "law": options.law,
        "known": options.known,
        "schedule": options.schedule,
        "hold": options.hold,
    }
    return StudyOptions(plant, **{key: value for key, value in chosen.items() if value is not None})


def _check(options: argparse.Namespace) -> None:
    if options.scenario not in ([], ["tank"]):
        raise InputError(
            "the comparison is of Example 2 alone", where="--compare", fix="use scenario tank"
        )
    for key in ("seed", "speed"):
        if getattr(options, key) is not None:
            raise InputError(
                "has no meaning for the comparison",
                where=f"--{key}",
                fix="use --seeds A:B" if key == "seed" else "leave it out",
            )
    if options.hold is not None and options.schedule == "scenario":
        raise InputError(
            "the scenario has its own times", where="--hold", fix="use --schedule held-out"
        )


def _make(directory: Path) -> None:
    with storing(directory, what="made"):
        directory.mkdir(parents=True, exist_ok=True)


def _print(studies: Sequence[Any], page: Path) -> None:
    from stiction_studies.pages.control_report import HEAD, PLANT_TITLES, describe, rows_of

    console = Console()
    for study in studies:
        title: str | None = f"{PLANT_TITLES[study.options.plant]}: {describe(study)}"
        rows = rows_of(study, short=True)
        for columns in _parts(HEAD, rows, console.width):
            shown = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1))
            for column in columns:
                label = HEAD[column] in LABELS
                side: Literal["left", "right"] = "left" if label else "right"
                shown.add_column(HEAD[column], justify=side, no_wrap=True)
            for row in rows:
                shown.add_row(*(row[column] for column in columns))
            console.print(shown)
            title = None
    console.print(f"{page}")


def _parts(head: Sequence[str], rows: Sequence[Sequence[str]], width: int) -> list[list[int]]:
    """Return the columns of one table, or of one on outputs and one on valves where it is wide."""
    wide = sum(2 + max(len(row[k]) for row in (head, *rows)) for k in range(len(head)))
    if wide <= width:
        return [list(range(len(head)))]
    valve = head.index("", 1)
    return [list(range(valve)), [0, *range(valve, len(head))]]
