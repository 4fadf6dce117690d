"""Frictions that a test may show, and the moves of the stem under each."""

import dataclasses
import functools
import itertools

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import BoolArray, FloatArray, IntArray
from stiction_ros.identification.valve_test.steps import Steps

# smallest f_S of interest, %: a valve with less follows its signal as good positioners do
SMALLEST = 0.4
LARGEST = 15.0  # largest f_S of all, %
# cells over log f_S, f_D / f_S and the start, before they are refined: a stem near the edge of its
# band slips at the first small move, which coarser starts would miss for a large f_S
CELLS = (30, 8, 20)
RAMP = 12  # parts of a step behind an actuator's lag
LEVELS = 5  # times that cells are halved: the last ones are .6 % of f_S wide
REFINED = 64  # sets of moves of which the cells are halved at once
KEPT = 3000  # likeliest cells that are kept besides


@dataclasses.dataclass(frozen=True)
class Frictions:
    """Cells of frictions, with what the stem did in the middle of each.

    Their prior is even over log f_S, over f_D / f_S and over the place χ_0 of the stem in its band,
    half of it at f_D = f_S, where a slip makes no jump. f_D may be negative: behind a positioner a
    slip goes on beyond OP.
    """

    middles: FloatArray  # log f_S, f_D / f_S and (χ_0 − OP) / f_S of each, shape (G, 3)
    widths: FloatArray  # of each, shape (G, 3)
    lags: BoolArray  # whether the stem follows OP behind an actuator's lag, shape (G,)
    logs: FloatArray  # log of the prior of each, shape (G,)
    moves: FloatArray  # of the stem at each step of OP, %, that differ, shape (U, M)
    which: IntArray  # row of ``moves`` of each cell, shape (G,)
    ends: FloatArray  # lead of OP over the stem at the end, %, shape (G,)

    @classmethod
    def all(cls, steps: Steps) -> "Frictions":
        """Return coarse cells over all frictions."""
        low, high = np.log(SMALLEST), np.log(LARGEST)
        static = _middles(low, high, CELLS[0])
        places = _middles(-1.0, 1.0, CELLS[2])
        parts, widths, logs = [], [], []
        for shares, width in ((np.ones(1), 0.0), (_middles(-1.0, 1.0, CELLS[1]), 2.0 / CELLS[1])):
            mesh = np.meshgrid(static, shares, places, indexing="ij")
            part = np.column_stack([axis.ravel() for axis in mesh])
            wide = np.array([(high - low) / CELLS[0], width, 2.0 / CELLS[2]])
            parts.append(part)
            widths.append(np.tile(wide, (len(part), 1)))
            logs.append(np.full(len(part), -np.log(4.0 * len(part))))
        cells, wide, log = np.vstack(parts), np.vstack(widths), np.concatenate(logs)
        lags = np.repeat([False, True], len(cells))
        return cls._at(steps, np.tile(cells, (2, 1)), np.tile(wide, (2, 1)), lags, np.tile(log, 2))

    @classmethod
    def _at(
        cls,
        steps: Steps,
        middles: FloatArray,
        widths: FloatArray,
        lags: BoolArray,
        logs: FloatArray,
    ) -> "Frictions":
        static = np.exp(middles[:, 0])
        grid = np.column_stack([static, middles[:, 1] * static])
        begin = steps.levels[0] + middles[:, 2] * static
        ramp = np.outer(np.diff(steps.levels), np.arange(1, RAMP + 1) / RAMP)
        path = (steps.levels[:-1, None] + ramp).ravel()
        stems = np.empty((len(static), len(steps.levels)))
        stems[:, 0] = begin
        stems[~lags, 1:] = HeStiction.simulate_grid(grid[~lags], steps.levels[1:], begin[~lags]).T
        stems[lags, 1:] = HeStiction.simulate_grid(grid[lags], path, begin[lags])[
            RAMP - 1 :: RAMP
        ].T
        moves, which = distinct(np.diff(stems))
        return cls(middles, widths, lags, logs, moves, which, steps.levels[-1] - stems[:, -1])

    def along(self, steps: Steps) -> "Frictions":
        """Return the same cells on another path of OP that begins where this one does."""
        return self._at(steps, self.middles, self.widths, self.lags, self.logs)

    def refined(self, steps: Steps, shares: FloatArray) -> "Frictions":
        """Return the likely cells, the likeliest of them halved in each direction.

        Args:
            steps: of OP.
            shares: how likely each cell is, shape (G,).
        """
        best = np.full(len(self.moves), -np.inf)
        np.maximum.at(best, self.which, np.where(self.moved, shares, -np.inf))
        likely = np.zeros(len(best), dtype=bool)
        likely[np.argsort(best)[-REFINED:]] = True
        chosen = np.flatnonzero(likely[self.which] & self.moved)
        chosen = chosen[np.argsort(shares[chosen])[-3 * REFINED :]]
        signs = 0.25 * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        halves = np.repeat(chosen, len(signs))
        fine = self._at(
            steps,
            self.middles[halves] + np.tile(signs, (len(chosen), 1)) * self.widths[halves],
            0.5 * self.widths[halves],
            self.lags[halves],
            self.logs[halves] - np.log(len(signs)),
        )
        keep = np.zeros(len(shares), dtype=bool)
        keep[np.argsort(shares)[-KEPT:]] = True
        keep[chosen] = False
        moves, which = distinct(np.vstack([self.moves[self.which[keep]], fine.moves[fine.which]]))
        rest = (
            np.concatenate([getattr(self, name)[keep], getattr(fine, name)])
            for name in ("middles", "widths", "lags", "logs", "ends")
        )
        middles, widths, lags, logs, ends = rest
        return type(self)(middles, widths, lags, logs, moves, which, ends)

    @functools.cached_property
    def prior(self) -> FloatArray:
        """Log of the prior of each set of moves, shape (U,)."""
        sums = np.bincount(self.which, np.exp(self.logs), len(self.moves))
        return np.asarray(np.log(sums))

    @property
    def static(self) -> FloatArray:
        """f_S, %, shape (G,)."""
        return np.asarray(np.exp(self.middles[:, 0]))

    @property
    def dynamic(self) -> FloatArray:
        """f_D, %, shape (G,)."""
        return np.asarray(self.middles[:, 1] * self.static)

    @property
    def even(self) -> BoolArray:
        """Whether a slip makes no jump, shape (G,)."""
        return np.asarray(self.widths[:, 1] == 0.0)

    @functools.cached_property
    def moved(self) -> BoolArray:
        """Whether the stem moved at all, shape (G,)."""
        return np.asarray(np.any(self.moves != 0.0, axis=1)[self.which])


def _middles(low: float, high: float, count: int) -> FloatArray:
    return np.asarray(low + (np.arange(count) + 0.5) * ((high - low) / count))


def distinct(moves: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the rows that differ, and which of them each row is."""
    rows = np.ascontiguousarray(moves.round(9) + 0.0)
    keys = rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1])))[:, 0]
    _, first, which = np.unique(keys, return_index=True, return_inverse=True)
    return rows[first], which
