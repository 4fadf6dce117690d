"""All faults, by name, and the table of them that the documentation shows."""

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.kinds import (
    commanders,
    lost_signals,
    offered_models,
    settings_in_run,
    signal_junk,
    stopped_nodes,
    valve_tests,
)
from stiction_studies.faults.named import named
from stiction_studies.faults.terms import BOTH_PACES, BOTH_PHASES, Bag

FAULTS: tuple[Fault, ...] = (
    *stopped_nodes.FAULTS,
    *signal_junk.FAULTS,
    *lost_signals.FAULTS,
    *offered_models.FAULTS,
    *commanders.FAULTS,
    *settings_in_run.FAULTS,
    *valve_tests.FAULTS,
)


def find(name: str) -> Fault:
    """Return the fault of that name.

    Raises:
        InputError: there is none.
    """
    return named(FAULTS, name, "stiction faults")


def table() -> str:
    """Return the table of the documentation, in Markdown."""
    rows = [
        "| fault | expected | pace | the swap | diagnostic | bag |",
        "|---|---|---|---|---|---|",
    ]
    rows += [f"| {' | '.join(_cells(fault))} |" for fault in FAULTS]
    return "\n".join(rows) + "\n"


def _cells(fault: Fault) -> list[str]:
    paces = "both" if fault.paces == BOTH_PACES else fault.paces[0].value
    phases = "both" if fault.phases == BOTH_PHASES else fault.phases[0].value
    notices = []
    for notice in fault.notices:
        only = "" if set(notice.paces) >= set(fault.paces) else f" ({notice.paces[0].value})"
        notices.append(f"{notice.node} {notice.level}{only}")
    bags = {Bag.WHOLE: "whole", Bag.READABLE: "can be read", Bag.LOST: "–"}
    return [
        f"`{fault.name}`",
        fault.expected,
        paces,
        phases,
        ", ".join(notices) or "–",
        bags[fault.bag],
    ]
