"""Other tunings of the controller that is there, and how much faster another would answer.

Gain and integral time are multiplied by a few factors each. A tuning may be taken where the loop
without friction keeps its distance from instability, and it is chosen for the least mean IAE over
some of the loops that the identification does not tell apart. It must not make the cycle wider.
"""

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control.design import ControlDesign
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.gain.draws import Draws
from stiction_ros.gain.measures import Measures
from stiction_ros.gain.recorded_loop import RecordedLoop

ComplexArray = np.ndarray[tuple[int], np.dtype[np.complex128]]

FASTER = (1.0, 1.4, 2.0)
"""Factors on the gain where the valve has friction: a slower controller lets the valve rest off
its place, and what that brings depends on loads to come."""

SLOWER = (0.35, 0.5, 0.7, 1.0)
"""Factors on the gain where the loop rings without friction."""

TIMES = (0.7, 1.0, 1.5, 2.5)
"""Factors on the integral time."""

SENSITIVE = 1.7
"""Largest peak of the sensitivity of a tuning that is taken: the upper end of what is usual."""

CALMER = 0.9
"""Share of the present peak up to which a tuning is taken that is calmer and still above that."""

TRIED = 5
"""Draws on which tunings are compared."""

WORTH = 0.03
"""Share of the IAE that another tuning must save to be named."""

FREQUENCIES = np.geomspace(1e-4, 1.0, 300)
"""At which loops are looked at, over the highest one, shape (F,)."""

SHIFTS: ComplexArray = np.exp(-1j * np.pi * FREQUENCIES)
"""The backward shift q at each of them, shape (F,)."""

PULSE = 1000
"""Samples of the answer of a predictive controller to a pulse of PV."""

FASTEST = 3.0
"""Times the recorded loop's crossover up to which a promise is made.

In the field's seeds 0:599 five of eight loops above it become worse than they are, and five of 75
below.
"""


@dataclasses.dataclass(frozen=True)
class Tuning:
    """Factors on the controller that is there."""

    gain: float = 1.0  # on K
    integral_time: float = 1.0  # on T_i

    def applied(self, tunings: FloatArray) -> FloatArray:
        """Return (K, K_i, K_d), shape (R, 3), with the factors."""
        factors = np.array([self.gain, self.gain / self.integral_time, self.gain])
        return np.asarray(tunings * factors)

    @property
    def settings(self) -> dict[str, float]:
        """The factors by their names in the JSON."""
        return {"gain_factor": self.gain, "integral_time_factor": self.integral_time}

    @property
    def note(self) -> str:
        """What is done, one sentence."""
        if self == UNCHANGED:
            return "No other tuning with enough distance from instability helps."
        return f"Gain times {self.gain:g}, integral time times {self.integral_time:g}."


UNCHANGED = Tuning()


def best_tuning(loop: RecordedLoop, draws: Draws) -> Tuning:
    """Return the tuning that helps most on the first draws; unchanged where none does."""
    few = list(range(min(TRIED, len(draws))))
    draws = draws.taken(few)
    tunings = calm(bool(draws.frictions.any()), lambda tuning: sensitivity(loop, draws, tuning))
    applied = np.concatenate([tuning.applied(draws.tunings) for tuning in tunings])
    runs = loop.run(draws.taken(few * len(tunings)), tunings=applied)
    by_tuning = [runs[k : k + len(few)] for k in range(0, len(runs), len(few))]
    return most_helpful(dict(zip(tunings, by_tuning, strict=True)))


def calm(friction: bool, peak_of: Callable[[Tuning], float]) -> list[Tuning]:
    """Return the present tuning, then those that keep their distance from instability.

    Args:
        friction: whether the valve has some.
        peak_of: peak of the sensitivity under a tuning.
    """
    limit = max(SENSITIVE, CALMER * peak_of(UNCHANGED))
    tried = itertools.starmap(Tuning, itertools.product(FASTER if friction else SLOWER, TIMES))
    return [UNCHANGED, *(one for one in tried if one != UNCHANGED and peak_of(one) <= limit)]


