"""What the figures of runs and of single records have in common: signals and responses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import OutputModel
from stiction_ros.loop import LoopModel
from stiction_ros.records.record import Record
from stiction_ros.report.drawing import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    Drawing,
    TimeAxis,
    data_limits,
    legend,
    panels,
)
from stiction_ros.signals.free_run import driven, fitted_free_run
from stiction_ros.signals.free_run import step_response as answer_to_step
from stiction_ros.signals.polynomials import largest_root


def draw_output(axis: Any, at: FloatArray, record: Record, output: int, part: slice) -> None:
    """Draw PV and SP of one output over ``part`` of the record at the times ``at``."""
    axis.plot(at, record.pv[part, output], color=BLUE, linewidth=0.9, label="PV")
    if record.sp is not None:
        axis.plot(at, record.sp[part, output], color=INK, drawstyle="steps-post", label="SP")
    axis.set_title(record.outputs[output])


def draw_valve(
    axis: Any,
    at: FloatArray,
    op: FloatArray,
    stem: FloatArray | None,
    estimate: FloatArray | None,
) -> None:
    """Draw OP and the true and estimated stem of one valve, each of shape (N,), %."""
    drawn = [op]
    axis.plot(at, op, color=GREY, linewidth=0.9, drawstyle="steps-post", label="OP u")
    if stem is not None:
        drawn.append(stem)
        axis.plot(
            at,
            stem,
            color=ORANGE,
            linewidth=2.4,
            alpha=0.85,
            drawstyle="steps-post",
            label="stem χ, true",
        )
    if estimate is not None:
        drawn.append(estimate)
        axis.plot(
            at,
            estimate,
            color=BLUE,
            linewidth=0.9,
            drawstyle="steps-post",
            label="stem χ̂, estimated",
        )
    data_limits(axis, drawn)
    axis.set_ylabel("position (%)")


def draw_responses(
    outputs: Sequence[Mapping[str, Any]],
    record: Record,
    truth: LoopModel | None,
    units: Mapping[str, str],
) -> Any:
    """Return a figure with the response of every output to a step of every stem.

    Args:
        outputs: of ``identify --json``.
        record: that they were identified from.
        truth: simulated loop, None when unknown.
        units: engineering unit of each PV where known.
    """
    length = settling(outputs, truth)
    time = TimeAxis.spanning(length * record.sample_time)
    at = time(np.arange(length) * record.sample_time)
    rows = len(outputs)
    figure, axes = panels(rows, 0.7 + 2.1 * rows, len(record.valves), sharex=True, sharey="row")
    for row, output in enumerate(outputs):
        for column, valve in enumerate(record.valves):
            axis = axes[row, column]
            if truth is not None:
                known = true_response(truth, row, column, length)
                axis.plot(at, known, color=ORANGE, linewidth=3.2, alpha=0.7, label="true")
            axis.plot(at, step_response(output, valve, length), color=BLUE, label="identified")
            axis.set_title(f"{valve} → {output['name']}")
            if column == 0:
                axis.set_ylabel(f"{output['name']} ({units.get(output['name'], 'PV units')})")
            if row == rows - 1:
                axis.set_xlabel(f"time since the step ({time.unit})")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=2)
    return figure


def step_response(output: Mapping[str, Any], valve: str, samples: int) -> FloatArray:
    """Return the response, shape (N,), of one identified output to a stem step of 1 %.

    Args:
        output: entry of ``outputs`` of ``identify --json``: a, b, delay.
        valve: whose stem steps at sample 0.
        samples: N.
    """
    if valve not in output["b"]:
        return np.zeros(samples)
    delay = int(output["delay"].get(valve, 0))
    return answer_to_step(output["a"], output["b"][valve], delay, samples)


def free_run(
    output: OutputModel, stems: Mapping[str, FloatArray], measured: FloatArray
) -> FloatArray:
    """Return PV of an identified output driven by stems alone, its start fitted, shape (N,).

    Args:
        output: equation (9).
        stems: positions of each valve, shape (N,), %.
        measured: PV, shape (N,).
    """
    delays = [output.delay[valve] for valve in output.b]
    drive = driven(output.b.values(), delays, [stems[valve] for valve in output.b], output.bias)
    return fitted_free_run(output.a, drive, measured)


def true_response(model: LoopModel, output: int, valve: int, samples: int) -> FloatArray:
    """Return the response, shape (N,), of the true loop, linearised, to a stem step of 1 %."""
    return model.process.linear(model.sample_time).step_responses(samples)[:, output, valve]


def draw_curves(record: Record, estimate: FloatArray, true: FloatArray | None = None) -> Drawing:
    """Return the stems of all valves against OP.

    Args:
        record: whose OP it is.
        estimate, true: stems, shape (N, m), %; ``true`` None where it is not known.
    """
    figure, axes = panels(1, 4.4, len(record.valves))
    for j, name in enumerate(record.valves):
        axis, op = axes[0, j], record.op[:, j]
        ends = np.array([op.min(), op.max()])
        axis.plot(ends, ends, color=GREY, linestyle=(0, (5, 3)), label="ideal valve")
        if true is not None:
            axis.plot(op, true[:, j], color=ORANGE, linewidth=2.4, alpha=0.85, label="χ, true")
        axis.plot(op, estimate[:, j], color=BLUE, linewidth=0.8, label="χ̂, estimated")
        axis.set_title(name)
        axis.set_xlabel("OP u (%)")
        axis.set_aspect("equal", adjustable="box")
        axis.locator_params(nbins=6)
        legend(axis)
    axes[0, 0].set_ylabel("stem (%)")
    caption = (
        "Stem against OP: a sticky valve rests while OP travels (level lines) and then jumps; "
        "a healthy one stays on the diagonal."
    )
    return Drawing("valve_curves", "Valve curves", caption, figure)


def settling(outputs: Sequence[Mapping[str, Any]], truth: LoopModel | None) -> int:
    """Return after how many samples the slowest of the shown models has settled."""
    if truth is not None:
        linear = truth.process.linear(truth.sample_time)
        radius = float(np.abs(np.linalg.eigvals(linear.a)).max())
    else:
        radius = max(largest_root(np.array([1.0, *output["a"]])) for output in outputs)
    if not 0.0 < radius < 1.0:
        return 100
    return int(np.clip(math.ceil(math.log(0.01) / math.log(radius)), 20, 400))
