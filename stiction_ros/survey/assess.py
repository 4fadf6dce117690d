"""One loop from its records to its row and its page: what a worker does."""

import dataclasses
import time
import traceback
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.gain.gain import gain_of
from stiction_ros.identification import Identification, identify
from stiction_ros.identification.valve_test.facts import facts_before
from stiction_ros.identification.valve_test.plan import first_round
from stiction_ros.intake.loop import Loop
from stiction_ros.records.csv_writer import DEFAULT_OUTPUT, DEFAULT_VALVE
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Quality, Record
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.signals.controller_recovery import resting_limits
from stiction_ros.signals.oscillation import REGULAR
from stiction_ros.survey.entry import Cycling, Entry, Status, SurveyOptions
from stiction_ros.survey.groups import beats
from stiction_ros.survey.pages.loop_page import loop_page
from stiction_ros.survey.pages.words import cause_words

FEWEST = 100  # samples in automatic below which nothing is judged
NEAR_LIMIT = 1e-6  # share of OP's range within which it stands at an end of it


@dataclasses.dataclass(frozen=True)
class Assessed:
    """What is said of one loop."""

    entry: Entry  # its row
    page: str = ""  # HTML of its page, which may be empty
    log: tuple[str, ...] = ()  # what was decided
    again: bool = False  # whether a survey that goes on should try the loop anew


def assess(loop: Loop, options: SurveyOptions) -> Assessed:
    """Return what is said of a loop; whatever goes wrong is said there and not raised."""
    if loop.problem is not None or not loop.parts:
        return failed(loop, loop.problem or "it holds no samples")
    entry = _row_of(loop)
    try:
        return _assessed(loop, entry, options)
    except InputError as error:
        return _ended(_described(entry, loop.parts), Status.SKIPPED, str(error))
    except Exception as error:  # whatever one loop does to us, the others go on
        place = traceback.extract_tb(error.__traceback__)[-1]
        reason = (
            f"judging it broke off: {type(error).__name__}: {error} ({place.name}, "
            f"line {place.lineno}); the other loops are not touched"
        )
        return _ended(_described(entry, loop.parts), Status.FAILED, reason)


def failed(loop: Loop, reason: str, *, again: bool = False) -> Assessed:
    """Return a loop that could not be judged, for a reason that may pass when tried ``again``."""
    return dataclasses.replace(_ended(_row_of(loop), Status.FAILED, reason), again=again)


def _row_of(loop: Loop) -> Entry:
    """Return the row of a loop of which nothing is known but what was read."""
    files = tuple(map(str, loop.files))
    return Entry(loop.name, files, Status.FAILED, op_unit=loop.op_unit, notes=loop.notes)


def _ended(entry: Entry, status: Status, reason: str) -> Assessed:
    log = (*entry.notes, f"{status.value}: {reason}")
    return Assessed(dataclasses.replace(entry, status=status, reason=reason), log=log)


def _described(entry: Entry, parts: tuple[Record, ...]) -> Entry:
    """Return the entry with what is known before anything is judged."""
    total = sum(len(part) for part in parts)
    by_hand = sum(int(np.count_nonzero(part.quality == Quality.MANUAL)) for part in parts)
    longest = max(parts, key=len)
    return dataclasses.replace(
        entry,
        samples=total,
        sample_time=longest.sample_time,
        auto_share=1.0 - by_hand / max(total, 1),
    )


