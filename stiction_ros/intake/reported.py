"""Signals that were reported when they changed, brought onto a regular grid.

OP, SP and modes hold until the next report; PV goes straight from report to report, as in
records with missing rows. What is not known between two reports is lost, which is said. Tags
asked regularly, each on its own clock, are reports only in their stamps: PV keeps its values, and
OP holds, as a line through the stairs of OP gives another friction.
"""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.repairs import Rules, plural
from stiction_ros.intake.tables.block import Block, Column, Key
from stiction_ros.records.quality import Quality, QualityArray
from stiction_ros.records.regular import GAP

COVERED = 0.75
"""Share of all stamps that OP and PV each have, from which they were sampled together."""

ON_GRID = 0.9
"""Share of the steps that are multiples of the smallest, from which there is a scan."""

DENSEST = 10.0
"""Samples for one report of the signal that is reported most, at most."""

QUIET = 60
"""Samples that a signal may stay without a report before it counts as a gap."""


def is_reported(block: Block) -> bool:
    """Return whether OP and PV came at stamps of their own."""
    there = (
        np.ones(len(block.time), dtype=bool) if block.mask is None else block.mask != Quality.BAD
    )
    if not there.any():
        return False
    shares = [
        float(np.mean(~column.blank[there]))
        for key, column in block.columns.items()
        if key.signal in ("op", "pv")
    ]
    return min(shares) < COVERED


def at_pv(block: Block, rules: Rules) -> Block | None:
    """Return the rows of PV with what every other signal was last, or None.

    So nothing measured is moved where each tag is asked as often as the other on a clock of its
    own: PV has no value but its own, and OP is what the valve had been given.

    Args:
        block: as :func:`on_grid` takes it.
        rules: what was done is noted there.

    Returns:
        None where there are several PV, or PV has fewer stamps than another signal.
    """
    outputs = [key for key in block.columns if key.signal == "pv"]
    stamps = {key: _reports(block, column) for key, column in block.columns.items()}
    busiest = max(map(len, stamps.values()))
    if len(outputs) != 1 or len(stamps[outputs[0]]) < COVERED * busiest:
        return None
    begin = max((at[0] for key, at in stamps.items() if key.signal == "op" and len(at)), default=0)
    chosen = ~block.columns[outputs[0]].blank & (block.time >= begin)
    time = block.time[chosen]
    if len(time) < 2:
        return None
    mask: QualityArray = np.zeros(len(time), dtype=np.uint8)
    columns = {}
    for key, column in block.columns.items():
        at, values = stamps[key], column.values[~column.blank]
        if not len(at):
            continue
        before = np.searchsorted(at, time, side="right") - 1
        if key.signal == "op":  # none came since the row before
            mask[time - at[before] > 1.5 * float(np.median(np.diff(time)))] = Quality.HELD
        held = np.where(before < 0, np.nan, values[before])
        if key.signal == "mode":
            held = values[np.maximum(before, 0)]
        columns[key] = dataclasses.replace(column, values=held, blank=before < 0)
    if block.mask is not None:
        given = block.mask[chosen]
        mask = np.where(given != Quality.GOOD, given, mask)
    rules.tell(
        f"OP and PV have stamps of their own: taken at the {len(time)} of PV, with the last value "
        "of OP and SP at each",
        block,
        "OP and PV have stamps of their own",
        "leave --strict out, or export all tags at the same times",
    )
    return dataclasses.replace(
        block, time=time, lines=block.lines[chosen], columns=columns, mask=mask
    )


