"""``stiction example``: loops whose truth is known, identified and compared with it."""

import argparse
import dataclasses
import functools
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from stiction_ros.cli.shared.as_json import hand_over, write_json
from stiction_ros.cli.shared.progress import bar
from stiction_ros.cli.shared.searches import add_search_options, identify_by, search_options
from stiction_ros.errors import InputError, storing
from stiction_ros.records.csv_writer import write_csv
from stiction_studies.commands import choices
from stiction_studies.commands.example_tables import print_outcome, print_study
from stiction_studies.seeds import add_jobs, run_seeds, seed_range

if TYPE_CHECKING:
    from collections.abc import Callable

    from stiction_ros.identification import Identification
    from stiction_studies.examples import Comparison, Example

NAMES = {
    "1": "example1",
    "2": "example2",
    "example1": "example1",
    "example2": "example2",
    "healthy": "healthy",
}
# Name of the example: the option that chooses its variant, and what may be chosen.
VARIANTS = {
    "example1": ("noise", choices.NOISES),
    "example2": ("plant", choices.PLANTS),
    "healthy": ("family", choices.HEALTHY),
}


@dataclasses.dataclass(frozen=True)
class Choice:
    """What to make and how to identify it."""

    name: str  # name, variant: of the example
    variant: str
    # output_order, input_order: in place of the example's own, None to keep them
    output_order: int | None = None
    input_order: int | None = None
    method: str = "exact"  # search of the identification
    samples: int | None = None  # length of the record, None for the example's own
    chosen: dict[str, Any] = dataclasses.field(default_factory=dict)  # options of that search alone

    def make(self, seed: int) -> "Example":
        """Return the example of one seed with the orders chosen."""
        from stiction_studies.examples import example1, example2, healthy_loop

        makers: dict[str, Callable[..., Example]] = {
            "example1": example1,
            "example2": example2,
            "healthy": healthy_loop,
        }
        length = {} if self.samples is None else {"samples": self.samples}
        example = makers[self.name](seed, self.variant, **length)
        changes: dict[str, Any] = {}
        if self.output_order is not None:
            changes |= {"output_order": self.output_order, "input_order": self.input_order}
        elif self.input_order is not None:
            raise InputError("needs --na as well", where="--nb")
        return dataclasses.replace(example, options=dataclasses.replace(example.options, **changes))

    def identify(self, example: "Example", progress: "Callable[[float], None]") -> "Identification":
        """Return what the search chosen finds in an example."""
        search = identify_by(self.method, example.options, self.chosen)
        return search(example.record, progress)


@dataclasses.dataclass(frozen=True)
class Outcome:
    """One seed: the example, its identification, and both side by side."""

    example: "Example"
    found: "Identification"
    comparison: "Comparison"

    def to_dict(self) -> dict[str, Any]:
        """Return one run as JSON data."""
        return {
            "example": self.example.name,
            "variant": self.example.variant,
            "seed": self.example.seed,
            **self.comparison.to_dict(),
            "identification": self.found.to_dict(),
        }


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "example",
        description="Make a record whose truth is known, identify it and print both side by "
        "side: the paper's Examples 1 and 2, or loops without friction that oscillate for "
        "another reason. With --seeds: how often the identification is right.",
    )
    parser.add_argument("name", choices=tuple(NAMES), metavar="NAME", help=", ".join(NAMES))
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="seed of the noise (1)")
    parser.add_argument(
        "--seeds", type=seed_range, metavar="A:B", help="seeds from A to B, in place of --seed"
    )
    add_jobs(parser)
    for name, (option, known) in VARIANTS.items():
        parser.add_argument(f"--{option}", choices=known, help=f"{name} (default: {known[0]})")
    parser.add_argument(
        "--samples", type=int, metavar="N", help="number of samples of example 1 (2500) or 2 (1240)"
    )
    parser.add_argument("--na", type=int, metavar="N", help="order n_a (default: the example's)")
    parser.add_argument("--nb", type=int, metavar="N", help="order n_b (default: n_a)")
    parser.add_argument(
        "--method",
        default="exact",
        choices=choices.COUNTED,
        help="method of identification (exact)",
    )
    add_search_options(parser)
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.add_argument(
        "--out", metavar="DIR", help="write record.csv, result.json and report.html there"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    choice = _choice(options)
    if options.seeds is None:
        return _run_one(choice, options)
    if options.out is not None:
        raise InputError("is for one seed", where="--out", fix="use --seed, or --json")
    return _run_many(choice, options)


def solve(choice: Choice, seed: int) -> Outcome:
    """Make, identify and compare one seed; a worker process can run it."""
    from stiction_studies.examples import compare

    example = choice.make(seed)
    found = choice.identify(example, lambda share: None)
    return Outcome(example, found, compare(example, found))


def _choice(options: argparse.Namespace) -> Choice:
    name = NAMES[options.name]
    for owner, (option, _) in VARIANTS.items():
        if owner != name and getattr(options, option) is not None:
            raise InputError(f"belongs to {owner}", where=f"--{option}", fix="leave it out")
    option, known = VARIANTS[name]
    variant = getattr(options, option) or known[0]
    if options.seed < 0:
        raise InputError(f"{options.seed} is negative", where="--seed")
    if options.samples is not None and options.samples < 1:
        raise InputError(f"{options.samples} is no length", where="--samples", fix="use 1240")
    if options.samples is not None and name == "healthy":
        raise InputError("belongs to examples 1 and 2", where="--samples", fix="leave it out")
    chosen = search_options(options)
    return Choice(name, variant, options.na, options.nb, options.method, options.samples, chosen)


def _run_one(choice: Choice, options: argparse.Namespace) -> int:
    from stiction_studies.examples import compare

    with bar(f"{choice.name}: simulating") as show:
        example = choice.make(options.seed)
        show(0.1, f"{choice.name}: identifying")
        found = choice.identify(example, lambda share: show(0.1 + 0.9 * share))
    outcome = Outcome(example, found, compare(example, found))
    hand_over(
        options.json,
        outcome.to_dict(),
        lambda: print_outcome(Console(), outcome.example, outcome.comparison, outcome.found),
    )
    if options.out is not None:
        print(f"report: {_write(outcome, Path(options.out))}", file=sys.stderr)
    return 0


def _run_many(choice: Choice, options: argparse.Namespace) -> int:
    from stiction_studies.examples import tally

    work = functools.partial(solve, choice)
    title = f"{choice.name}, {choice.variant}"
    outcomes = run_seeds(work, options.seeds, options.jobs, title)
    findings = tally(choice.name, [outcome.comparison for outcome in outcomes])
    document = {
        "example": choice.name,
        "variant": choice.variant,
        "findings": [finding.to_dict() for finding in findings],
        "runs": [outcome.to_dict() for outcome in outcomes],
    }
    rows = [(o.example.seed, o.comparison, o.found) for o in outcomes]
    hand_over(options.json, document, lambda: print_study(Console(), title, rows, findings))
    return 0


def _write(outcome: Outcome, directory: Path) -> Path:
    from stiction_studies.pages.example_report import report_example

    with storing(directory, fix="choose another --out"):
        directory.mkdir(parents=True, exist_ok=True)
        write_csv(outcome.example.record, directory / "record.csv")
        page = report_example(
            outcome.example, outcome.found, outcome.comparison, directory / "report.html"
        )
    write_json(str(directory / "result.json"), outcome.to_dict())
    return page
