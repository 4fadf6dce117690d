"""What OP is counted in, and whether PV and OP may have been swapped."""

from __future__ import annotations

import dataclasses
import shlex

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.intake_options import TO_PERCENT, OpUnit, known_op_unit
from stiction_ros.intake.sheets.names import OR_ROW
from stiction_ros.intake.tables.block import Block
from stiction_ros.intake.words import WORDS as SAID

PERCENT = (-10.0, 110.0)
"""What an OP in % stays within."""

OFTEN = 0.1
"""Share of the samples outside of that from which it is told."""

CURRENT = (3.8, 20.5)
"""What an OP in mA stays within."""

FOLLOWS = 0.9
"""Share of the moves of a controller's output that its law explains, at least."""

LEADS = 8.0
"""How many times more the law leaves unexplained the other way round, at least."""

STRIDES = (1, 2, 4, 8)
"""Samples over which moves are looked at; one of them is enough.

Rounding and compression hide the law from sample to sample: their part of a move stays the same
while the move grows. Of the field's loops 1 in 160 is called swapped as it is, and half of those
that are.
"""

WORDS = {
    OpUnit.PERCENT: "%",
    OpUnit.SHARE: "0 to 1",
    OpUnit.CURRENT: "4 to 20 mA",
    OpUnit.PSI: "3 to 15 psi",
    OpUnit.BAR: "0.2 to 1 bar",
    OpUnit.KILOPASCAL: "20 to 100 kPa",
    OpUnit.VOLT_10: "0 to 10 V",
    OpUnit.VOLT_1_5: "1 to 5 V",
    OpUnit.VOLT_2_10: "2 to 10 V",
}
"""Units of an OP as notes name them."""

SEVERAL = frozenset(SAID["several"])
"""Units of OP of which several ranges are usual."""

OWN = "its own unit"
"""What stands for the unit of an OP that is not known to be in %."""

EXAMINED = 20_000
"""Samples that are looked at."""

FEWEST = 50
"""Samples from which anything is told of a swap."""

CLOSER, OFFSET, TRACKED = 0.1, 0.3, 0.7
"""How much nearer to the set-point than the other the measurement is, as a share; its lasting
offset as a share of its error's standard deviation; its error as a share of the set-point's."""


def in_percent(
    block: Block, given: OpUnit | None, *, named: bool = False
) -> tuple[Block, str, str]:
    """Return the block with OP and stem in %, the unit, and a note on what was done.

    Args:
        block: as read.
        given: unit that a user or a tag list says; None takes the export's word.
        named: whether a user said which column is what.

    Raises:
        InputError: OP lies between 0 and 1 and nothing says what it is, or far outside of the unit
            that it is said to have.
    """
    units = [
        known_op_unit(column.unit)
        for key, column in block.columns.items()
        if key.signal == "op" and column.unit
    ]
    unit = given or (units[0] if units else None)
    for key, column in block.columns.items():
        if not given and key.signal == "op" and column.unit.casefold() in SEVERAL:
            raise InputError(
                f"{column.name} is in {column.unit}, of which several ranges are usual",
                where=str(block.path),
                fix="say which with --op-unit 0-10v, --op-unit 1-5v or --op-unit 2-10v, or take "
                f"OP as it is with --op-unit other {OR_ROW}",
            )
    ops = [column.values for key, column in block.columns.items() if key.signal == "op"]
    note = ""
    if unit is None:
        low = min((float(np.nanmin(v)) for v in ops if np.isfinite(v).any()), default=0.0)
        high = max((float(np.nanmax(v)) for v in ops if np.isfinite(v).any()), default=0.0)
        if 0.0 <= low < high <= 1.0:
            raise InputError(
                f"OP lies between {low:.3g} and {high:.3g}: a share of travel, or %",
                where=str(block.path),
                fix=f"say which with --op-unit share or --op-unit percent {OR_ROW}",
            )
        centred = low < 0.0 and low >= -1.5 and high <= 1.5
        if centred:
            note = (
                f"OP lies between {low:.3g} and {high:.3g}, perhaps without its mean: frictions "
                "are in its own unit; if it is a share say --op-unit share"
            )
        if CURRENT[0] <= low < high <= CURRENT[1]:
            note = (
                f"OP lies between {low:.3g} and {high:.3g} and bears no unit: taken as %; if it is "
                "a current say --op-unit ma"
            )
        usual = PERCENT[0] <= low and high <= PERCENT[1]
        pv = _only(block, "pv")
        if not usual and not named and pv is not None and _like_percent(pv[1]):
            note = (
                f"OP lies between {low:.4g} and {high:.4g} and bears no unit, {pv[0]} lies as an "
                "OP in % would: look whether they are swapped"
            )
        return block, "%" if usual and not centred else OWN, note
    factor, offset = TO_PERCENT[unit]
    if unit is OpUnit.OTHER:
        return block, OWN, ""
    note = _fits(block, unit, given=given is not None, named=named)
    if (factor, offset) == (1.0, 0.0):
        return block, "%", note
    columns = {
        key: dataclasses.replace(column, values=factor * column.values + offset)
        if key.signal in ("op", "stem")
        else column
        for key, column in block.columns.items()
    }
    notes = (f"OP of {WORDS[unit]} brought to %", note)
    return dataclasses.replace(block, columns=columns), "%", "; ".join(filter(None, notes))


