"""The figures of a run: signals, valves, estimates, before and after, step responses."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification import VerdictKind
from stiction_ros.records.quality import Quality
from stiction_ros.report.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    MODE_COLOURS,
    VERMILION,
    Drawing,
    TimeAxis,
    legend,
    mark_swap,
    panels,
    style,
)
from stiction_ros.report.run.scoring import errors
from stiction_ros.report.run.story import Story
from stiction_ros.report.shapes import draw_output, draw_responses, draw_valve

_STRIP = 0.16  # height of the mode strip as a share of a panel


def draw_run(story: Story) -> tuple[Drawing, ...]:
    """Draw every figure that the run has data for."""
    drawers: tuple[Callable[[Story], Drawing | None], ...] = (
        rounds,
        end_of_cycle,
        trends,
        valves,
        estimates,
        step_responses,
    )
    with style():
        drawn = [drawer(story) for drawer in drawers]
    return tuple(drawing for drawing in drawn if drawing is not None)


def trends(story: Story) -> Drawing:
    """Draw PV and SP of every output over the whole run."""
    record = story.record
    count = len(record.outputs)
    time, axes, figure = _run_panels(story, count, 2.0)
    for j, name in enumerate(record.outputs):
        draw_output(axes[j], time(record.time), record, j, slice(None))
        axes[j].set_ylabel(_with_unit(story, name))
    legend(axes[0])
    return Drawing(
        "trends",
        "Process variables and set-points",
        "Every sample of the run. The strip shows the controller's mode, a grey tick in it new "
        "friction values.",
        figure,
    )


def valves(story: Story) -> Drawing:
    """Draw OP, true and estimated stem of every valve over the whole run."""
    record = story.record
    time, axes, figure = _run_panels(story, len(record.valves), 2.2)
    for j, name in enumerate(record.valves):
        _draw_stems(axes[j], story, j, time(record.time), slice(None))
        axes[j].set_title(name)
    legend(axes[0])
    caption = "Controller output u and the stem position χ̂ that the controller works with"
    caption += ", beside the true one χ" if record.stem is not None else ""
    caption += ". A controller that does not know of the friction takes χ̂ = u."
    return Drawing("valves", "Valves", caption, figure)


def estimates(story: Story) -> Drawing | None:
    """Draw the estimates of f_S and f_D over time, what was trusted, and the truth."""
    if not story.log.estimates:
        return None
    record, log = story.record, story.log
    time = TimeAxis.spanning(record.time[-1])
    figure, axes = panels(len(record.valves), 0.5 + 2.1 * len(record.valves), 2, sharex=True)
    for row, valve in enumerate(record.valves):
        truth = story.true_friction(valve)
        for column, (key, symbol) in enumerate((("f_s", "f_S"), ("f_d", "f_D"))):
            axis = axes[row, column]
            name = f"{valve}.{key}"
            found = [e for e in log.estimates if e.name == name]
            at = time([log.seconds(e.stamp) for e in found])
            value = np.array([e.value for e in found])
            ends = np.array([(e.low, e.high) for e in found]).reshape(-1, 2)
            spread = np.nan_to_num(np.abs(ends - value[:, None])).T
            if truth is not None:
                axis.axhline(
                    truth[column], color=VERMILION, linestyle=(0, (5, 3)), label="true value"
                )
            _draw_trusted(axis, story, name, time)
            axis.errorbar(
                at,
                value,
                spread,
                fmt="o",
                color=BLUE,
                markersize=4,
                capsize=3,
                linewidth=1.2,
                label="fit with interval",
            )
            mark_swap(axis, _swap(story, time), "swap" if row + column == 0 else "")
            axis.set_title(f"{valve}: ${symbol}$")
            axis.set_ylabel(f"${symbol}$ (%)")
            known = [] if truth is None else [truth[column]]
            axis.set_ylim(*_friction_limits(np.concatenate([value, ends.ravel(), known])))
            axis.set_xlim(0.0, 1.015 * time(record.time[-1]))
            if row == len(record.valves) - 1:
                axis.set_xlabel(time.label)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=4)
    return Drawing(
        "estimates",
        "Friction found over time",
        "One point for each fitted window, at the window's end; the step line is what the "
        "estimator trusted and the controller worked with.",
        figure,
    )


def end_of_cycle(story: Story) -> Drawing | None:
    """Draw a few cycles on either side of the swap."""
    cycle, swap = story.phases.cycle, story.log.swap_sample
    if swap is None or cycle is None:
        return None
    record = story.record
    reach = round(4 * cycle.period)
    first, last = max(swap - reach, 0), min(swap + reach, len(record))
    part = slice(first, last)
    time = TimeAxis.spanning(2 * reach * record.sample_time)
    at = time(record.time[part])
    sticky = _sticky(story)
    rows = len(record.outputs) + len(sticky)
    figure, axes = panels(rows, 0.6 + 1.8 * rows, sharex=True)
    for j, name in enumerate(record.outputs):
        draw_output(axes[j, 0], at, record, j, part)
        axes[j, 0].set_ylabel(_with_unit(story, name))
    for row, j in enumerate(sticky, start=len(record.outputs)):
        _draw_stems(axes[row, 0], story, j, at, part)
        axes[row, 0].set_title(record.valves[j])
        legend(axes[row, 0])
    for axis in axes[:, 0]:
        mark_swap(axis, _swap(story, time), "swap" if axis is axes[0, 0] else "")
    axes[-1, 0].set_xlabel(time.label)
    axes[-1, 0].set_xlim(at[0], at[-1])
    legend(axes[0, 0])
    return Drawing(
        "swap",
        "The end of the limit cycle",
        "Four periods of the cycle before the swap and the same time after it.",
        figure,
    )


def rounds(story: Story) -> Drawing | None:
    """Draw the error over one round of set-points: before, after, without friction."""
    before, after = story.phases.before, story.phases.after
    if before is None or after is None or story.round_samples is None:
        return None
    record = story.record
    length = story.round_samples
    time = TimeAxis.spanning(length * record.sample_time)
    at = time(record.time[:length])
    error, _ = errors(record)
    error[record.quality == Quality.BAD] = np.nan  # a gap stays empty
    parts = [
        ("before the swap", VERMILION, error[before.first : before.last]),
        ("after the swap", BLUE, error[after.first : after.last]),
    ]
    if story.free_record is not None:
        free, _ = errors(story.free_record)
        parts.insert(1, ("without friction", GREY, free[after.first : after.last]))
    count = len(record.outputs)
    figure, axes = panels(count, 0.6 + 2.3 * count, sharex=True)
    for j, name in enumerate(record.outputs):
        axis = axes[j, 0]
        for label, colour, values in parts:
            axis.plot(at, values[:, j], color=colour, linewidth=1.0, label=label)
        # Set-point moves make errors far larger than the cycle: they may leave the panel.
        reach = 1.3 * float(np.nanquantile(np.abs(parts[0][2][:, j]), 0.96)) or 1.0
        axis.set_ylim(-reach, reach)
        axis.set_title(name)
        axis.set_ylabel(f"PV − SP{_unit(story, name)}")
    axes[-1, 0].set_xlabel(f"time since the start of the round ({time.unit})")
    axes[-1, 0].set_xlim(at[0], at[-1])
    legend(axes[0, 0])
    return Drawing(
        "rounds",
        "The same set-point moves before and after",
        "Control error over one round of the schedule; the spikes are set-point moves and "
        "leave the panel.",
        figure,
    )


def step_responses(story: Story) -> Drawing | None:
    """Draw the identified step responses, beside the true ones where known."""
    outputs = story.identified.get("outputs", [])
    if not outputs:
        return None
    caption = "Response of each PV to a stem step of 1 %, by the fit that the swap rests on"
    caption += ", beside the simulated process linearised." if story.truth is not None else "."
    figure = draw_responses(outputs, story.record, story.truth, story.units)
    return Drawing("step_responses", "Identified process", caption, figure)


def _run_panels(story: Story, count: int, height: float) -> tuple[TimeAxis, list[Any], Any]:
    """Return panels over the whole run with the mode strip below them."""
    record = story.record
    time = TimeAxis.spanning(record.time[-1])
    figure, axes = panels(
        count + 1, 0.9 + height * count, ratios=[1.0] * count + [_STRIP], sharex=True
    )
    column = list(axes[:, 0])
    _draw_modes(column[-1], story, time)
    column[-1].set_xlabel(time.label)
    column[-1].set_xlim(0.0, time(record.time[-1]))
    for number, axis in enumerate(column):
        mark_swap(axis, _swap(story, time), "swap" if number == 0 else "")
    return time, column[:-1], figure


def _draw_modes(axis: Any, story: Story, time: TimeAxis) -> None:
    """Draw the controller's mode as a coloured strip, and a tick for every new model."""
    log, end = story.log, float(story.record.time[-1])
    axis.set_yticks([])
    axis.grid(visible=False)
    axis.set_ylim(0.0, 1.0)
    axis.set_ylabel("mode", rotation=0, ha="right", va="center")
    stretches: list[tuple[str, float]] = []
    for change in log.modes:
        at = max(log.seconds(change.stamp), 0.0)
        if stretches and stretches[-1][0] == change.mode:
            axis.axvline(time(at), color=GREY, linewidth=1.2)
        else:
            stretches.append((change.mode, at))
    if not stretches:
        axis.text(0.0, 0.46, " not recorded", va="center", fontsize=9, color=GREY)
    ends = [*(start for _, start in stretches), end][1:]
    for (mode, start), stop in zip(stretches, ends, strict=True):
        axis.axvspan(time(start), time(stop), color=MODE_COLOURS.get(mode, "#EEEEEE"), zorder=0)
        if stop - start > 0.06 * end:
            axis.text(
                time(start) + 0.008 * time(end), 0.46, mode, va="center", fontsize=9, color=INK
            )