def most_helpful(runs: Mapping[Tuning, Sequence[Measures | None]]) -> Tuning:
    """Return the tuning of least mean IAE without a wider cycle; unchanged where none is worth it.

    Args:
        runs: under each tuning, the present one among them.
    """
    error, width = (_mean(runs[UNCHANGED], key) for key in ("iae_per_hour", "amplitude"))
    better = {
        tuning: mean
        for tuning, of in runs.items()
        if (mean := _mean(of, "iae_per_hour")) < (1.0 - WORTH) * error
        and _mean(of, "amplitude") <= width
    }
    return min(better, key=better.__getitem__, default=UNCHANGED)


def _mean(runs: Sequence[Measures | None], key: str) -> float:
    """Return the mean of a measure, 0 where there is none; infinite where a run grows."""
    return float(np.mean([np.inf if run is None else getattr(run, key) or 0.0 for run in runs]))


def sensitivity(loop: RecordedLoop, draws: Draws, tuning: Tuning) -> float:
    r"""Return the peak of :math:`|1 / (1 + C P)|` of the first loop, its valve without friction."""
    return peak(controller_response(loop, tuning) * process_response(loop, draws, 0))


def controller_response(loop: RecordedLoop, tuning: Tuning) -> ComplexArray:
    """Return C of the controller that is there, with factors on its tuning, shape (F,)."""
    law = loop.law
    gain, reset, rate = tuning.applied(law.coefficients[None])[0]
    control = gain + reset / (1.0 - SHIFTS) + rate * (1.0 - SHIFTS)
    return np.asarray(
        control * (1.0 - law.smoothing) / (1.0 - law.smoothing * SHIFTS) * SHIFTS**law.lag
    )


def process_response(loop: RecordedLoop, draws: Draws, r: int) -> ComplexArray:
    """Return P from the stem that is looked at to its output, of one draw, shape (F,)."""
    (a, b, delay, _), i, j = draws.equations, loop.output, loop.valve
    poles = np.polyval(np.concatenate([a[r, i, ::-1], [1.0]]), SHIFTS)
    zeros = np.polyval(b[r, i, j, ::-1], SHIFTS)
    return np.asarray(zeros * SHIFTS ** (1 + int(delay[i, j])) / poles)


def peak(open_loop: ComplexArray) -> float:
    """Return the largest sensitivity of a loop with this open-loop response, shape (F,)."""
    return float(np.max(1.0 / np.maximum(np.abs(1.0 + open_loop), 1e-12)))


def times_as_fast(loop: RecordedLoop, design: ControlDesign, draws: Draws) -> float:
    """Return the crossover under a predictive controller over that of the recorded loop.

    A loop that cycles shows its process at the cycle and at what its controller answers, and hardly
    beyond: there the drawn processes are alike because the prior says so. The crossover is the
    lowest frequency at which the controller times the process falls below 1.

    Args:
        loop: with its own controller.
        design: of the other, scaled, its valve without friction.
        draws: loops; the median of them is given.
    """
    present, other = controller_response(loop, UNCHANGED), predictive_response(design)
    ratios = []
    for r in range(len(draws)):
        process = process_response(loop, draws, r)
        ratios.append(_crossover(other * process) / _crossover(present * process))
    return float(np.median(ratios))


def predictive_response(design: ControlDesign) -> ComplexArray:
    """Return C' from SP − PV to the stem, shape (F,), by how OP answers a pulse of PV.

    The ``design`` is of the controller of one valve and one output, with the embedding's weights.
    """
    linear = dataclasses.replace(design, unaware=design.embedding)
    control, model = MpcController(linear, ControlMode.UNAWARE), design.model
    pulse, dv = np.sqrt(design.observer.measurement_noise), np.zeros(model.e.shape[1])
    control.start(model.stem0, model.pv0)
    op = [model.stem0]
    for k in range(PULSE):
        pv = model.pv0 + pulse if k == 0 else model.pv0
        op.append(control.step(pv, model.pv0, dv, op[-1]).op)
    moves = np.diff(op, axis=0)[:, 0] / pulse[0]
    return np.asarray(-(SHIFTS[:, None] ** np.arange(PULSE) @ moves) / (1.0 - SHIFTS))


def _crossover(open_loop: ComplexArray) -> float:
    """Return the lowest frequency at which an open loop falls below 1, in those looked at."""
    below = np.flatnonzero(np.abs(open_loop) < 1.0)
    return float(FREQUENCIES[below[0] if len(below) else -1])