def _fits(block: Block, unit: OpUnit, *, given: bool, named: bool) -> str:
    """Return a note where OP often lies below its unit, as one without its mean does.

    Args:
        block: as read.
        unit: of its OP.
        given: whether a user says so, else the export.
        named: whether a user said which column is OP.

    Raises:
        InputError: the median, or many samples, lie outside of the unit.
    """
    factor, offset = TO_PERCENT[unit]
    note, by = "", "OP is said to be in" if given else "the export says"
    for key, column in block.columns.items():
        values = column.values[np.isfinite(column.values)]
        if key.signal != "op" or not len(values):
            continue
        percent, shown = factor * values + offset, f"{values.min():.4g} to {values.max():.4g}"
        middle, word = float(np.median(percent)), WORDS[unit]
        above = float(np.mean(percent > PERCENT[1]))
        if not PERCENT[0] <= middle <= PERCENT[1] or above >= OFTEN:
            said = (
                f"{column.name} holds {shown}, median {np.median(values):.4g}, though {by} {word}"
            )
            if not named:
                _refuse_by_values(block, said)
            out = "leave --op-unit out or say another one" if given else "say another --op-unit"
            fix = f"{out}; --op-unit other takes OP as it is"
            raise InputError(said, where=str(block.path), fix=fix)
        if float(np.mean(percent < PERCENT[0])) >= OFTEN:
            note = (
                f"{column.name} holds {shown}, though {by} {word}: perhaps without its mean, or no "
                "OP; --op-unit other takes it as it is"
            )
    return note


def _refuse_by_values(block: Block, said: str) -> None:
    """Raise where OP is outside of its unit and PV would be a usual OP in %.

    Args:
        block: as read.
        said: what is wrong with OP.

    Raises:
        InputError: OP and PV look swapped.
    """
    op, pv = _only(block, "op"), _only(block, "pv")
    if op is None or pv is None:
        return
    if _like_percent(pv[1]):
        least, most = np.nanmin(pv[1]), np.nanmax(pv[1])
        reason = f"{said}, and {pv[0]} holds {least:.4g} to {most:.4g}"
        raise _swapped(block, reason, ("--op-unit", "other"))


def _like_percent(values: FloatArray) -> bool:
    there = values[np.isfinite(values)]
    return bool(len(there)) and PERCENT[0] <= there.min() and bool(there.max() <= PERCENT[1])


def refuse_twice(block: Block) -> None:
    """Raise where PV is OP at every sample, as when one tag is listed for both.

    Raises:
        InputError: one signal is given twice.
    """
    for op, output in block.columns.items():
        for pv, measured in block.columns.items():
            if (op.signal, pv.signal) != ("op", "pv"):
                continue
            there = output.values[np.isfinite(output.values)]
            if np.any(there != there[:1]) and np.array_equal(
                output.values, measured.values, equal_nan=True
            ):
                raise InputError(
                    f"one signal is given twice: {measured.name} is {output.name} at all of "
                    f"{len(block.time)} samples",
                    where=str(block.path),
                    fix=f"name each with --op {op.tag}=COLUMN --pv {pv.tag}=COLUMN, or "
                    "the tag with --tags F; export the one that is missing",
                )


