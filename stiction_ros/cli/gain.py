"""``stiction gain``: what would help a loop, simulated."""

import argparse
from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.cli.shared.searches import add_law
from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.gain.advice import MEASURES, advice
from stiction_ros.loop import LoopModel
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.texts import probability


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "gain",
        description="Simulate what would help a loop: a serviced valve, a controller that knows "
        "the friction, another tuning, or nothing. A record is identified first and the "
        "controller of the record is the baseline; a model needs a controller of its own.",
    )
    text = "CSV file, other export, bag, or *.loop.yaml"
    intake.add_record(parser, text, "RECORD|MODEL")
    add_law(parser)
    parser.add_argument(
        "--valve",
        metavar="TAG",
        help="the valve, where there are several (default: that with the widest band)",
    )
    parser.add_argument("--set-points", metavar="F", help="schedule of set-points, with a model")
    parser.add_argument(
        "--samples", type=int, metavar="N", help="number of samples of a run, with a model (2000)"
    )
    parser.add_argument("--json", metavar="F", help="write the result as JSON; - for stdout")
    parser.set_defaults(run=run, law=None)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    # Simulating takes compiled code, which other commands do not wait for.
    from stiction_ros.gain.gain import Gain

    found: Gain
    verdict: dict[str, Any] = {}
    if intake.is_model(options.record):
        found = _of_model(options)
    else:
        found, verdict = _of_record(options)
    document = {"record": str(options.record)} | verdict | found.to_dict()
    hand_over(options.json, document, lambda: show(found, verdict))
    return 0


def _of_model(options: argparse.Namespace) -> Any:
    from stiction_ros.gain.model_gain import SAMPLES, gain_of_model

    if options.law is not None:
        raise InputError("a model brings its own", where="--law", fix="leave it out")
    model = LoopModel.load(find_config(options.record))
    schedule = None
    if options.set_points is not None:
        schedule = SetPoints.load(find_config(options.set_points), model.outputs)
    samples = SAMPLES if options.samples is None else options.samples
    if samples < 100:
        raise InputError(f"{samples} is too few", where="--samples", fix="use 100 or more")
    with bar("simulating"):
        return gain_of_model(model, schedule, samples)


def _of_record(options: argparse.Namespace) -> tuple[Any, dict[str, Any]]:
    """Return what would help, and what was found of the valve that it would help."""
    from stiction_ros.gain.gain import gain_of
    from stiction_ros.identification import IdentificationOptions, identify
    from stiction_ros.records.parts import longest_part

    for key in ("set_points", "samples"):
        if getattr(options, key) is not None:
            raise InputError(
                "a record brings its own", where=f"--{key.replace('_', '-')}", fix="leave it out"
            )
    loop = intake.opened(options)
    intake.tell(loop)
    record = longest_part(loop.parts)
    settings = IdentificationOptions(law=options.law or IdentificationOptions.law)
    with bar("identifying") as show_share:
        identified = identify(record, settings, show_share)
    with bar("simulating"):
        gain = gain_of(record, identified, options.valve)
    valve = identified.valves[record.valves.index(gain.valve)].to_dict()
    keys = ("verdict", "probability", "law", "f_s", "f_s_interval", "f_d", "f_d_interval")
    return gain, {key: valve[key] for key in keys}


def show(found: Any, verdict: Mapping[str, Any]) -> None:
    """Print the ``verdict`` on the valve, what each option brings and its interval."""
    console = Console()
    console.print(_headline(found, verdict), highlight=False)
    table = Table()
    for name in ("option", "measure", "now", "then", "90 % of the simulated loops"):
        table.add_column(name)
    for option in found.options:
        for row in _rows(found.now, option):
            table.add_row(*row)
        table.add_section()
    console.print(table)
    console.print(
        "now: as recorded; then: simulated; –: not promised. Amplitude and |PV−SP| in PV units, "
        "travel in %."
    )
    for option in found.options:
        console.print(f"{option.what}: {option.note}", highlight=False)
    console.print(advice(found.to_dict()), highlight=False)


def _headline(found: Any, verdict: Mapping[str, Any]) -> str:
    said = f"{found.valve} and {found.output}"
    if not verdict:
        return said
    (low, high), (least, most) = verdict["f_s_interval"], verdict["f_d_interval"]
    said += (
        f": {verdict['verdict']}, f_S {verdict['f_s']:.2f} % ({low:.2f} to {high:.2f}), "
        f"f_D {verdict['f_d']:.2f} % ({least:.2f} to {most:.2f})"
    )
    if chance := probability(verdict["probability"]):
        said += f", P(friction) {chance}"
    if verdict["verdict"] == "undecided":
        said += (
            ". The record does not decide whether the valve has friction: half of the drawn loops "
            "have none, and figures are means of both"
        )
    return f"{said}."


def _rows(now: Any, option: Any) -> Iterator[tuple[str, ...]]:
    """Yield a row for each measure that an option has; one of dashes where it has none."""
    if option.measures is None and not option.interval:
        yield str(option.what), "–", "", "–", ""
        return
    shown = str(option.what)
    for key, name in MEASURES.items():
        if (value := getattr(now, key)) is None:
            continue
        then = None if option.measures is None else getattr(option.measures, key)
        if key == "period" and _figure(then) in ("–", _figure(value)):
            continue
        low, high = option.interval.get(key, (None, None))
        between = "" if low is None else f"{_figure(low)} to {_figure(high)}"
        yield shown, name, _figure(value), _figure(then), between
        shown = ""


def _figure(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"
