"""What OP is counted in, and whether PV and OP may have been swapped."""

import dataclasses
import itertools
import shlex
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import TO_PERCENT, OpUnit, known_op_unit
from stiction_ros.intake.sheets.names import OR_ROW
from stiction_ros.intake.tables.block import Block, Column
from stiction_ros.intake.words import WORDS
from stiction_ros.signals.tracking import FEWEST, explained, is_nearer

PERCENT = (-10.0, 110.0)  # what an OP in % stays within
OFTEN = 0.1  # share of the samples outside of that from which it is told
CURRENT = (3.8, 20.5)  # what an OP in mA stays within
FOLLOWS = 0.9  # share of the moves of a controller's output that its law explains, at least
LEADS = 8.0  # how many times more the law leaves unexplained the other way round, at least

STRIDES = (1, 2, 4, 8)
"""Samples over which moves are looked at; one of them is enough.

Rounding and compression hide the law from sample to sample: their part of a move stays the same
while the move grows. Of the field's loops 1 in 160 is called swapped as it is, and half of those
that are.
"""

SAID = {unit: WORDS["op_ranges"][unit][2] for unit in TO_PERCENT}  # units as notes say
SEVERAL = frozenset(WORDS["several"])  # units of OP of which several ranges are usual
OWN = "its own unit"  # what stands for the unit of an OP that is not known to be in %
EXAMINED = 20_000  # samples that are looked at


def in_percent(block: Block, given: OpUnit | None, *, named: bool) -> tuple[Block, str, str]:
    """Return the block with OP and stem in %, the unit, and a note on what was done.

    A user or a tag list may have ``given`` the unit, and a user may have ``named`` the columns.

    Raises:
        InputError: OP lies between 0 and 1 and nothing says what it is, or far outside of the unit
            that it is said to have.
    """
    ops = list(block.of("op").values())
    for column in () if given else ops:
        if column.unit.casefold() in SEVERAL:
            raise InputError(
                f"{column.name} is in {column.unit}; several ranges are usual for this unit",
                fix="say which with --op-unit 0-10v, --op-unit 1-5v or --op-unit 2-10v, or take "
                f"OP as it is with --op-unit other {OR_ROW}",
            )
    unit = given or next((known_op_unit(column.unit) for column in ops if column.unit), None)
    if unit is OpUnit.OTHER:
        return block, OWN, ""
    if unit is None:
        return block, *_without_unit(ops)
    factor, offset = TO_PERCENT[unit]
    notes = [_fits(block, unit, given=given is not None, named=named)]
    if unit is not OpUnit.PERCENT:
        notes.insert(0, f"OP of {SAID[unit]} brought to %")
        columns = {
            key: dataclasses.replace(column, values=factor * column.values + offset)
            for key, column in block.of("op", "stem").items()
        }
        block = block.with_columns(columns)
    return block, "%", "; ".join(filter(None, notes))


def _without_unit(ops: Sequence[Column]) -> tuple[str, str]:
    """Return the unit of an OP that bears none, by its values, and a note where it is unclear."""
    values = [op.values for op in ops if np.isfinite(op.values).any()]
    low = min((float(np.nanmin(v)) for v in values), default=0.0)
    high = max((float(np.nanmax(v)) for v in values), default=0.0)
    if 0.0 <= low < high <= 1.0:
        raise InputError(
            f"OP lies between {low:.3g} and {high:.3g}: a share of travel, or %",
            fix=f"say which with --op-unit share or --op-unit percent {OR_ROW}",
        )
    said = f"OP lies between {low:.3g} and {high:.3g}"
    if CURRENT[0] <= low < high <= CURRENT[1]:
        return "%", (f"{said} and bears no unit: taken as %; if it is a current say --op-unit ma")
    if -1.5 <= low < 0.0 and high <= 1.5:
        return OWN, (
            f"{said}, perhaps without its mean: frictions are in its own unit; if it is a share "
            "say --op-unit share"
        )
    return "%" if PERCENT[0] <= low and high <= PERCENT[1] else OWN, ""


