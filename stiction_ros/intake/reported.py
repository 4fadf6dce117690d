"""Signals that were reported when they changed, brought onto a regular grid.

OP, SP and modes hold until the next report; PV goes straight from report to report.
"""

import dataclasses
import math
from collections.abc import Mapping

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.repairs import Rules
from stiction_ros.intake.tables.block import Block, FlagArray, Key
from stiction_ros.records.record import Quality
from stiction_ros.records.regular import GAP
from stiction_ros.texts import plural

COVERED = 0.75  # share of all stamps that OP and PV each have if they were sampled together
ON_GRID = 0.9  # share of the steps that are multiples of the smallest, from which there is a scan
DENSEST = 10.0  # samples for one report of the signal that is reported most, at most
QUIET = 60  # samples that a signal may stay without a report before it counts as a gap


def is_reported(block: Block) -> bool:
    """Return whether OP and PV came at stamps of their own."""
    there = block.own_mask() != Quality.BAD
    if not there.any():
        return False
    signals = block.of("op", "pv").values()
    return min(float(np.mean(~column.blank[there])) for column in signals) < COVERED


def at_pv(block: Block, rules: Rules) -> Block | None:
    """Return the rows of PV with what every other signal was last, or None.

    So nothing measured is moved where each tag is asked as often as the other on a clock of its
    own. It is None where there are several PV, or PV has fewer stamps than another signal.
    """
    stamps, outputs = _reports(block), list(block.of("pv"))
    if len(outputs) != 1 or len(stamps[outputs[0]]) < COVERED * max(map(len, stamps.values())):
        return None
    begin = max((stamps[key][0] for key in block.of("op") if len(stamps[key])), default=0)
    time = stamps[outputs[0]]
    time = time[time >= begin]
    if len(time) < 2:
        return None
    rules.tell(
        f"OP and PV have stamps of their own: taken at the {len(time)} of PV, with the last value "
        "of OP and SP at each",
        "leave --strict out, or export all tags at the same times",
    )
    of_op = [at for key in block.of("op") if len(at := stamps[key])]
    step = float(np.median(np.diff(time)))
    ages = [time - at[np.searchsorted(at, time, side="right") - 1] for at in of_op]
    held = np.max(ages, axis=0) > 1.5 * step  # none came since the row before
    return _at(block, stamps, time, step, held)


def on_grid(block: Block, sample_time: float | None, rules: Rules) -> list[Block]:
    """Return a block with regular stamps for each stretch without a gap.

    Signals are blank where nothing was reported. A sample time of None is the stamps' scan, s.
    """
    stamps = _reports(block)
    needed = {key: stamps[key] for key in block.of("op", "pv")}
    counts, least = [], []
    for key, at in needed.items():
        column = block.columns[key]
        values = column.values[np.isfinite(column.values)]
        if min(len(values), len(at)) < 2:
            said = f"{column.name} has {plural(len(values), 'value')}"
            raise InputError(said, fix="export a longer time")
        moves = np.abs(np.diff(values))
        smallest = np.min(moves[moves > 0], initial=np.inf)
        counts.append(f"{column.name} {len(at)}")
        least.append(f"{column.name} {smallest if np.isfinite(smallest) else 0.0:.3g}")
    step = sample_time or _scan(list(needed.values()))
    begin = max(float(at[0]) for at in needed.values())
    every = np.unique(np.concatenate(list(needed.values())))
    every = every[every >= begin - 1e-9]
    if len(every) < 2:
        raise InputError("OP and PV were not kept at the same time")
    steps = np.diff(every)
    longest = max(GAP * float(np.percentile(steps, 99.0)), QUIET * step)
    stretches = np.split(every, np.flatnonzero(steps > longest) + 1)
    found = []
    for first, last in ((one[0], one[-1]) for one in stretches if len(one) > 1):
        time = first + step * np.arange(math.floor((last - first) / step + 1e-6) + 1)
        far = []  # from every report
        for at in needed.values():
            after = np.minimum(np.searchsorted(at, time + 1e-6 * step, side="right"), len(at) - 1)
            around = at[np.maximum(after - 1, 0)], at[after]
            far.append(np.min(np.abs(np.subtract(around, time)), axis=0) > 0.5 * step)
        found.append(_at(block, stamps, time, step, np.any(far, axis=0)))
    samples = sum(len(one.time) for one in found)
    rules.tell(
        f"reports when values changed ({', '.join(counts)}) brought onto {samples} samples of "
        f"{step:.6g} s, OP and SP held, PV interpolated; lost is what moved less than was reported "
        f"({', '.join(least)})",
        "leave --strict out, or export at a fixed interval",
    )
    return found


def _reports(block: Block) -> dict[Key, FloatArray]:
    """Return the times at which each signal was reported."""
    return {key: block.time[~column.blank] for key, column in block.columns.items()}


def _at(
    block: Block, stamps: Mapping[Key, FloatArray], time: FloatArray, step: float, held: FlagArray
) -> Block:
    """Return samples at some times: PV and stem straight between reports, others as they were last.

    A sample has the quality of the row before it; of good ones some are ``held``.
    """
    until = time + 1e-6 * step
    columns = {}
    for key, at in stamps.items():
        given = block.columns[key].values[~block.columns[key].blank]
        there = np.isfinite(given)
        if not there.any():
            continue
        before = np.searchsorted(at, until, side="right") - 1
        values = np.where(before < 0, np.nan, given[np.maximum(before, 0)])
        if key.signal in ("pv", "stem"):
            between = np.interp(time, at[there], given[there])
            values = np.where(np.isfinite(values), between, np.nan)
        columns[key] = dataclasses.replace(block.columns[key], values=values, blank=before < 0)
    rows = np.maximum(np.searchsorted(block.time, until, side="right") - 1, 0)
    mask = block.own_mask()[rows]
    mask[held & (mask == Quality.GOOD)] = Quality.HELD
    return dataclasses.replace(block.rows(rows), time=time, columns=columns, mask=mask)


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
