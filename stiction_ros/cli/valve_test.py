"""``stiction valve-test``: a test of a valve in manual, planned and judged."""

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.cli.shared import intake_options as intake
from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.cli.shared.progress import bar
from stiction_ros.errors import InputError, storing
from stiction_ros.records.parts import longest_part
from stiction_ros.texts import spoken

if TYPE_CHECKING:
    from stiction_ros.identification.valve_test.judgement import Judgement
    from stiction_ros.identification.valve_test.plan import Facts, Plan
    from stiction_ros.records.record import Record

NEXT = "stiction valve-test judge TEST"


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "valve-test",
        description="plan: from a record of the loop as it runs, the moves of OP in manual that "
        "would decide whether the valve sticks, as a procedure to follow by hand. judge: from the "
        "record of these moves, the verdict, or the next moves.",
    )
    option = parser.add_argument
    option("what", choices=("plan", "judge"), help="what to do")
    intake.add_record(parser, metavar="RECORD|TEST")
    option("--before", metavar="RECORD", help="judge: the record that the test was planned from")
    option("--op-limit", type=float, metavar="X", help="how far OP may go from where it is, %%")
    option("--pv-limit", type=float, metavar="X", help="how far PV may go, in its own unit")
    option("--json", metavar="F", help="write the result as JSON; - for stdout")
    option("--out", metavar="F.csv", help="write the moves: seconds and OP")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    from stiction_ros.identification.valve_test.plan import first_round, further_round

    limits = _limits(options)
    loop = intake.opened(options)
    intake.tell(loop)
    if options.what == "plan":
        plan = first_round(_before(longest_part(loop.parts)).within(*limits))
        hand_over(options.json, plan.to_dict(), lambda: _show(plan, str(options.record)))
        _write(plan, options.out)
        return 0
    from stiction_ros.identification.valve_test.facts import facts_of_test, judged_record

    facts, record = None, max(loop.parts, key=len)
    if options.before is not None:
        given = argparse.Namespace(**(vars(options) | {"record": options.before}))
        facts = _before(longest_part(intake.opened(given).parts))
    with bar("judging"):
        said = judged_record(record, None if facts is None else facts.gain)
        facts = (facts or facts_of_test(record, said)).within(*limits)
        further = None if said.decided else further_round(facts, said)
    told = {"next": None if further is None else further.to_dict(), "sentence": said.sentence}
    hand_over(options.json, said.to_dict() | told, lambda: _told(said, further, options))
    _write(further, options.out, said.trial.steps.levels[1:].tolist())
    return 0


def _limits(options: argparse.Namespace) -> tuple[float | None, float | None]:
    """Return how far OP, %, and PV may go; None where that is not said."""
    for name in ("op_limit", "pv_limit"):
        value = getattr(options, name)
        if value is not None and not 0.0 < value < 1e300:
            raise InputError(
                f"{value:g} is no distance", where=f"--{name.replace('_', '-')}", fix="use above 0"
            )
    return options.op_limit, options.pv_limit


def _before(record: "Record") -> "Facts":
    """Return what a record of the loop as it runs tells."""
    from stiction_ros.identification import identify
    from stiction_ros.identification.valve_test.facts import facts_before

    with bar("identifying") as show:
        found = identify(record, None, show)
    return facts_before(record, found)


def _write(plan: "Plan | None", target: str | None, made: Sequence[float] = ()) -> None:
    """Write the moves of a round behind those that were made: a test is one record."""
    if target is None or plan is None:
        return
    with storing(target), Path(target).open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(("after", "OP"))
        rows.writerows(
            (i * plan.facts.hold, level) for i, level in enumerate((*made, *plan.levels))
        )


def _show(plan: "Plan", before: str | None) -> None:
    """Print a round as a procedure that an operator follows by hand."""
    facts, hold = plan.facts, spoken(plan.facts.hold)
    low, high = facts.pv_limit
    print(f"Valve test of {facts.valve}, {len(plan.levels)} moves, {spoken(plan.duration)}")
    print(f"  1. Put the loop in manual at OP {facts.op:.4g} %, as recorded; wait until PV rests.")
    print(f"  2. Begin to record OP and PV; wait {hold}, in which PV settles after a move.")
    for i, level in enumerate(plan.levels):
        print(f"  {i + 3}. Set OP to {level:.4g} % and wait for {hold}.")
    print(f"  {len(plan.levels) + 3}. Stop recording, and put the controller back in automatic.")
    print(f"Set OP back to {facts.op:.4g} % at once and stop if PV leaves {low:.4g} to {high:.4g}:")
    print(
        "  PV went as far before, or the moves could take it there; --pv-limit sets other limits."
    )
    if plan.pv_move is None:
        print("How far PV will move is not known: make sure that it may.")
    else:
        print(f"PV is expected to move by up to {plan.pv_move:.3g}.")
    told = "" if before is None else f" --before {before}"
    print(f"Then, with TEST the file that was recorded: {NEXT}{told}")


def _told(judgement: "Judgement", plan: "Plan | None", options: argparse.Namespace) -> None:
    """Print the verdict, and the next round where it is still open."""
    print(judgement.sentence)
    if plan is not None:
        print("The next moves follow on those that are recorded; give both in one record.")
        _show(plan, options.before)