def _draw_stems(axis: Any, story: Story, valve: int, at: FloatArray, part: slice) -> None:
    truth, estimate = story.record.stem, story.log.stem_estimate
    draw_valve(
        axis,
        at,
        story.record.op[part, valve],
        None if truth is None else truth[part, valve],
        None if estimate is None else estimate[part, valve],
    )


def _friction_limits(values: FloatArray) -> tuple[float, float]:
    """Return limits around ``values``; at least 0.5 % apart, so that nothing looks like much."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = max(0.12 * (high - low), (0.5 - (high - low)) / 2)
    return max(low - room, 0.0), max(high + room, 0.5)


def _draw_trusted(axis: Any, story: Story, name: str, time: TimeAxis) -> None:
    """Draw what the estimator trusted as a step line from the first trust on."""
    log = story.log
    points = [(log.seconds(f.stamp), f.trusted.get(name, math.nan)) for f in log.fits]
    if not any(math.isfinite(value) for _, value in points):
        return
    points.append((float(story.record.time[-1]), points[-1][1]))
    axis.step(
        time([at for at, _ in points]),
        [value for _, value in points],
        where="post",
        color=GREEN,
        linewidth=2.2,
        alpha=0.8,
        label="trusted",
    )


def _swap(story: Story, time: TimeAxis) -> float | None:
    return None if story.swap_time is None else float(time(story.swap_time))


def _sticky(story: Story) -> list[int]:
    """Return the valves to look at: those found to have friction, else all."""
    verdicts = {v["name"]: v["verdict"] for v in story.identified.get("valves", [])}
    kinds = (VerdictKind.STICKY, VerdictKind.BACKLASH)
    found = [j for j, n in enumerate(story.record.valves) if verdicts.get(n) in kinds]
    return found or list(range(len(story.record.valves)))


def _unit(story: Story, name: str) -> str:
    return f" ({story.units[name]})" if name in story.units else ""


def _with_unit(story: Story, name: str) -> str:
    return f"{name}{_unit(story, name) or ' (PV units)'}"