def refuse_swapped(block: Block) -> None:
    """Raise when PV and OP look swapped.

    Where a set-point is recorded, the measurement is what stays near it. Else:
    In closed loop a controller's output moves by K (Δe + T_s/T_i e): its Δ is explained by the
    measurement and its Δ at the same sample, and not the other way round. What rounding and
    compression hide of that shows over some samples, see :data:`STRIDES`. Of exact controllers
    :mod:`stiction_ros.identification.problem.input_checks` knows more.

    Raises:
        InputError: OP and PV look swapped.
    """
    op, pv = _only(block, "op"), _only(block, "pv")
    if op is None or pv is None:
        return
    if any(key.signal == "sp" for key in block.columns):
        sp = _only(block, "sp")
        if sp is not None and _stays_near(sp[1], op[1], pv[1]):
            raise _swapped(block, f"{op[0]} stays near the set-point {sp[0]}, {pv[0]} does not")
        return
    for stride in STRIDES:
        right, wrong = _explained(op[1], pv[1], stride), _explained(pv[1], op[1], stride)
        if wrong > FOLLOWS and 1.0 - right > LEADS * (1.0 - wrong):
            raise _swapped(block, f"{pv[0]} moves as a controller's output would, by {op[0]}")


def _stays_near(sp: FloatArray, one: FloatArray, other: FloatArray) -> bool:
    """Return whether ``one`` is :data:`CLOSER` to the set-point, and it alone without an offset.

    Where neither has a lasting offset, as in signals without their means, the unit alone may make
    the one smaller.
    """
    there = np.isfinite(sp) & np.isfinite(one) & np.isfinite(other)
    if np.count_nonzero(there) < FEWEST:
        return False
    near, far = one[there] - sp[there], other[there] - sp[there]
    size = float(np.sqrt(np.mean(near**2)))
    if size > CLOSER * float(np.sqrt(np.mean(far**2))) or not np.ptp(other[there]) > 0.0:
        return False
    if _centred(far):
        return False
    return _centred(near) or size <= TRACKED * float(sp[there].std())


def _centred(error: FloatArray) -> bool:
    return abs(float(error.mean())) <= OFFSET * float(error.std())


def _swapped(block: Block, reason: str, otherwise: tuple[str, ...] = ()) -> InputError:
    """Return the error of a block whose one OP and one PV look swapped.

    Args:
        block: as read.
        reason: why.
        otherwise: what to say, too, if they are not.
    """
    op, pv = (
        next(
            (key.tag, column.name) for key, column in block.columns.items() if key.signal == signal
        )
        for signal in ("op", "pv")
    )
    exchanged = shlex.join(["--op", f"{op[0]}={pv[1]}", "--pv", f"{pv[0]}={op[1]}"])
    same = ["--op", f"{op[0]}={op[1]}", "--pv", f"{pv[0]}={pv[1]}", *otherwise]
    as_they_are = shlex.join(same)
    return InputError(
        f"OP and PV look swapped: {reason}",
        where=str(block.path),
        fix=f"name them, {exchanged}, or as they are, {as_they_are} {OR_ROW}",
    )


def _only(block: Block, signal: str) -> tuple[str, FloatArray] | None:
    """Return name and values of the one signal of its kind; None when there are others."""
    found = [column for key, column in block.columns.items() if key.signal == signal]
    return (found[0].name, found[0].values[:EXAMINED]) if len(found) == 1 else None


def _explained(output: FloatArray, measured: FloatArray, stride: int) -> float:
    """Return which share of the moves of ``output`` over some samples a PI law explains.

    Args:
        output: shape (N,).
        measured: shape (N,).
        stride: samples that a move takes.
    """
    there = np.isfinite(output) & np.isfinite(measured)
    u, y = output[there], measured[there]
    if len(u) < FEWEST:
        return 0.0
    moves = u[stride:] - u[:-stride]
    total = np.cumsum(y)
    rows = np.column_stack(
        [y[stride:] - y[:-stride], total[stride:] - total[:-stride], np.ones(len(moves))]
    )
    spread = float(((moves - moves.mean()) ** 2).sum())
    if spread <= 0.0:
        return 0.0
    solution, *_ = np.linalg.lstsq(rows, moves, rcond=None)
    rest = float(((moves - rows @ solution) ** 2).sum())
    return 1.0 - rest / spread
