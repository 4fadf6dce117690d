"""The grid search that the paper compares with, reference [20], as published.

For each point of a triangular grid over (f_S, f_D) of all valves the stem is simulated, by the
smoothed law (5) at τ = 10⁴; for each choice of delays ARX is fitted by least squares. The lowest
mean SE (14) wins. Nothing is shared between points: this is the baseline.
"""

import itertools

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.identification_options import Progress
from stiction_ros.paper import one_step_result as one_step
from stiction_ros.paper.one_step_result import EquationError, fit_outputs
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.smoothed_laws import final_smoothing, smooth_law
from stiction_ros.records.record import Record
from stiction_ros.signals.arx_fit import ArxOrders, Delays

MAX_POINTS = 2_000_000
MAX_CHOICES = 20_000


def nodes(limit: float, step: float) -> FloatArray:
    """Return the rows (f_S, f_D) of one valve's triangle, 0 ≤ f_D ≤ f_S ≤ limit, shape (n, 2).

    Nodes are whole multiples of ``step``, so that round numbers are on the grid.
    """
    values = step * np.arange(int(np.floor(limit / step * (1.0 + 1e-12))) + 1)
    return np.array(
        [(static, dynamic) for static in values for dynamic in values[values <= static]]
    )


def count_points(record: Record, options: PaperOptions) -> int:
    """Return the number of grid points of a record, by which a benchmark extrapolates."""
    sides = (
        np.floor(one_step.friction_limits(record, options) / options.grid_step * (1.0 + 1e-12))
        + 1.0
    )
    return int(np.prod([side * (side + 1.0) / 2.0 for side in sides.tolist()]))


def search(
    record: Record, options: PaperOptions, orders: ArxOrders, progress: Progress
) -> one_step.Answer:
    """Return the grid point and delays of lowest mean SE; the options have its ``grid_step``.

    Raises:
        InputError: a step coarser than the OP span, or a grid of more than ``MAX_POINTS`` points.
    """
    limits = one_step.friction_limits(record, options)
    if options.grid_step > limits.max():
        raise InputError(
            f"step {options.grid_step:g} % is coarser than the largest friction {limits.max():g} %",
            where="grid_step",
            fix="choose a smaller step",
        )
    total = count_points(record, options)
    if total > MAX_POINTS:
        raise InputError(
            f"the grid has {total} points, up to {MAX_POINTS} are worked through",
            where="grid_step",
            fix="choose a larger step or a friction limit",
        )
    choices = one_step.delay_choices(record, options, MAX_CHOICES)
    law, smoothing = smooth_law(options.law), final_smoothing(limits)
    best: tuple[EquationError, FloatArray, Delays] | None = None
    triangles = [nodes(limit, options.grid_step) for limit in limits.tolist()]
    for number, rows in enumerate(itertools.product(*triangles), start=1):
        friction = np.array(rows)
        stems = law.stems(record.op, friction, smoothing)
        for delays in choices:
            found = fit_outputs(record.pv, stems, delays, orders)
            if best is None or found.squared_error < best[0].squared_error:
                best = found, friction, delays
        progress(number / total)
    assert best is not None  # every triangle has its corner (0, 0)
    found, friction, delays = best
    stable = all(fit.largest_root < 1.0 for fit in found.fits)
    reason = "" if stable else "the process at the best point is unstable"
    return one_step.Answer(reason, friction, delays, found.squared_error, total)
