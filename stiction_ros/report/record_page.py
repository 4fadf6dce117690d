"""The report of one record: is it the valve, which one, how bad, and how well that fits."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification, ValveEstimate
from stiction_ros.identification.answer.summary import cycle, materiality, next_step, why
from stiction_ros.identification.judgement import definitions
from stiction_ros.pages.frame import framed, listed, text, words
from stiction_ros.pages.plot import SCRIPT, Curve, over_time
from stiction_ros.pages.signals import UNITS, Units, all_signals, close_look
from stiction_ros.records.parts import joined, span
from stiction_ros.records.record import Record
from stiction_ros.records.valve_work import ValveWork
from stiction_ros.report.page import Cell, number, table, write_page
from stiction_ros.report.run.identified import process_table, responses, valve_cards, verdict_line
from stiction_ros.texts import finite, probability


def report_record(
    record: Record, identification: Identification, out: str | Path, parts: Sequence[Record] = ()
) -> Path:
    """Write the page of a record and return its file.

    Args:
        record: that was looked at.
        identification: of this record.
        out: folder of ``report.html``, made when missing; or an ``.html`` file.
        parts: all parts of the source that it is from, when there are several.

    Returns:
        The page.

    Raises:
        OSError: nothing can be written there.

    Examples:
        >>> from stiction_ros import IdentificationOptions, LoopModel
        >>> from stiction_ros import find_config, identify, report_record, simulate
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=200)
        >>> found = identify(record, IdentificationOptions(output_order=1, delay=(2, 2)))
        >>> report_record(record, found, "report.html").name
        'report.html'
    """
    return write_page(out, record_page(record, identification, parts))


def record_page(
    record: Record,
    identification: Identification,
    parts: Sequence[Record] = (),
    *,
    units: Units = UNITS,
    above: str = "",
    helps: str = "",
    notes: Sequence[str] = (),
) -> str:
    """Return the report of a record as HTML.

    Args:
        record: that was looked at.
        identification: of this record.
        parts: all parts of the source that it is from, when there are several.
        units: of PV and OP.
        above: what stands above the headline, HTML.
        helps: the section on what would help, HTML.
        notes: besides those of record and identification.
    """
    found = finite(identification.to_dict())
    headline = verdict_line(found["valves"])
    kicker = f"{record.name}: {len(record)} samples of {record.sample_time:g} s, {span(record)}"
    trouble = ""
    if identification.reason:
        trouble = (
            f'<p class="note warn">The fit is not to be trusted: {text(identification.reason)}</p>'
        )
    told = dict.fromkeys([*record.notes, *identification.notes, *notes])
    whole = (joined(parts) if parts else record).filled()
    stem = _stem_within(record, identification, joined(parts) if parts else record)
    sections = [
        above,
        f"<h1>{text(headline)}</h1>",
        f'<p class="soft">{text(kicker)}</p>',
        trouble,
        units.said(lead(identification)),
        units.said(valve_cards(found["valves"])),
        helps,
        work_table(record, identification),
        close_look(record, identification, units),
        all_signals(whole, stem, units),
        _free_runs(record, identification, units),
        evidence_table(identification.valves),
        units.said(process_table(found["outputs"], record.sample_time)),
        responses(found["outputs"], record, units, None),
        f"<h2>Notes</h2>{listed(told)}" if told else "",
    ]
    return framed(f"{record.name}: {headline}", sections, SCRIPT)


def evidence_table(valves: Sequence[ValveEstimate]) -> str:
    """Return the figures behind the verdicts."""
    told = [valve for valve in valves if valve.figures is not None]
    if not told:
        return ""
    rows: list[list[Cell]] = [
        [
            f"{key.replace('_', ' ')} ({meaning['unit']}): {meaning['definition']}",
            *[number(getattr(valve.figures, key)) for valve in told],
        ]
        for key, meaning in definitions().items()
    ]
    rows.append(["probability of friction", *[probability(valve.probability) for valve in told]])
    return "<h2>Evidence</h2>" + table(["", *[valve.name for valve in told]], rows)


def _stem_within(
    record: Record, identification: Identification, whole: Record
) -> FloatArray | None:
    """Return the estimated stems at the samples of ``whole.filled()``, NaN elsewhere."""
    if identification.stem.shape != record.op.shape:
        return None
    rows = whole.filled_rows()
    stem = np.full((int(rows[-1]) + 1, len(record.valves)), np.nan)
    for first, _, start in whole.segments:
        begin = first + round((record.start - start) / record.sample_time)
        end = begin + len(record)
        if begin >= first and np.array_equal(whole.op[begin:end], record.op):
            stem[rows[begin:end]] = identification.stem
            return stem
    return None


def _free_runs(record: Record, found: Identification, units: Units) -> str:
    """Return each PV beside the model that is driven by the recorded OP alone."""
    if found.stem.shape != record.op.shape:
        return ""
    stems = dict(zip(record.valves, found.stem.T, strict=True))
    drawn = []
    for model in found.outputs:
        pv = record.pv[:, record.outputs.index(model.name)]
        run = model.free_run(stems, pv)
        curves = [Curve(f"{model.name}, measured", "pv", pv), Curve("model", "free", run)]
        said = (
            f"The model of {model.name} driven by the recorded OP alone: friction, then process. "
            f"It fits {number(model.fit_free_run)} %, one sample ahead "
            f"{number(model.fit_one_step)} %. Loads that were not recorded are not in it: they "
            "lower this fit, not the probability of friction."
        )
        drawn.append(over_time(said, record.time, curves, units.axis(model.name), record.start))
    return "<h2>Model against measurement</h2>" + "".join(drawn) if drawn else ""


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
