"""The report of an example: what was identified beside what is true."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import Identification, OutputModel
from stiction_ros.pages.frame import framed, text
from stiction_ros.processes import StirredTank
from stiction_ros.report.drawing import (
    BLUE,
    INK,
    SKY,
    VERMILION,
    Drawing,
    TimeAxis,
    data_limits,
    legend,
    panels,
    style,
)
from stiction_ros.report.page import Cell, card, duration, embedded, number, table
from stiction_ros.report.record.report import evidence_table
from stiction_ros.report.run.identified import KINDS, process_table, verdict_line
from stiction_ros.report.run.story import TANK_UNITS
from stiction_ros.report.shapes import (
    draw_curves,
    draw_responses,
    draw_valve,
    free_run,
)
from stiction_ros.signals.holds import set_point_moves
from stiction_ros.texts import finite
from stiction_studies.examples.comparison import Against, Comparison, ValveComparison
from stiction_studies.examples.example import Example
from stiction_studies.examples.one_step import one_step_estimate

TITLES = {"example1": "Example 1", "example2": "Example 2", "healthy": "Without friction"}
VARIANTS = {
    "measurement": "noise on the measurement",
    "equation": "noise in the process equation",
    "linear": "the linear plant (A.3)",
    "tank": "the nonlinear tank (A.1)",
    "tight": "a tightly tuned loop",
    "sine": "a loop with a sine disturbance",
    "coloured": "a loop with coloured noise",
}


def report_example(
    example: Example, found: Identification, comparison: Comparison, target: Path
) -> Path:
    """Write the page ``target`` with its figures inside and return it.

    Args:
        example: record and truth.
        found: identification of the record.
        comparison: of the two.
        target: the ``.html`` file; its folder is there.
    """
    values = finite(found.to_json())
    headline = f"{TITLES[example.name]}: {verdict_line(values['valves'])}"
    record = example.record
    kicker = (
        f"{VARIANTS[example.variant]}, seed {example.seed}; {len(record)} samples of "
        f"{record.sample_time:g} s, {duration(len(record) * record.sample_time)} of operation"
    )
    parts = [
        f"<h1>{text(headline)}</h1>",
        f'<p class="soft">{text(kicker)}</p>',
        f'<div class="cards">{"".join(map(_card, comparison.valves))}</div>',
        comparison_table(comparison),
        _errors(comparison),
        *map(embedded, draw_example(example, found)),
        evidence_table(found.valves),
        process_table(values["outputs"], record.sample_time),
    ]
    target.write_text(framed(headline, parts), encoding="utf-8")
    return target


def comparison_table(comparison: Comparison) -> str:
    """Return true against identified, figure by figure."""
    rows: list[list[Cell]] = []
    for valve in comparison.valves:
        rows.append([f"{valve.name}: f_S, %", *_cells(valve.static_friction, 3)])
        rows.append([f"{valve.name}: f_D, %", *_cells(valve.dynamic_friction, 3)])
    for channel in comparison.channels:
        name = f"{channel.valve} → {channel.output}"
        rows.append([f"{name}: delay, samples", *_cells(channel.delay, 0)])
        rows.append([f"{name}: gain at steady state, per %", *_cells(channel.gain, 5)])
        share = f"{100 * channel.response_error:.2f} %"
        rows.append([f"{name}: step response, largest error", "", "", share, ""])
    head = ("", "true", "identified", "error", "95 % interval")
    return "<h2>True and identified</h2>" + table(head, rows)


def draw_example(example: Example, found: Identification) -> tuple[Drawing, ...]:
    """Draw step responses, trends of a window and of the whole record, and valve curves."""
    record = example.record
    with style():
        drawn = [
            Drawing(
                "step_responses",
                "Unit step responses",
                "Response of each PV to a stem step of 1 %, of the actual and of the identified "
                "process" + (", the tank linearised." if _is_tank(example) else "."),
                draw_responses(
                    [output.to_json() for output in found.outputs],
                    record,
                    example.truth,
                    _units(example),
                ),
            ),
            Drawing(
                "window",
                "Measured and estimated time trends",
                "A part of the record around a set-point move. The free run is driven by the "
                "estimated stems alone; the one-step estimate also by the PV measured before.",
                _trends(example, found, window(example)),
            ),
            Drawing(
                "record",
                "The whole record",
                "The same signals over all samples.",
                _trends(example, found, slice(0, len(record))),
            ),
            draw_curves(record, found.stem, record.stem),
        ]
    return tuple(drawn)


def window(example: Example) -> slice:
    """Return a fifth of the record around the set-point move nearest to its middle."""
    record = example.record
    count = len(record)
    width = max(count // 5, 2)
    move = count // 2
    if record.sp is not None:
        moves = set_point_moves(record.sp)
        if moves.size:
            move = int(moves[np.argmin(np.abs(moves - count // 2))])
    first = min(max(move - round(0.4 * width), 0), count - width)
    return slice(first, first + width)


def _trends(example: Example, found: Identification, part: slice) -> Any:
    """Return a figure with PV, SP and both estimates, and OP with true and estimated stem."""
    record = example.record
    assert record.stem is not None
    rows = len(record.outputs) + len(record.valves)
    figure, axes = panels(rows, 0.6 + 2.2 * rows, sharex=True)
    time = TimeAxis.spanning(record.time[-1])
    at = time(record.time[part])
    for row, output in enumerate(found.outputs):
        _draw_estimates(axes[row, 0], at, example, found, output, part)
        legend(axes[row, 0])
    for row, name in enumerate(record.valves, start=len(found.outputs)):
        j = row - len(found.outputs)
        axis = axes[row, 0]
        draw_valve(axis, at, record.op[part, j], record.stem[part, j], found.stem[part, j])
        axis.set_title(name)
        legend(axis)
    axes[-1, 0].set_xlabel(time.label)
    axes[-1, 0].set_xlim(at[0], at[-1])
    return figure


def _draw_estimates(
    axis: Any,
    at: FloatArray,
    example: Example,
    found: Identification,
    output: OutputModel,
    part: slice,
) -> None:
    record = example.record
    i = record.outputs.index(output.name)
    measured = record.pv[:, i]
    stems = {name: found.stem[:, j] for j, name in enumerate(record.valves)}
    run = free_run(output, stems, measured)[part]
    one_step = one_step_estimate(record, found.stem, output)[part]
    axis.plot(at, measured[part], color=SKY, linewidth=3.0, alpha=0.6, label="PV, measured")
    if record.sp is not None:
        axis.plot(at, record.sp[part, i], color=INK, drawstyle="steps-post", label="SP")
    axis.plot(at, one_step, color=BLUE, linewidth=0.8, label="one-step estimate")
    axis.plot(at, run, color=VERMILION, linewidth=1.1, linestyle=(0, (5, 2)), label="free run")
    data_limits(axis, [measured[part], run])
    axis.set_title(output.name)
    axis.set_ylabel(f"{output.name} ({_units(example).get(output.name, 'PV units')})")


def _card(valve: ValveComparison) -> str:
    kind = KINDS.get(valve.verdict, "open")
    static, dynamic = valve.static_friction, valve.dynamic_friction
    more = (
        f"f_S {static.found:.2f} % (true {static.true:g}), "
        f"f_D {dynamic.found:.2f} % (true {dynamic.true:g})"
    )
    return card(kind, valve.name, valve.verdict, more)


def _cells(against: Against, decimals: int) -> list[Cell]:
    """Return the four cells of a figure; an interval without the truth stands out."""
    shown: list[Cell] = [
        f"{value:{sign}.{decimals}f}".replace("-", "−")
        for value, sign in ((against.true, ""), (against.found, ""), (against.error, "+"))
    ]
    if against.interval is None:
        return [*shown, ""]
    low, high = against.interval
    ends = f"{low:.{decimals}f} … {high:.{decimals}f}"
    return [*shown, ends if against.inside else ("bad", ends)]


def _errors(comparison: Comparison) -> str:
    return (
        "<p>Stem error (1/m) Σ (χ − χ̂)² = "
        f"{number(comparison.stem_error)} %². SE of the one-step prediction = "
        f"{number(comparison.square_error, 6)}; with the true stems and delays it is "
        f"{number(comparison.true_stem_square_error, 6)}. The smaller SE need not belong to "
        "the better stem: the data show PV, not the stem.</p>"
        '<p class="soft">Step responses are compared by their largest difference, as a share '
        "of the output’s largest true gain.</p>"
    )


def _is_tank(example: Example) -> bool:
    return isinstance(example.truth.process, StirredTank)


def _units(example: Example) -> Mapping[str, str]:
    return TANK_UNITS if example.name == "example2" else {}
