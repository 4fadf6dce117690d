"""Sections of words and figures: why, what next, the work of the valve, how the answer holds."""

from __future__ import annotations

from stiction_ros.identification import Identification
from stiction_ros.identification.answer.words import cause_of, materiality, next_step, why
from stiction_ros.identification.result.cause import CauseKind
from stiction_ros.pages.frame import text, words
from stiction_ros.records.record import Record
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.report.page import Cell, duration, interval, number, table
from stiction_ros.texts import finite


def lead(found: Identification) -> str:
    """Return why each valve is what it is said to be, how much it matters, and what to do next."""
    parts = []
    for j, valve in enumerate(found.valves):
        cause = cause_of(found, j)
        # That the valve makes the cycle is what materiality says already, with its share.
        other = "" if cause is None or cause.kind is CauseKind.VALVE else cause.sentence
        told = [why(found, j), materiality(valve), other]
        said = words(" ".join(filter(None, told)))
        parts.append(f'<p class="lead">{said}</p>')
        parts.append(f"<p><b>What to do next:</b> {words(next_step(found, j))}</p>")
    return "".join(parts)


def work_table(record: Record, found: Identification) -> str:
    """Return the cycle of each PV, and what OP and stem travel in an hour."""
    hours = len(record) * record.sample_time / 3600.0
    rows: list[list[Cell]] = []
    for model in found.outputs:
        if model.cause is None or model.cause.period is None:
            continue
        cause = model.cause
        rows += [
            [f"period of {model.name}", duration(cause.period)],
            [f"regularity of {model.name} (above 1 is regular)", number(cause.regularity)],
            [f"amplitude of {model.name}, PV units", number(cause.amplitude)],
        ]
    for j, name in enumerate(record.valves):
        signals = {f"OP of {name}": record.op[:, j]}
        if found.stem.shape == record.op.shape:
            signals[f"stem of {name}, estimated"] = found.stem[:, j]
        for what, values in signals.items():
            work = ValveWork.of(values).per_hour(hours)
            rows += [
                [f"{what}: travel per hour, %", number(work.travel)],
                [f"{what}: moves per hour", number(work.moves)],
                [f"{what}: reversals per hour", number(work.reversals)],
            ]
    return "<h2>Cycle and valve work</h2>" + table(["", "in this record"], rows)


def stability_table(found: Identification) -> str:
    """Return how the answer holds at other rates and in the halves of the record."""
    rate = found.to_json()["rate"]
    rows: list[list[Cell]] = []
    for valve in found.valves:
        for look in () if valve.stability is None else valve.stability.tried:
            said = "agrees" if look.agrees else "does not agree"
            band = interval(None if look.band is None else list(look.band))
            gain = number(finite(look.gain))
            rows.append([valve.name, look.name, said, gain, band])
    if not rows:
        return ""
    head = ("valve", "part or rate", "answer", "gain", "f_S + f_D, %")
    used = text(
        f"Rows of {rate['used']:g} s from samples of {rate['sample_time']:g} s. Gain: −2 log "
        "likelihood that friction adds."
    )
    return f"<h2>How the answer holds</h2><p>{used}</p>" + table(head, rows, texts=3)
