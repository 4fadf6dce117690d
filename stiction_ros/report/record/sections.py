"""Sections of words and figures: why, what next, the work of the valve."""

from __future__ import annotations

from stiction_ros.identification import Identification
from stiction_ros.identification.answer.words import cycle, materiality, next_step, why
from stiction_ros.pages.frame import words
from stiction_ros.records.record import Record
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.report.page import Cell, number, table


def lead(found: Identification) -> str:
    """Return why each valve is what it is said to be, what makes the cycle, and what to do next."""
    told = [
        " ".join(filter(None, (why(found, j), materiality(valve))))
        for j, valve in enumerate(found.valves)
    ]
    told += [said for model in found.outputs if (said := cycle(model))]
    steps = [
        f"<b>What to do next:</b> {words(next_step(found, j))}" for j in range(len(found.valves))
    ]
    leads = [f'<p class="lead">{words(said)}</p>' for said in told]
    return "".join([*leads, *(f"<p>{step}</p>" for step in steps)])


def work_table(record: Record, found: Identification) -> str:
    """Return what OP and stem travel in an hour."""
    hours = len(record) * record.sample_time / 3600.0
    rows: list[list[Cell]] = []
    for j, name in enumerate(record.valves):
        signals = {f"OP of {name}": record.op[:, j]}
        if found.stem.shape == record.op.shape:
            signals[f"stem of {name}, estimated"] = found.stem[:, j]
        for what, values in signals.items():
            work = ValveWork.of(values).per_hour(hours)
            rows += [
                [f"{what}: travel per hour, %", number(work.travel)],
                [f"{what}: moves per hour (samples at which it moves)", number(work.moves)],
                [f"{what}: reversals per hour", number(work.reversals)],
            ]
    return "<h2>Valve work</h2>" + table(["", "in this record"], rows)
