"""The runs of a loop that is closed again, with the frictions that may be and without."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import Stiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.effects.friction.moving_rules import MovingRules
from stiction_ros.identification.closed_loop.scaled_loop import ScaledLoop, free_run, set_points_of
from stiction_ros.identification.friction import find_law
from stiction_ros.identification.result import ValveEstimate
from stiction_ros.loop.linear_loops import Controllers, Pairs, Process, Start, Valves, run_loop
from stiction_ros.signals.oscillation import REGULAR, moving, oscillation, size
from stiction_ros.signals.spectral_lines import fitted_lines

MOST = 6000  # samples of a run
NOISES = 3  # noises drawn for each friction when a record is repeated
LINES = 3  # harmonics of a cycle that are taken out of what the model leaves
SEED = 20  # of the noises: the same record gives the same answer
DOUBTED = 0.7  # share of the friction that is tried as its least where the interval begins at none


def law_of(valve: ValveEstimate) -> tuple[float, float, float]:
    """Return what the runs are told of a valve's law; of one without a known form, He's."""
    law = find_law(valve.law)
    if isinstance(law.switching, type):
        return (1.0, 0.0, 1.0) if law.switching is MovingRules else (0.0, 1.0, 1.0)
    friction = valve.behaviour()
    form = friction.jump_form() if isinstance(friction, Stiction) else None
    return 0.0, 0.0, 1.0 if form is None else form.overshoot


@dataclasses.dataclass(frozen=True)
class Moved:
    """How a loop moves when its record is repeated, between moves of its set-point."""

    with_friction: float  # movement of OP over the recorded one
    # share that goes away with the friction, of OP's movement or of that of PV − SP, whichever is
    # more: a controller that passes noise on to the valve moves OP anyway, and one that is slow
    # hardly moves it at all
    gone: float


@dataclasses.dataclass(frozen=True)
class Repeated:
    """One loop, ready to be run again and again; everything scaled."""

    loop: ScaledLoop  # the signals
    process: Process  # equation (9)
    frictions: FloatArray  # per valve the (f_S, f_D) tried, the estimate first, shape (m, F, 2)
    laws: FloatArray  # per valve, ``law_of``, shape (m, 3)
    pairs: Pairs  # per valve the output of its controller, −1 for none, and the controller
    periods: tuple[float, ...]  # of OP of each valve, samples
    simulated: FloatArray  # PV of the process driven by the estimated stems, shape (N, p)
    load: FloatArray  # what that leaves of PV, shape (N, p)
    set_points: FloatArray  # recorded, or found with the controllers, shape (N, p)

    @classmethod
    def of(
        cls,
        loop: ScaledLoop,
        process: Process,
        valves: Sequence[ValveEstimate],
        pairs: Pairs,
        periods: Sequence[float],
    ) -> "Repeated":
        """Return the loop of identified ``valves``."""
        frictions = np.array([tried_frictions(valve) for valve in valves])
        simulated = free_run(process, loop, loop.stem)
        return cls(
            loop,
            process,
            np.round(frictions / loop.op_scale[:, None, None], loop.digits),
            np.array([law_of(valve) for valve in valves]),
            pairs,
            tuple(periods),
            simulated,
            loop.pv - simulated,
            set_points_of(loop, pairs),
        )

    @property
    def past(self) -> int:
        """H, samples before the first of a run."""
        a, b, delay, _ = self.process
        late = max(law.lag for _, law in self.pairs)
        return int(max(a.shape[1], b.shape[2] + int(delay.max()), 3 + late))

    def recorded(self, valve: int, period: float) -> float:
        """Return the size of the recorded movement of OP about its slow mean.

        The samples for one period after a move of the set-point are left out while enough
        others remain.

        Args:
            valve: index.
            period: of the cycle, samples.
        """
        op = self.loop.op[:, valve]
        moved = np.full(len(op), np.nan)
        for first, last in self.loop.stretches:
            moved[first:last] = moving(op[first:last], period)
        calm = np.isfinite(moved)
        output, law = self.pairs[valve]
        if output >= 0:
            for row in np.flatnonzero(np.diff(law.set_point) != 0.0):
                calm[row : row + round(period)] = False
        enough = calm.sum() >= max(2 * period, 0.2 * len(op))
        return size(moved[calm if enough else np.isfinite(moved)])

    def driven(self, valve: int) -> float:
        """Return the share of OP's movement that the recorded set-point makes without friction."""
        first, last = self._end(self.loop.longest)
        rows = slice(first, last)
        if not any(np.ptp(law.set_point[rows]) > 0.0 for i, law in self.pairs if i >= 0):
            return 0.0
        frictions = self.frictions[:, 0].copy()
        frictions[valve] = 0.0
        none = np.zeros((1, last - first, self._p))
        op, _ = self._again(first, self.set_points[rows], frictions[None], none)
        if not np.isfinite(op).all():
            return 0.0
        period = self.periods[valve]
        begun = first + self.past
        recorded = moving(self.loop.op[begun:last, valve], period)
        apart = recorded - moving(op[0, :, valve], period)
        return max(0.0, 1.0 - float(apart @ apart) / max(float(recorded @ recorded), 1e-300))

    def moved(self, valve: int, period: float) -> Moved:
        """Return how the loop moves with the friction of a valve and without.

        The record is repeated from its start with noise of the spectrum of what the model
        leaves, without the line at the period. Set-points rest but for those that cycle: what
        others move OP is no cycle, and hides what a friction does. Medians of the frictions and
        noises tried; infinite where most runs grow without end.

        Args:
            valve: index.
            period: of the cycle, samples.
        """
        first, last = self._end(self.loop.longest)
        noises = [without_lines(self.load[first:last, i], period) for i in range(self._p)]
        random = np.random.default_rng(SEED)
        tried = self.frictions[valve]
        tried = tried if tried.any() else tried[:1]
        number = NOISES * len(tried)
        frictions = np.repeat(self.frictions[None, :, 0], number + NOISES, axis=0)
        frictions[number:, valve] = 0.0
        load = np.empty((number + NOISES, last - first, self._p))
        for n in range(NOISES):
            load[number + n] = np.column_stack([surrogate(noise, random) for noise in noises])
            for k, pair in enumerate(tried):
                frictions[n * len(tried) + k, valve] = pair
                load[n * len(tried) + k] = load[number + n]
        sp = self._at_rest(first, last)
        op, pv = self._again(first, sp, frictions, load)
        output = max(self.pairs[valve][0], 0)
        errors = pv[:, :, output] - sp[self.past :, output]
        sizes = [
            np.array(
                [size(moving(run, period)) if np.isfinite(run).all() else np.inf for run in runs]
            )
            for runs in (op[:, :, valve], errors)
        ]
        middle = [
            (np.sort(of[:number])[number // 2], np.sort(of[number:])[NOISES // 2]) for of in sizes
        ]
        return Moved(
            float(middle[0][0]) / self.recorded(valve, period),
            max(gone(float(stuck), float(free)) for stuck, free in middle),
        )

    @property
    def _p(self) -> int:
        return int(self.loop.pv.shape[1])

    def _end(self, stretch: tuple[int, int]) -> tuple[int, int]:
        """Return the last ``MOST`` samples of a stretch."""
        return max(stretch[0], stretch[1] - MOST), stretch[1]

    def _at_rest(self, first: int, last: int) -> FloatArray:
        """Return set-points, shape (n, p), that stay after ``past`` samples, or cycle on."""
        sp = self.set_points[first:last].copy()
        for i in range(self._p):
            swing = None
            if self.loop.sp is not None:
                swing = oscillation(self.loop.sp[:, i], self.loop.stretches)
            if swing is None or swing.regularity <= REGULAR:
                sp[self.past :, i] = sp[self.past - 1, i]
        return sp

    def _again(
        self, first: int, sp: FloatArray, frictions: FloatArray, load: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return OP, shape (R, n − H, m), and PV, shape (R, n − H, p), after ``past`` samples H.

        Args:
            first: row, which H samples follow as recorded.
            sp: set-points from there on, shape (n, p).
            frictions: shape (R, m, 2).
            load: shape (R, n, p).
        """
        rows, controllers = slice(first, first + self.past), Controllers.of(self.pairs)
        before = self.simulated[rows], self.loop.stem[rows], self.loop.op[rows.stop - 1]
        start, sp = Start(*map(np.ascontiguousarray, before)), np.ascontiguousarray(sp)
        runs = [
            run_loop(self.process, controllers, Valves(friction, self.laws), start, (sp, noise))
            for friction, noise in zip(frictions, load, strict=True)
        ]
        op, pv = zip(*runs, strict=True)
        return np.array(op), np.array(pv)


def gone(stuck: float, free: float) -> float:
    """Return the share of a movement that is gone where it is another one without a friction."""
    return max(0.0, 1.0 - free / stuck) if 0.0 < stuck < np.inf else 0.0


def surrogate(values: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return noise of the spectrum of ``values``, shape (N,), its phases drawn anew.

    References:
        J. Theiler, S. Eubank, A. Longtin, B. Galdrikian, J. D. Farmer: Testing for nonlinearity
        in time series: the method of surrogate data. Physica D 58, 1992, 77-94.
    """
    spectrum = np.fft.rfft(values)
    turns = np.exp(2j * np.pi * random.random(len(spectrum)))
    turns[0] = 1.0
    return np.asarray(np.fft.irfft(spectrum * turns, len(values)))


def without_lines(values: FloatArray, period: float) -> FloatArray:
    """Return ``values``, shape (N,), without sine and cosine at the period and its harmonics."""
    return values - fitted_lines(values, period, LINES)[1] + float(values.mean())


def tried_frictions(valve: ValveEstimate) -> FloatArray:
    """Return (f_S, f_D) of the estimate and at both ends of its intervals, shape (3, 2), %.

    Where both figures at an end are no band that is possible, f_D is as near as makes it one.
    """
    f_s, f_d = valve.static_friction, valve.dynamic_friction
    low_s, high_s = valve.static_interval
    low_d, high_d = valve.dynamic_interval
    if valve.band_interval is not None:
        least, most = valve.band_interval
        low_d, high_d = max(low_d, least - low_s), max(min(high_d, most - high_s), low_d)
    if low_s <= 0.0:
        low_s, low_d = DOUBTED * f_s, DOUBTED * f_d
    return np.array(
        [(f_s, f_d), (low_s, min(low_d, low_s)), (max(high_s, f_s), min(high_d, high_s))]
    )


def span_of(loop: ScaledLoop, valve: int, period: float) -> float:
    """Return the width of OP's movement about its slow mean, 98 of 100 samples."""
    parts = [moving(loop.op[a:b, valve], period) for a, b in loop.stretches]
    low, high = np.percentile(np.concatenate(parts), [1.0, 99.0])
    return float(high - low)