def on_grid(block: Block, sample_time: float | None, rules: Rules) -> list[Block]:
    """Return a block with regular stamps for each stretch without a gap.

    Args:
        block: signals at increasing stamps, blank where nothing was reported.
        sample_time: s; None takes the scan that the stamps show.
        rules: what was done is noted there.

    Raises:
        InputError: a signal has fewer than two reports, or strict.
    """
    stamps = {key: _reports(block, column) for key, column in block.columns.items()}
    needed = {key: at for key, at in stamps.items() if key.signal in ("op", "pv")}
    for key, at in needed.items():
        values = int(np.count_nonzero(np.isfinite(block.columns[key].values)))
        if min(values, len(at)) < 2:
            raise InputError(
                f"{block.columns[key].name} has {plural(values, 'value')}",
                where=str(block.path),
                fix="export a longer time",
            )
    step = sample_time or _scan(list(needed.values()))
    begin = max(float(at[0]) for at in needed.values())
    every = np.unique(np.concatenate(list(needed.values())))
    every = every[every >= begin - 1e-9]
    if len(every) < 2:
        raise InputError("OP and PV were not kept at the same time", where=str(block.path))
    steps = np.diff(every)
    longest = max(GAP * float(np.percentile(steps, 99.0)), QUIET * step)
    cuts = np.flatnonzero(steps > longest) + 1
    edges = [0, *cuts.tolist(), len(every)]
    stretches = [every[a:b] for a, b in itertools.pairwise(edges) if b - a > 1]
    found = [_regular(block, stamps, stretch, step) for stretch in stretches]
    samples = sum(len(one.time) for one in found)
    counts = ", ".join(f"{block.columns[key].name} {len(at)}" for key, at in needed.items())
    least = ", ".join(
        f"{block.columns[key].name} {_least(block.columns[key]):.3g}" for key in needed
    )
    rules.tell(
        f"reports when values changed ({counts}) brought onto {samples} samples of {step:.6g} s, "
        f"OP and SP held, PV interpolated; lost is what moved less than was reported ({least})",
        block,
        f"signals were reported when they changed ({counts})",
        "leave --strict out, or export at a fixed interval",
    )
    return found


def _reports(block: Block, column: Column) -> FloatArray:
    return np.asarray(block.time[~column.blank])


def _scan(stamps: list[FloatArray]) -> float:
    """Return the sample time that fits: the scan of the stamps, longer when it is very short."""
    busiest = max(stamps, key=len)
    everything = np.unique(np.round(np.concatenate(stamps), 6))
    steps = np.diff(everything)
    smallest = float(f"{np.percentile(steps, 2.0):.4g}")
    turns = steps / smallest
    usual = float(f"{np.median(np.diff(busiest)):.3g}")
    if np.mean(np.abs(turns - np.rint(turns)) < 0.1) < ON_GRID:
        return usual
    span = float(busiest[-1] - busiest[0])
    dense = span / smallest / (DENSEST * len(busiest))
    return smallest * max(math.ceil(dense), 1)


def _regular(
    block: Block, stamps: dict[Key, FloatArray], stretch: FloatArray, step: float
) -> Block:
    count = math.floor((stretch[-1] - stretch[0]) / step + 1e-6) + 1
    time = stretch[0] + step * np.arange(count)
    mask: QualityArray = np.zeros(count, dtype=np.uint8)
    columns = {}
    for key, column in block.columns.items():
        at = stamps[key]
        values = column.values[~column.blank]
        if not np.isfinite(values).any():
            continue
        after = np.searchsorted(at, time + 1e-6 * step, side="right")
        before = np.maximum(after - 1, 0)
        held = values[before]
        if key.signal in ("op", "pv"):
            near = np.minimum(
                np.abs(at[before] - time), np.abs(at[np.minimum(after, len(at) - 1)] - time)
            )
            mask[(near > 0.5 * step) & (mask == Quality.GOOD)] = Quality.HELD
        if key.signal in ("pv", "stem"):
            there = np.isfinite(values)
            held = np.where(np.isfinite(held), np.interp(time, at[there], values[there]), np.nan)
        columns[key] = dataclasses.replace(column, values=held, blank=np.zeros(count, dtype=bool))
    if block.mask is not None:
        rows = np.maximum(np.searchsorted(block.time, time + 1e-6 * step, side="right") - 1, 0)
        given = block.mask[rows]
        mask = np.where(given != Quality.GOOD, given, mask)
    return Block(
        path=block.path,
        row_word="sample",
        clock=block.clock,
        time=time,
        lines=np.arange(count),
        columns=columns,
        mask=mask,
    )


def _least(column: Column) -> float:
    moves = np.abs(np.diff(column.values[~column.blank & np.isfinite(column.values)]))
    moves = moves[moves > 0]
    return float(moves.min()) if len(moves) else 0.0
