"""The report of one record: is it the valve, which one, how bad, and how well that fits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification, ValveEstimate
from stiction_ros.identification.judgement.figures import definitions
from stiction_ros.records.parts import joined
from stiction_ros.records.record import Record
from stiction_ros.report.drawing import (
    INK,
    VERMILION,
    Drawing,
    TimeAxis,
    legend,
    panels,
    style,
)
from stiction_ros.report.page import Cell, duration, embedded, number, page, page_file, table, text
from stiction_ros.report.record.cycles import Window, draw_plane, draw_window
from stiction_ros.report.record.sections import lead, stability_table, work_table
from stiction_ros.report.run.identified import process_table, valve_cards, verdict_line
from stiction_ros.report.shapes import (
    draw_curves,
    draw_output,
    draw_responses,
    draw_valve,
    free_run,
)
from stiction_ros.texts import finite


def report_record(
    record: Record,
    identification: Identification,
    out: str | Path,
    parts: Sequence[Record] = (),
) -> Path:
    """Write ``report.html`` and its figures and return the page.

    Args:
        record: that was looked at.
        identification: of this record.
        out: folder, made when missing; or the ``.html`` file alone.
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
    target, folder = page_file(out)
    drawings = draw_record(record, identification, parts)
    target.write_text(record_page(record, identification, drawings), encoding="utf-8")
    if folder is not None:
        for drawing in drawings:
            drawing.save(folder)
    return target


def record_page(record: Record, identification: Identification, drawings: Sequence[Drawing]) -> str:
    """Return the report of a record as HTML."""
    found = finite(identification.to_json())
    headline = verdict_line(found["valves"])
    kicker = (
        f"{record.name}: {len(record)} samples of {record.sample_time:g} s, "
        f"{duration(len(record) * record.sample_time)} of operation"
    )
    trouble = ""
    if identification.reason:
        trouble = f'<p class="warn">The fit is not to be trusted: {text(identification.reason)}</p>'
    notes = dict.fromkeys([*record.notes, *identification.notes])
    listed = "".join(f"<li>{text(note)}</li>" for note in notes)
    parts = [
        f"<h1>{text(headline)}</h1>",
        f'<p class="kicker">{text(kicker)}</p>',
        trouble,
        lead(identification),
        valve_cards(found["valves"]),
        work_table(record, identification),
        *map(embedded, drawings),
        stability_table(identification),
        evidence_table(identification.valves),
        process_table(found["outputs"], record.sample_time),
        f"<h2>Notes</h2><ul>{listed}</ul>" if notes else "",
    ]
    return page(f"{record.name}: {headline}", parts)


def evidence_table(valves: Sequence[ValveEstimate]) -> str:
    """Return the figures behind the verdicts."""
    told = [valve for valve in valves if valve.figures is not None]
    if not told:
        return ""
    rows: list[list[Cell]] = [
        [
            f"{key.replace('_', ' ')}, {meaning['unit']}: {meaning['definition']}",
            *[number(getattr(valve.figures, key)) for valve in told],
        ]
        for key, meaning in definitions().items()
    ]
    rows.append(["probability of friction", *[number(valve.probability) for valve in told]])
    return "<h2>Evidence</h2>" + table(["", *[valve.name for valve in told]], rows)


def draw_record(
    record: Record, identification: Identification, parts: Sequence[Record] = ()
) -> tuple[Drawing, ...]:
    """Draw four cycles, PV against OP, signals with stems, valve curves, free run and responses.

    Args:
        record: that was looked at.
        identification: of this record.
        parts: all parts of the source that it is from, when there are several.

    Returns:
        Drawings: each has a ``name``, a ``title``, a ``caption`` and its ``figure`` of matplotlib,
        and shows itself in a notebook.

    Raises:
        ValueError: the identification has an output that the record has not.

    Examples:
        >>> from stiction_ros import IdentificationOptions, LoopModel
        >>> from stiction_ros import draw_record, find_config, identify, simulate
        >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=200)
        >>> found = identify(record, IdentificationOptions(output_order=1, delay=(2, 2)))
        >>> [drawing.name for drawing in draw_record(record, found)][:3]
        ['cycles', 'pv_op', 'signals']
    """
    window = Window.of(record, identification)
    with style():
        drawn = [
            draw_window(record, identification, window),
            draw_plane(record, window),
            _signals(record, identification, joined(parts) if parts else record),
        ]
        if identification.stem.shape == record.op.shape:
            drawn += [draw_curves(record, identification.stem)]
            if identification.outputs:
                drawn += [_free_runs(record, identification)]
        if identification.outputs:
            outputs = [output.to_json() for output in identification.outputs]
            drawn.append(
                Drawing(
                    "step_responses",
                    "Identified process",
                    "Response of each PV to a stem step of 1 %.",
                    draw_responses(outputs, record, None, {}),
                )
            )
    return tuple(drawn)


def _signals(record: Record, identification: Identification, whole: Record) -> Drawing:
    """Draw the signals of ``whole``, of which ``record`` is a part; its gaps stay empty."""
    rows = len(record.outputs) + len(record.valves)
    figure, axes = panels(rows, 0.6 + 2.0 * rows, sharex=True)
    shown = whole.filled()
    time = TimeAxis.spanning(shown.time[-1])
    at = time(shown.time)
    for j, name in enumerate(record.outputs):
        draw_output(axes[j, 0], at, shown, j, slice(None))
        axes[j, 0].set_ylabel(f"{name} (PV units)")
    stem = _stem_within(record, identification, whole)
    for j, name in enumerate(record.valves):
        axis = axes[len(record.outputs) + j, 0]
        true = None if shown.stem is None else shown.stem[:, j]
        draw_valve(axis, at, shown.op[:, j], true, None if stem is None else stem[:, j])
        axis.set_title(name)
        legend(axis)
    axes[-1, 0].set_xlabel(time.label)
    axes[-1, 0].set_xlim(at[0], at[-1])
    legend(axes[0, 0])
    caption = "The record, and the stem positions that the identified valves give for its OP"
    caption += "." if len(whole) == len(record) else " in the part that was looked at."
    return Drawing("signals", "Signals and stems", caption, figure)


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


def _free_runs(record: Record, identification: Identification) -> Drawing:
    count = len(identification.outputs)
    figure, axes = panels(count, 0.6 + 2.2 * count, sharex=True)
    time = TimeAxis.spanning(record.time[-1])
    at = time(record.time)
    stems = dict(zip(record.valves, identification.stem.T, strict=True))
    for row, output in enumerate(identification.outputs):
        axis = axes[row, 0]
        measured = record.pv[:, record.outputs.index(output.name)]
        run = free_run(output, stems, measured)
        axis.plot(at, measured, color=INK, linewidth=0.8, label="PV, measured")
        axis.plot(at, run, color=VERMILION, linewidth=1.2, label="free run of the model")
        axis.set_title(
            f"{output.name}: free-run fit {number(output.fit_free_run)} %, "
            f"one-step fit {number(output.fit_one_step)} %"
        )
        axis.set_ylabel(f"{output.name} (PV units)")
        legend(axis)
    axes[-1, 0].set_xlabel(time.label)
    axes[-1, 0].set_xlim(at[0], at[-1])
    caption = (
        "The model driven by the recorded OP alone: friction, then process. Slow disturbances "
        "that the loop suffered are not in it."
    )
    return Drawing("free_run", "Model against measurement", caption, figure)
