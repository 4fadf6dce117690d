"""A record and its identified process in units of their own movement.

OP and PV about their means over their standard deviations: what is computed in these units does
not depend on those of the record.
"""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.result import OutputModel
from stiction_ros.loop.linear_loops import Pairs, Process
from stiction_ros.records.record import Record
from stiction_ros.signals.arx import driven
from stiction_ros.signals.polynomials import recursion

# decimals that are kept of scaled numbers: a valve that slips a sample later for the last bits of a
# unit would make another run of it, and with it another verdict
DIGITS = 7
EXACT = 9  # decimals where a run has to repeat the record: frictions lie as close to what OP passes
# samples of a record that are looked at: thousands of cycles say no more than hundreds
LONGEST = 20_000


@dataclasses.dataclass(frozen=True)
class ScaledLoop:
    """Signals of one record, scaled."""

    op: FloatArray  # op, stem: shape (N, m), by the same means and scales
    stem: FloatArray
    pv: FloatArray  # shape (N, p)
    sp: FloatArray | None  # shape (N, p), as PV, or None
    # first sample of each stretch in automatic and the one behind its last
    stretches: list[tuple[int, int]]
    op_mean: FloatArray  # op_mean, op_scale: shape (m,), %
    op_scale: FloatArray
    pv_mean: FloatArray  # pv_mean, pv_scale: shape (p,), engineering units
    pv_scale: FloatArray
    digits: int = DIGITS  # decimals that are kept of what is scaled alike

    @property
    def longest(self) -> tuple[int, int]:
        """The longest stretch."""
        return max(self.stretches, key=lambda stretch: stretch[1] - stretch[0])


def scaled(record: Record, stem: FloatArray, digits: int = DIGITS) -> ScaledLoop | None:
    """Return the usable samples, the last ``LONGEST`` of a longer record.

    Args:
        stem: estimated stems, shape (N, m), %.
        digits: decimals that are kept.

    Returns:
        None when nothing is usable, or a signal does not move at all.
    """
    first = max(len(record) - LONGEST, 0)
    part = record.part(first, len(record))
    stretches = part.usable_rows()
    if not stretches:
        return None
    rows = np.concatenate([np.arange(a, b) for a, b in stretches])
    op_mean, op_scale = part.op[rows].mean(axis=0), part.op[rows].std(axis=0)
    pv_mean, pv_scale = part.pv[rows].mean(axis=0), part.pv[rows].std(axis=0)
    if min(op_scale.min(), pv_scale.min()) <= 0.0:
        return None
    return ScaledLoop(
        np.round((part.op - op_mean) / op_scale, digits),
        np.round((stem[first:] - op_mean) / op_scale, digits),
        np.round((part.pv - pv_mean) / pv_scale, digits),
        None if part.sp is None else np.round((part.sp - pv_mean) / pv_scale, digits),
        stretches,
        op_mean,
        op_scale,
        pv_mean,
        pv_scale,
        digits,
    )


def scaled_process(
    outputs: tuple[OutputModel, ...], valves: tuple[str, ...], loop: ScaledLoop
) -> Process:
    """Return equation (9) of all outputs in the units of ``loop``."""
    p, m = len(outputs), len(valves)
    na = max(len(output.a) for output in outputs)
    nb = max(len(output.b[valve]) for output in outputs for valve in valves)
    a, b = np.zeros((p, na)), np.zeros((p, m, nb))
    delay, bias = np.zeros((p, m), dtype=np.int64), np.zeros(p)
    for i, output in enumerate(outputs):
        a[i, : len(output.a)] = output.a
        bias[i] = output.bias - (1.0 + a[i].sum()) * loop.pv_mean[i]
        for j, valve in enumerate(valves):
            b[i, j, : len(output.b[valve])] = output.b[valve]
            delay[i, j] = output.delay[valve]
            bias[i] += b[i, j].sum() * loop.op_mean[j]
        b[i] *= loop.op_scale[:, None] / loop.pv_scale[i]
        bias[i] /= loop.pv_scale[i]
    return Process(a, np.round(b, loop.digits + 3), delay, np.round(bias, loop.digits))


def set_points_of(loop: ScaledLoop, pairs: Pairs) -> FloatArray:
    """Return set-points, recorded or found with the controllers, shape (N, p)."""
    found = np.zeros_like(loop.pv) if loop.sp is None else loop.sp.copy()
    for i, law in pairs:
        if i >= 0:
            found[:, i] = law.set_point
    return found


def free_run(process: Process, loop: ScaledLoop, stem: FloatArray) -> FloatArray:
    """Return PV of the process driven by ``stem`` alone, shape (N, p); NaN outside stretches."""
    found = np.full(loop.pv.shape, np.nan)
    for first, last in loop.stretches:
        for i in range(loop.pv.shape[1]):
            rows = stem[first:last].T
            drive = driven(process.b[i], process.delay[i].tolist(), rows, process.bias[i])
            poles = np.concatenate([[1.0], process.a[i]])
            rest = np.full(len(poles) - 1, loop.pv[first, i])
            found[first:last, i] = recursion(poles, drive, rest)
    return found
