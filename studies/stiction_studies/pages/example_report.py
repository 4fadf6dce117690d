"""The report of an example: what was identified beside what is true."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from stiction_ros.identification import Identification
from stiction_ros.pages.frame import framed, text
from stiction_ros.pages.plot import SCRIPT, Curve, against, over_time
from stiction_ros.pages.signals import Units, all_signals
from stiction_ros.report.page import Cell, card, number, table
from stiction_ros.report.record_page import evidence_table
from stiction_ros.report.run.identified import KINDS, process_table, responses, verdict_line
from stiction_ros.report.run.story import TANK_UNITS
from stiction_ros.signals.holds import set_point_moves
from stiction_ros.texts import finite, spoken
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
    values = finite(found.to_dict())
    headline = f"{TITLES[example.name]}: {verdict_line(values['valves'])}"
    record, units = example.record, Units("PV units", "% of travel", _units(example))
    kicker = (
        f"{VARIANTS[example.variant]}, seed {example.seed}; {len(record)} samples of "
        f"{record.sample_time:g} s, {spoken(len(record) * record.sample_time)} of operation"
    )
    parts = [
        f"<h1>{text(headline)}</h1>",
        f'<p class="soft">{text(kicker)}</p>',
        f'<div class="cards">{"".join(map(_card, comparison.valves))}</div>',
        comparison_table(comparison),
        _errors(comparison),
        "<h2>Response to a step of the stem</h2>",
        responses(values["outputs"], record, units, example.truth),
        "<h2>Measured and estimated time trends</h2>" + trends(example, found),
        all_signals(record, found.stem, units),
        valve_curves(example, found),
        evidence_table(found.valves),
        process_table(values["outputs"], record.sample_time),
    ]
    target.write_text(framed(headline, parts, SCRIPT), encoding="utf-8")
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


def trends(example: Example, found: Identification) -> str:
    """Return the trends around a set-point move as figures.

    The free run is driven by the estimated stems alone, the one-step estimate also by the PV
    measured before.
    """
    record, part = example.record, window(example)
    assert record.stem is not None
    time, units = record.time[part], Units("PV units", "%", _units(example))
    stems = dict(zip(record.valves, found.stem.T, strict=True))
    drawn = []
    for output in found.outputs:
        i = record.outputs.index(output.name)
        one_step = one_step_estimate(record, found.stem, output)
        curves = [
            Curve("PV, measured", "whole", record.pv[part, i]),
            Curve("one-step estimate", "pv", one_step[part]),
            Curve("free run", "free", output.free_run(stems, record.pv[:, i])[part]),
        ]
        if record.sp is not None:
            curves.append(Curve("set-point", "sp", record.sp[part, i], steps=True))
        drawn.append(over_time(f"{output.name}.", time, curves, units.axis(output.name)))
    for j, name in enumerate(record.valves):
        curves = [
            Curve("OP", "op", record.op[part, j], steps=True),
            Curve("stem, true", "ink", record.stem[part, j], steps=True),
            Curve("stem, estimated", "stem", found.stem[part, j], steps=True),
        ]
        drawn.append(over_time(f"OP and stem of {name}.", time, curves, "%"))
    return "".join(drawn)


def valve_curves(example: Example, found: Identification) -> str:
    """Return the true and the estimated stem of each valve against OP."""
    record = example.record
    assert record.stem is not None
    drawn = [
        against(
            f"Stem of {name} against OP.",
            [
                (record.op[:, j], Curve("stem, true", "op", record.stem[:, j])),
                (record.op[:, j], Curve("stem, estimated", "stem", found.stem[:, j])),
            ],
            (f"OP of {name}, %", "stem, %"),
            equal=True,
        )
        for j, name in enumerate(record.valves)
    ]
    return f"<h2>Valve curves</h2><div class='pair'>{''.join(drawn)}</div>"


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


def _units(example: Example) -> Mapping[str, str]:
    return TANK_UNITS if example.name == "example2" else {}
