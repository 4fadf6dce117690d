"""Least squares of one output for many stems and all delays of a valve at once.

With the data filtered by D/A of a nearby model the innovations of (9) are linear in A and B once
more (Steiglitz and McBride), so both are eliminated for every stem of a grid: only the friction,
or whatever moves the stem, is left to be searched. Rows that are kept back take no part.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.discrepancy.likelihood.noise import left_by, projector
from stiction_ros.discrepancy.process.free_equation import Equation, Problem
from stiction_ros.discrepancy.simulation.free_run import end_to_end
from stiction_ros.discrepancy.simulation.responses import filtered
from stiction_ros.effects import FloatArray
from stiction_ros.identification.kernels.delay import DEPENDENT, delay_energy
from stiction_ros.identification.kernels.scan import without_projections

_TINY = 1e-300


@dataclasses.dataclass(frozen=True)
class Prefilter:
    """D/A: numerator and denominator in powers of q⁻¹, both starting with 1."""

    numerator: FloatArray
    denominator: FloatArray

    @classmethod
    def of(cls, equation: Equation | None = None, ar: FloatArray | None = None) -> Prefilter:
        """Return D/A of an equation and its noise; 1 for what is not given."""
        one = np.ones(1)
        return cls(
            one if ar is None else np.concatenate([one, -ar]),
            one if equation is None else equation.denominator,
        )


class StemScan:
    """Sum of squared innovations of one output as a function of one valve's stem."""

    def __init__(
        self, problem: Problem, own: Equation, valve: int, delays: range, prefilter: Prefilter
    ) -> None:
        """Project out everything that does not depend on the scanned stem.

        Args:
            problem: the output; the stems of its other valves are used.
            own: orders, and the delays of the other valves.
            valve: index of the valve that is scanned.
            delays: of that valve, samples, without gaps.
            prefilter: of all signals.
        """
        self.problem, self.prefilter = problem, prefilter
        self.width = len(own.b[valve])
        self.rows = int(problem.blocks.train.sum())
        self.lags = range(delays[0] + 1, delays[-1] + 1 + self.width)
        basis, rest = self._rest(problem, own, valve)
        self.rest_energy = max(float(rest @ rest), _TINY)
        inner = np.column_stack([basis, rest])
        count = len(problem.y)
        self._basis = np.zeros((len(self.lags), inner.shape[1], count))
        self._masks = np.zeros((len(self.lags), count))
        whole = np.zeros((count, inner.shape[1]))
        whole[problem.blocks.train] = inner
        for rows in problem.runs.slices:
            for place, lag in enumerate(self.lags):
                target = slice(rows.start, max(rows.stop - lag, rows.start))
                source = slice(min(rows.start + lag, rows.stop), rows.stop)
                self._basis[place, :, target] = whole[source].T
                self._masks[place, target] = problem.blocks.train[source]

    def _rest(self, problem: Problem, own: Equation, valve: int) -> tuple[FloatArray, FloatArray]:
        numerator, denominator = self.prefilter.numerator, self.prefilter.denominator
        inputs = problem.inputs(own)
        inputs = [columns for j, columns in enumerate(inputs) if j != valve]
        plain = np.column_stack([problem.y, *inputs, problem.constants()])
        passed = problem.each(plain, numerator, denominator)
        y = passed[:, 0]
        columns = [passed[:, 1:]]
        columns += [problem.late(y, k)[:, None] for k in range(1, len(own.a) + 1)]
        reach = len(denominator) - 1
        if reach:
            columns.append(problem.each(problem.impulses(reach), numerator, denominator))
        train = problem.blocks.train
        basis = projector(np.hstack(columns)[train])
        return basis, left_by(basis, y[train])

    def energy(self, stems: FloatArray) -> FloatArray:
        """Return the sum of squares, shape (G, T), for stems of shape (N, G) and T delays."""
        x = end_to_end([self._filtered(stems[rows]) for rows in self.problem.runs.slices])
        projected = (self._basis.reshape(-1, len(x)) @ x).reshape(*self._basis.shape[:2], -1)
        projected = np.ascontiguousarray(np.moveaxis(projected, -1, 0))
        products = np.empty((x.shape[1], 1, self.width, len(self.lags)))
        for d in range(self.width):
            products[:, 0, d] = (self._masks @ (x * self.problem.late(x, d))).T
        products[:, :, 0] = products[:, :, 0] * (1.0 + DEPENDENT) + 1e-200
        for own, inner in zip(products[:, 0], projected, strict=True):
            without_projections(own, inner, inner)
        right = np.ascontiguousarray(projected[:, None, :, -1])
        return delay_energy(products, right, self.rest_energy)

    def _filtered(self, stems: FloatArray) -> FloatArray:
        """Return the stems of one record, in deviations from the first, behind the prefilter."""
        numerator, denominator = self.prefilter.numerator, self.prefilter.denominator
        return filtered(numerator, denominator, np.ascontiguousarray(stems), np.zeros(len(stems)))
