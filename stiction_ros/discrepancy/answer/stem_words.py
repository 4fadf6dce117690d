"""What a recorded stem says of its valve by itself, before any process is asked."""

import dataclasses
import itertools

import numpy as np

from stiction_ros.deferred import halton_sequence
from stiction_ros.discrepancy.candidate.base import figures_of
from stiction_ros.discrepancy.candidate.valve import ValveCandidate, valve_candidates
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Behaviour, FloatArray

LATEST = 20  # samples that a stem may come late
TELLS = 0.5  # of the squared distance from OP that an effect has to explain to be told
SIDES = (-1.0, -0.5, 0.0, 0.5, 1.0)
STEM_SEARCH_ROUNDS, SHRINK = 9, 0.5
BOXES, THROWN = (1.0, 0.3, 0.1, 0.03, 0.01, 0.003), 1000  # of a needle, and points in each
ACCURATE = 0.01  # of the span of OP: a stem that near follows it


@dataclasses.dataclass(frozen=True)
class StemLook:
    """A recorded stem against OP."""

    valve: str  # tag
    off: float  # root mean square of stem less where the model has it, %, a constant taken out
    constant: float  # that constant, %
    moved: bool  # whether the model moves it by anything but OP
    # samples by which the stem matches that best; 0 as well where it may be more than ``LATEST``
    late: int
    # the effect of the valve that explains most of the distance; None where none explains enough
    behaviour: Behaviour | None
    share: float  # of the squared distance that it explains, 0 to 1
    span: float  # of OP, %

    @property
    def sentence(self) -> str:
        """What it says, for people."""
        other = "the simulated one" if self.moved else "OP"
        head = f"the stem of {self.valve} is recorded: it stands {self.off:.2g} % off {other}"
        if abs(self.constant) > self.off:
            head += f" about a constant {self.constant:.3g} %"
        if self.off <= ACCURATE * self.span:
            return (
                f"{head} and follows it, so that what the simulation misses lies behind the valve"
            )
        if self.late:
            head += f", and matches it best {self.late} samples later"
        if self.behaviour is None:
            return f"{head}; no single effect of a valve explains that"
        figures = ", ".join(f"{k} {v:.3g}" for k, v in figures_of(self.behaviour).items())
        share = f"{100.0 * self.share:.0f} %"
        return f"{head}; {self.behaviour.title()} ({figures}) explains {share} of that by the stem"


def look_at_stems(run: FreeRun) -> tuple[StemLook, ...]:
    """Return what every stem says that is recorded throughout."""
    if any(record.stem is None for record in run.runs.records):
        return ()
    return tuple(_look(run, j) for j in range(len(run.model.valves)))


def _look(run: FreeRun, valve: int) -> StemLook:
    name = run.model.valve_names[valve]
    parts = []
    for record in run.runs.records:
        assert record.stem is not None
        parts.append(record.stem[:, record.valves.index(name)])
    stem = np.concatenate(parts)
    op = run.stems[:, valve]
    constant = float(np.median(stem - op))
    before = _left(stem, op[:, None])[0]
    best, share = None, TELLS
    for candidate in valve_candidates(run):
        if not isinstance(candidate, ValveCandidate) or candidate.valve != valve:
            continue
        point, left = _nearest(candidate, run, stem)
        gone = 1.0 - left / max(float(before), 1e-300)
        if gone > share:
            best, share = candidate.behaviour(run, point, np.zeros(0)), gone
    shifted = [_left(stem[late:], op[: len(op) - late, None])[0] for late in range(LATEST + 1)]
    late = int(np.argmin(shifted))
    return StemLook(
        name,
        float(np.sqrt(before / len(stem))),
        constant,
        bool(run.model.valves[valve].effects),
        late if late < LATEST else 0,
        best,
        share if best is not None else 0.0,
        float(np.ptp(op)),
    )


def _nearest(candidate: ValveCandidate, run: FreeRun, stem: FloatArray) -> tuple[FloatArray, float]:
    """Return the figures whose stem is nearest, shape (axes,), and its squared distance."""
    steps = np.array([axis.spacing for axis in candidate.axes])
    around = np.array(list(itertools.product(SIDES, repeat=len(steps))))
    tried, size = candidate.grid(), 1.0
    for _ in range(STEM_SEARCH_ROUNDS):
        points = candidate.values(tried)
        left = _left(stem, candidate.stems(run, points))
        k = int(np.argmin(left))
        size *= SHRINK
        tried = tried[k] + size * steps * around
    point, least = points[k], float(left[k])
    if not candidate.needle:
        return point, least
    halton = halton_sequence(len(steps), seed=0)
    for size in BOXES:
        cube = 2.0 * halton.random(THROWN) - 1.0
        points = candidate.scattered(point, cube, size, any_start=True)
        left = _left(stem, candidate.stems(run, points))
        k = int(np.argmin(left))
        if left[k] < least:
            point, least = points[k], float(left[k])
    return point, least


def _left(stem: FloatArray, tried: FloatArray) -> FloatArray:
    """Return the squared distances of tried stems, constants taken out, shape (G,)."""
    away = tried - stem[:, None]
    return np.asarray(np.sum((away - away.mean(axis=0)) ** 2, axis=0))