def _assessed(loop: Loop, entry: Entry, options: SurveyOptions) -> Assessed:
    begun = time.perf_counter()
    entry = _described(entry, loop.parts)
    if entry.auto_share == 0.0:
        return _ended(entry, Status.SKIPPED, "it was in manual all the time")
    record = _named(longest_part(loop.parts), entry.name)
    op = record.op[:, 0]
    entry = dataclasses.replace(entry, saturated_share=at_limits(op, resting_limits(op)))
    if len(record) < FEWEST:
        reason = f"its longest good part in automatic has {len(record)} of {FEWEST} samples"
        return _ended(entry, Status.SKIPPED, reason)
    found = identify(record, options.identification)
    entry, chosen = _judged(entry, record, found)
    cycles = f", cycles by: {cause_words(entry.cause)}" if entry.cause else ""
    log = [*entry.notes, f"verdict: {entry.verdict}{cycles}"]
    if entry.verdict == "undecided" and len(record.valves) == len(record.outputs) == 1:
        plan = first_round(facts_before(record, found))
        test = {"duration": plan.duration, "pv_move": plan.pv_move}
        entry = dataclasses.replace(entry, test=test)
    gain, doubt = None, ""
    if options.gain and entry.found:
        try:
            gain = gain_of(record, found, record.valves[chosen]).to_dict()
        except InputError as error:
            doubt = f"gain is not known: {error}"
            log.append(doubt)
    entry = dataclasses.replace(
        entry,
        gain=None if gain is None else _columns(gain),
        notes=(*entry.notes, *([doubt] if doubt else [])),
    )
    for option in gain["options"] if gain else ():
        log.append(f"gain, {option['what']}: {option['note']}")
    log.append(f"took {time.perf_counter() - begun:.1f} s")
    unit = dict(options.units).get(entry.name, "")
    page = loop_page(entry, record, found, gain, unit) if options.pages else ""
    return Assessed(entry, page, tuple(log))


def _named(record: Record, name: str) -> Record:
    """Return a record whose signals bear the loop's name where its file gives them none."""
    if (record.valves, record.outputs) != ((DEFAULT_VALVE,), (DEFAULT_OUTPUT,)):
        return record
    return dataclasses.replace(record, valves=(name,), outputs=(name,))


def _judged(entry: Entry, record: Record, found: Identification) -> tuple[Entry, int]:
    """Return the entry with the verdict, and the index of the valve that it is about."""
    document = found.to_dict()
    valves, outputs = document["valves"], document["outputs"]
    notes = tuple(dict.fromkeys([*entry.notes, *record.notes, *found.notes]))
    if not valves or not outputs:
        reason = document["model"].get("reason") or "no model was found"
        raise InputError(reason)
    concern = {"sticky": 2, "backlash": 2, "undecided": 1}
    ranks = [(concern.get(v["verdict"], 0), float(v["band_share"])) for v in valves]
    chosen = ranks.index(max(ranks))
    valve = valves[chosen]
    output = outputs[min(chosen, len(outputs) - 1)]
    cause = output.get("cause")
    kind = None if cause is None else cause["kind"]
    cycling = None
    if cause is not None and cause["period"] is not None:
        cycling = Cycling(cause["period"], cause["regularity"], cause["amplitude"])
    hours = len(record) * record.sample_time / 3600.0
    stems = found.stem if found.stem.shape == record.op.shape else np.zeros_like(record.op)
    work = ValveWork.of(stems[:, chosen])
    entry = dataclasses.replace(
        entry,
        status=Status.OK,
        oscillation=cycling,
        verdict=valve["verdict"],
        cause=kind,
        f_s=valve["f_s"],
        f_s_interval=tuple(valve["f_s_interval"]),
        f_d=valve["f_d"],
        f_d_interval=tuple(valve["f_d_interval"]),
        band_share=valve["band_share"],
        travel_per_hour=work.travel / hours,
        reversals_per_hour=work.reversals / hours,
        probability=valve["probability"],
        evidence=valve["evidence"],
        notes=notes,
        beats=_beats(record, outputs.index(output), cycling),
    )
    return entry, chosen


def _beats(record: Record, output: int, cycling: Cycling | None) -> tuple[float, ...]:
    if cycling is None or cycling.period is None or cycling.regularity <= REGULAR:
        return ()
    pv = record.pv[:, output]
    error = pv - (pv.mean() if record.sp is None else record.sp[:, output])
    rows = beats(error, cycling.period / record.sample_time)
    return tuple((record.start + record.sample_time * rows).tolist())


def at_limits(op: FloatArray, limits: tuple[float, float]) -> float:
    """Return the share of ``op``, shape (N,), at limits; infinite ones are none."""
    room = NEAR_LIMIT * max(float(np.ptp(op)), 1e-300)
    return float(np.mean((op <= limits[0] + room) | (op >= limits[1] - room)))


def _columns(gain: dict[str, Any]) -> dict[str, Any]:
    """Return gain as it stands in the list: now, and the options by their names."""
    options = {
        option["what"]: {key: value for key, value in option.items() if key != "what"}
        for option in gain["options"]
    }
    return {"now": gain["now"], **options}