def _fits(block: Block, unit: OpUnit, *, given: bool, named: bool) -> str:
    """Return a note where OP often lies below its unit, as one without its mean does."""
    factor, offset = TO_PERCENT[unit]
    note = ""
    said = f"though {'OP is said to be in' if given else 'the export says'} {SAID[unit]}"
    for column in block.of("op").values():
        values = column.values[np.isfinite(column.values)]
        if not len(values):
            continue
        percent, shown = factor * values + offset, f"{values.min():.4g} to {values.max():.4g}"
        middle, above = float(np.median(percent)), float(np.mean(percent > PERCENT[1]))
        if not PERCENT[0] <= middle <= PERCENT[1] or above >= OFTEN:
            reason = f"{column.name} holds {shown}, median {np.median(values):.4g}, {said}"
            if not named:
                refuse_swapped(block, "--op-unit", "other")
            out = "leave --op-unit out or say another one" if given else "say another --op-unit"
            raise InputError(reason, fix=f"{out}; --op-unit other takes OP as it is")
        if float(np.mean(percent < PERCENT[0])) >= OFTEN:
            note = (
                f"{column.name} holds {shown}, {said}: perhaps without its mean, or no OP; "
                "--op-unit other takes it as it is"
            )
    return note


def refuse_twice(block: Block) -> None:
    """Raise an :class:`InputError` where PV is OP at every sample, or one column is named twice."""
    for (key, one), (also, other) in itertools.combinations(block.of("op", "pv").items(), 2):
        there = one.values[np.isfinite(one.values)]
        moves, named = np.any(there != there[:1]), one.name == other.name
        alike = np.array_equal(one.values, other.values, equal_nan=True)
        if moves and alike and (named or key.signal != also.signal):
            raise InputError(
                f"one signal is given twice: {other.name} is {one.name} at all of "
                f"{len(block.time)} samples",
                fix=f"name each with --{key.signal} {key.tag}=COLUMN --{also.signal} "
                f"{also.tag}=COLUMN, or the tag with --tags F; export the one that is missing",
            )


def refuse_swapped(block: Block, *otherwise: str) -> None:
    """Raise an :class:`InputError` when PV and OP look swapped; options are for those that are not.

    Where a set-point is recorded, the measurement is what stays near it. Else:
    In closed loop a controller's output moves by K (Δe + T_s/T_i e): its Δ is explained by the
    measurement and its Δ at the same sample, and not the other way round. What rounding and
    compression hide of that shows over some samples, see :data:`STRIDES`.
    """
    op, pv, sp = (_only(block, signal) for signal in ("op", "pv", "sp"))
    if op is None or pv is None or (sp is None and block.of("sp")):
        return
    known = [values for _, values in (op, pv, *([sp] if sp else []))]
    there = np.isfinite(known).all(axis=0)
    if np.count_nonzero(there) < FEWEST:
        return
    output, measured, *rest = (values[there] for values in known)
    if sp is not None:
        if is_nearer(rest[0], output, measured):
            said = f"{op[0]} stays near the set-point {sp[0]}, {pv[0]} does not"
            raise _swapped(block, said, otherwise)
        return
    for stride in STRIDES:
        right = explained(output, measured[:, None], stride)
        wrong = explained(measured, output[:, None], stride)
        if wrong > FOLLOWS and 1.0 - right > LEADS * (1.0 - wrong):
            said = f"{pv[0]} moves as a controller's output would, by {op[0]}"
            raise _swapped(block, said, otherwise)


def _swapped(block: Block, reason: str, otherwise: Sequence[str]) -> InputError:
    """Return the error of a block whose one OP and one PV look swapped."""
    tag, name = {}, {}
    for key, column in block.columns.items():
        tag[key.signal], name[key.signal] = key.tag, column.name

    def options(op: str, pv: str) -> list[str]:
        return ["--op", f"{tag['op']}={op}", "--pv", f"{tag['pv']}={pv}"]

    exchanged = shlex.join(options(name["pv"], name["op"]))
    as_they_are = shlex.join([*options(name["op"], name["pv"]), *otherwise])
    return InputError(
        f"OP and PV look swapped: {reason}",
        fix=f"name them, {exchanged}, or as they are, {as_they_are} {OR_ROW}",
    )


def _only(block: Block, signal: str) -> tuple[str, FloatArray] | None:
    """Return name and values of the one signal of its kind; None when there are others."""
    found = list(block.of(signal).values())
    return (found[0].name, found[0].values[:EXAMINED]) if len(found) == 1 else None
