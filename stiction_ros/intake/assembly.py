"""The records of one loop from its blocks."""

import dataclasses
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError, foreign
from stiction_ros.intake import repairs
from stiction_ros.intake.clocks import put_right
from stiction_ros.intake.intake_options import IntakeOptions
from stiction_ros.intake.loop import Loop, signals_of_blocks
from stiction_ros.intake.modes import manual_marked
from stiction_ros.intake.plausible import in_percent, refuse_swapped, refuse_twice
from stiction_ros.intake.reported import at_pv, is_reported, on_grid
from stiction_ros.intake.tables.block import Block, joined
from stiction_ros.records.parts import ALIKE
from stiction_ros.records.record import Quality, Record
from stiction_ros.records.whole import Whole, carried
from stiction_ros.texts import plural


@dataclasses.dataclass(frozen=True)
class Found:
    """What was read of one loop."""

    name: str
    record: str  # name of its records
    blocks: tuple[Block, ...]
    named: bool = False  # whether a user said which column is what
    shared: bool = False  # whether other loops stand in the same rows

    @property
    def files(self) -> tuple[Path, ...]:
        """Files of the blocks, each once."""
        return tuple(dict.fromkeys(block.path for block in self.blocks))


def loop_of(found: Found, options: IntakeOptions) -> Loop:
    """Return a loop with its records; InputError when it cannot be made into records, and why."""
    _refuse_incomplete(found)
    rules = repairs.Rules(options.strict, [note for one in found.blocks for note in one.notes])
    for note, block in {note: one for one in found.blocks for note in one.mended}.items():
        with foreign(block.path):
            rules.tell(note)
    timed = put_right(repairs.each(found.blocks, rules, repairs.with_times), rules)
    timed = repairs.each(timed, rules, partial(repairs.with_values, shared=found.shared))
    if len(timed) > 1:
        timed = repairs.each(timed, rules, lambda b, r: repairs.in_order(b, r, alone=False)[0])
    block, differing = joined(repairs.each(timed, rules, repairs.checked))
    for name, count in differing.items():
        said = f"{name}: {plural(count, 'value')} at a stamp that another table has differ"
        rules.tell(f"{said}: the later table counts", "leave one of them out")
    block = repairs.without_outliers(block, rules)
    refuse_twice(block)
    block, unit, note = in_percent(block, options.op_unit, named=found.named)
    rules.told.extend([note] if note else [])
    if not found.named:
        refuse_swapped(block)
    parts: list[Record] = []
    for run in repairs.in_order(block, rules):
        parts += _records(manual_marked(run, rules, options.automatic), found, options, rules)
    notes = dict.fromkeys(rules.told)
    whole = tuple(dataclasses.replace(part, notes=(*notes, *part.notes)) for part in parts)
    every = tuple(dict.fromkeys(note for part in whole for note in part.notes))
    return dataclasses.replace(
        unread(found, None, rules.modes), parts=whole, notes=every, op_unit=unit
    )


def unread(found: Found, problem: str | None, modes: Mapping[str, str] = {}) -> Loop:
    """Return a loop without records, with what stands in its columns, and the ``modes`` known."""
    return Loop(
        found.name, found.files, (), problem=problem, signals=signals_of_blocks(found.blocks, modes)
    )


def _refuse_incomplete(found: Found) -> None:
    there = {key.signal for block in found.blocks for key in block.columns}
    missing = [signal.upper() for signal in ("op", "pv") if signal not in there]
    if missing:
        names = ", ".join(c.name for block in found.blocks for c in block.columns.values())
        raise InputError(
            f"loop {found.name} has no {' and no '.join(missing)}, only {names}",
            fix="say which tags belong to it with --tags FILE",
        )


def _records(
    run: Block, found: Found, options: IntakeOptions, rules: repairs.Rules
) -> tuple[Record, ...]:
    told, wanted = len(rules.told), options.sample_time
    own = at_pv(run, rules) if is_reported(run) else run
    if own is not None:
        try:
            kept = _whole(own, found.record, rules).records()
            if wanted is None or all(abs(r.sample_time / wanted - 1.0) <= ALIKE for r in kept):
                return kept
        except InputError:
            mixed = own is not run or wanted is not None
            if not mixed and (options.strict or len(run.time) < 3):
                raise
    del rules.told[told:]
    parts: list[Record] = []
    stretches = on_grid(run, wanted, rules)
    for stretch in stretches:
        parts += _whole(stretch, found.record, rules).records()
    if len(stretches) > 1:
        rules.told.append(f"cut at {len(stretches) - 1} gaps without a report")
    return tuple(parts)


def _whole(block: Block, name: str, rules: repairs.Rules) -> Whole:
    tags = {signal: [key.tag for key in block.of(signal)] for signal in ("op", "pv")}
    if not all(tags.values()):
        raise InputError("has no OP or no PV left")
    signals: dict[str, FloatArray] = {}
    for signal, of in (("op", "op"), ("pv", "pv"), ("sp", "pv"), ("stem", "op")):
        columns = {key.tag: column for key, column in block.of(signal).items()}
        if columns.keys() != set(tags[of]):
            continue
        sparse = next((c for c in columns.values() if np.isnan(c.values).mean() > 0.5), None)
        if sparse is not None and signal != of:
            rules.tell(f"{sparse.name} is missing at more than half of the rows, left out")
            continue
        values = [columns[tag].values for tag in tags[of]]
        held = values if signal != "sp" else [carried(one, between=False) for one in values]
        signals[signal] = np.column_stack(held)
    whole = np.isfinite(np.hstack(list(signals.values()))).all(axis=1)
    lacking = ~whole & (block.own_mask() != Quality.BAD)
    if lacking.any() and rules.strict:
        rules.tell(f"{plural(int(lacking.sum()), 'sample')} without every value")
    return Whole(
        name=name,
        where=str(block.path),
        place=block.place,
        valves=tuple(tags["op"]),
        outputs=tuple(tags["pv"]),
        time=block.time - block.time[0],
        start=block.clock.start + float(block.time[0]),
        signals=signals,
        mask=block.mask,
    )
