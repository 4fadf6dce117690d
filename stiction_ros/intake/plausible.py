"""What OP is counted in, and whether PV and OP may have been swapped."""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.intake.options import TO_PERCENT, OpUnit, known_op_unit
from stiction_ros.intake.tables.block import Block

PERCENT = (-10.0, 110.0)
"""What an OP in % stays within."""

FOLLOWS = 0.9
"""Share of the moves of a controller's output that its law explains, at least."""

LEADS = 3.0
"""How many times more the law leaves unexplained the other way round, at least.

With both, 1 in 160 loops of the field is called swapped as it is, and a third of those that are:
rounding, compression and strong proportional action hide the rest.
"""

EXAMINED = 20_000
"""Samples that are looked at."""


def in_percent(block: Block, given: OpUnit | None) -> tuple[Block, str, str]:
    """Return the block with OP and stem in %, the unit, and a note on what was done.

    Args:
        block: as read.
        given: unit that a user or a tag list says; None takes the export's word.

    Raises:
        InputError: OP lies between 0 and 1 and nothing says what it is.
    """
    units = [
        known_op_unit(column.unit)
        for key, column in block.columns.items()
        if key.signal == "op" and column.unit
    ]
    unit = given or (units[0] if units else None)
    ops = [column.values for key, column in block.columns.items() if key.signal == "op"]
    note = ""
    if unit is None:
        low = min((float(np.nanmin(v)) for v in ops if np.isfinite(v).any()), default=0.0)
        high = max((float(np.nanmax(v)) for v in ops if np.isfinite(v).any()), default=0.0)
        if 0.0 <= low < high <= 1.0:
            raise InputError(
                f"OP lies between {low:.3g} and {high:.3g}: a share of travel, or %",
                where=str(block.path),
                fix="say which with --op-unit share or --op-unit percent",
            )
        if low < 0.0 and low >= -1.5 and high <= 1.5:
            note = (
                f"OP lies between {low:.3g} and {high:.3g}, perhaps without its mean: frictions "
                "are in its own unit; if it is a share say --op-unit share"
            )
        usual = PERCENT[0] <= low and high <= PERCENT[1]
        return block, "%" if usual else "its own unit", note
    factor, offset = TO_PERCENT[unit]
    if unit is OpUnit.OTHER:
        return block, "its own unit", ""
    if (factor, offset) == (1.0, 0.0):
        return block, "%", ""
    columns = {
        key: dataclasses.replace(column, values=factor * column.values + offset)
        if key.signal in ("op", "stem")
        else column
        for key, column in block.columns.items()
    }
    word = "0 to 1" if unit is OpUnit.SHARE else "4 to 20 mA"
    return dataclasses.replace(block, columns=columns), "%", f"OP of {word} brought to %"


def refuse_swapped(block: Block) -> None:
    """Raise when PV and OP look swapped.

    In closed loop a controller's output moves by K (Δe + T_s/T_i e): its Δ is explained by the
    measurement and its Δ at the same sample, and not the other way round. Rounding and
    compression leave some of that. Of records with a set-point, and of exact controllers,
    :mod:`stiction_ros.identification.problem.input_checks` knows more.

    Raises:
        InputError: OP and PV look swapped.
    """
    op, pv = _only(block, "op"), _only(block, "pv")
    if op is None or pv is None or any(key.signal == "sp" for key in block.columns):
        return
    right, wrong = _explained(op[1], pv[1]), _explained(pv[1], op[1])
    if wrong > FOLLOWS and 1.0 - right > LEADS * (1.0 - wrong):
        tags = {key.signal: key.tag for key in block.columns}
        raise InputError(
            f"OP and PV look swapped: {pv[0]} moves as a controller's output would, by {op[0]}",
            where=str(block.path),
            fix=f"name them, --op {tags['op']}={pv[0]} --pv {tags['pv']}={op[0]}, or as they are, "
            f"--op {tags['op']}={op[0]} --pv {tags['pv']}={pv[0]}",
        )


def _only(block: Block, signal: str) -> tuple[str, FloatArray] | None:
    """Return name and values of the one signal of its kind; None when there are others."""
    found = [column for key, column in block.columns.items() if key.signal == signal]
    return (found[0].name, found[0].values[:EXAMINED]) if len(found) == 1 else None


def _explained(output: FloatArray, measured: FloatArray) -> float:
    """Return which share of the moves of ``output`` a PI law on ``measured`` explains."""
    there = np.isfinite(output) & np.isfinite(measured)
    u, y = output[there], measured[there]
    if len(u) < 50:
        return 0.0
    moves = np.diff(u)
    rows = np.column_stack([np.diff(y), y[1:], np.ones(len(moves))])
    spread = float(((moves - moves.mean()) ** 2).sum())
    if spread <= 0.0:
        return 0.0
    solution, *_ = np.linalg.lstsq(rows, moves, rcond=None)
    rest = float(((moves - rows @ solution) ** 2).sum())
    return 1.0 - rest / spread
