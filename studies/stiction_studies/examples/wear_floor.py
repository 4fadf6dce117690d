r"""The least IAE of the tank that so many moves of a valve can buy, whatever the controller.

Only the stem of valve 1 moves C, by

.. math:: V \dot C = K_1 \chi_1 (C_A - C) + F_B (C_B - C).

Between two moves of its set-point the stem stays (0 moves), goes once to where C comes to rest at
one of many levels, or goes at once beyond the new rest and comes back (2): of a first-order process
in which a stem may go anywhere that is the quickest, and a third move makes it no quicker. Each
jump is at least J. The plant is known exactly, there is neither noise nor a limit of a kick, and a
set-point is not known before it moves. Levels are those of all set-points and ``LEVELS`` more, so
the floor is good to their distance. The moves are distributed over the run so that they buy most.

Where valve 2 sticks as well the same is asked of T,

.. math:: V \dot T = K_1 \chi_1 (T_A - T) + F_B (T_B - T) + K_2 \chi_2 \lambda / (\rho c_p),

beside a valve 1 that rests where C's set-point wants it from the sample at which that moves. As it
moves T on its way, valve 2 may also stay until T comes to its goal by itself, and rest then (1).
"""

from __future__ import annotations

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.online.session import Scenario
from stiction_ros.processes.stirred_tank import StirredTank, TankParameters
from stiction_ros.signals.holds import holds
from stiction_studies.examples.wear_study import schedule_of

STEMS = np.linspace(0.0, 100.0, 201)  # %, tried for a stem on its way
LONGEST = 30  # samples that it may stay there
LEVELS = 12
RESTS = 3 * LONGEST  # samples after whose first third T comes to rest


def least_iae(scenario: Scenario, seed: int, least_jump: float) -> FloatArray:
    """Return the least IAE of C, PV · h, with 0, 1, 2 … moves of valve 1 in the whole run.

    Args:
        scenario: of a stirred tank.
        seed: of the set-points that are drawn.
        least_jump: J of valve 1, %.

    Returns:
        Shape (2 n + 1,) for n stretches between moves of the set-points, never rising.

    Raises:
        InputError: another process.
    """
    process = scenario.plant.process
    if not isinstance(process, StirredTank):
        raise InputError("the floor is that of the stirred tank", where=scenario.name)
    schedule, samples = schedule_of(scenario, seed)
    times = np.arange(samples) * scenario.plant.sample_time
    wanted = np.array([schedule.at(time)[0] for time in times])
    return floor_of(process, wanted, least_jump)


def floor_of(process: StirredTank, wanted: FloatArray, least_jump: float) -> FloatArray:
    """Return the least IAE of C, PV · h, with 0, 1, 2 … moves of valve 1.

    Args:
        process: the tank, at rest at the first set-point.
        wanted: set-point of C at each sample, shape (N,).
        least_jump: J of valve 1, %.

    Returns:
        Shape (2 n + 1,) for n stretches between moves of the set-point, never rising.
    """
    minutes = process.sample_time / 60.0
    stretches = holds(wanted[:, None])
    goals = [float(wanted[begin]) for begin, _ in stretches]
    levels = np.unique([*goals, *np.linspace(min(goals), max(goals), LEVELS)])
    found = np.full((len(levels), 1), np.inf)
    found[np.searchsorted(levels, goals[0]), 0] = 0.0
    for goal, (begin, end) in zip(goals, stretches, strict=True):
        step = _Stretch(process.parameters, levels, goal, end - begin, least_jump, minutes)
        found = step.onwards(found)
    least = np.minimum.accumulate(found.min(axis=0))
    return np.asarray(least * minutes / 60.0)


def least_iae_beside(process: StirredTank, wanted: FloatArray, least_jump: float) -> FloatArray:
    """Return the least IAE of T, °C · h, with 0, 1, 2 … moves of valve 2.

    Args:
        process: the tank, at rest at the first set-points.
        wanted: set-points of C and T at each sample, shape (N, 2).
        least_jump: J of valve 2, %.

    Returns:
        Shape (2 n + 1,) for n moves of a set-point, never rising.

    Raises:
        InputError: two of these moves are so near that T does not come to rest between them.
    """
    tank, minutes = process.parameters, process.sample_time / 60.0
    stretches = holds(wanted)
    if min((end - begin for begin, end in stretches[1:]), default=RESTS) < RESTS:
        raise InputError(f"set-points must stay for {RESTS} samples", where="the floor of T")
    goals = [tuple(wanted[begin].tolist()) for begin, _ in stretches]
    heats = [_Heat.of(tank, concentration, minutes) for concentration, _ in goals]
    rests = [heat.rest(goal) for heat, (_, goal) in zip(heats, goals, strict=True)]
    stems = np.unique([*rests, *np.linspace(min(rests), max(rests), LEVELS)])
    found = np.full((len(stems), 1), np.inf)
    found[np.searchsorted(stems, rests[0]), 0] = 0.0
    before = heats[0]
    later = zip(heats, goals, stretches, strict=True)
    next(later)  # at rest, and nobody knows what will be wanted
    for heat, (_, goal), (begin, end) in later:
        none, one, two = heat.costs(before.ends(stems), stems, goal, end - begin, least_jump)
        count = found.shape[1]
        after = np.full((len(stems), count + 2), np.inf)
        after[:, :count] = found + none[:, None]
        for moves, cost in ((1, one), (2, two)):
            there = (found[:, None, :] + cost[:, :, None]).min(axis=0)
            rows = slice(moves, count + moves)
            after[:, rows] = np.minimum(after[:, rows], there)
        found, before = after, heat
    least = np.minimum.accumulate(found.min(axis=0))
    return np.asarray(least * minutes / 60.0)


@dataclasses.dataclass(frozen=True)
class _Heat:
    """T while valve 1 rests.

    Attributes:
        fading: of a deviation, from one sample to the next.
        cold: T at rest with valve 2 shut, °C.
        gain: °C of rest per % of valve 2.
    """

    fading: float
    cold: float
    gain: float

    @classmethod
    def of(cls, tank: TankParameters, concentration: float, minutes: float) -> _Heat:
        """Return it for the stem of valve 1 at which C rests at ``concentration``."""
        inflow = tank.flow_a_max * _rest(tank, concentration) / 100.0
        through = inflow + tank.flow_b
        cold = (inflow * tank.temperature_a + tank.flow_b * tank.temperature_b) / through
        heat = tank.steam_max / 100.0 * tank.latent_heat / (tank.density * tank.heat_capacity)
        return cls(float(np.exp(-through / tank.volume * minutes)), cold, heat / through)

    def rest(self, temperature: float) -> float:
        """Return the stem of valve 2 at which T rests, %."""
        return (temperature - self.cold) / self.gain

    def ends(self, stems: FloatArray) -> FloatArray:
        """Return T at rest with valve 2 at ``stems``."""
        return self.cold + self.gain * stems

    def costs(
        self, start: FloatArray, stems: FloatArray, goal: float, length: int, jump: float
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return Σ|T − goal| over ``length`` samples without a move, with one and with two.

        Args:
            start: T at the begin, with valve 2 at each of ``stems``, shape (L,).
            stems: at which it may rest, shape (L,).
            goal: set-point of T.
            length: samples.
            jump: J of valve 2, %.

        Returns:
            Shape (L,), then from each stem to each, (L, L), twice.
        """
        first = np.concatenate([stems, STEMS])
        waits = np.arange(LONGEST + 1.0)
        away = self.ends(first) - goal
        apart = start[:, None] - self.ends(first)[None, :]
        paid = self._sums(away[None, :, None], apart[:, :, None], waits)
        there = self.ends(first)[None, :, None] + apart[:, :, None] * self.fading**waits
        own = np.arange(len(stems))
        none = self._sums(away[own], apart[own, own], np.array(float(length)))
        one, two = (np.full((len(stems), len(stems)), np.inf) for _ in range(2))
        begun = np.abs(first[None, :] - stems[:, None]) >= jump
        for place, stem in enumerate(stems):
            end = float(self.ends(stem))
            rest = self._sums(np.array(end - goal), there - end, length - waits)
            cost = (paid + rest).min(axis=2)
            allowed = np.abs(first - stem) >= jump
            one[:, place] = np.where(allowed[own], cost[own, own], np.inf)
            two[:, place] = np.where(begun & allowed, cost, np.inf).min(axis=1)
        return none, one, two

    def _sums(self, away: FloatArray, apart: FloatArray, counts: FloatArray) -> FloatArray:
        """Return Σ|away + apart · fading^k| over k < counts; the arrays are broadcast."""
        fading = self.fading
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = np.ceil(np.log(-away / apart) / np.log(fading))
        crosses = away * (away + apart) < 0.0
        crossing = np.where(crosses, np.clip(np.nan_to_num(crossing), 0.0, counts), 0.0)

        def sums(terms: FloatArray) -> FloatArray:
            faded = (1.0 - fading**terms) / (1.0 - fading)
            return np.asarray(away * terms + apart * faded)

        until = sums(crossing)
        return np.asarray(np.abs(until) + np.abs(sums(np.asarray(counts)) - until))


class _Stretch:
    """Σ|C − goal| of one stretch, from each level to each."""

    def __init__(
        self,
        tank: TankParameters,
        levels: FloatArray,
        goal: float,
        length: int,
        jump: float,
        minutes: float,
    ) -> None:
        rests = np.array([_rest(tank, level) for level in levels])
        self.goal = int(np.searchsorted(levels, goal))
        self.none = np.abs(levels - goal) * length
        starts, ends = np.meshgrid(levels, rests, indexing="ij")
        far = np.abs(rests[:, None] - rests[None, :]) >= jump
        cost, _ = _way(tank, starts.ravel(), ends.ravel(), goal, length, minutes)
        self.one = np.where(far, cost.reshape(starts.shape), np.inf)
        self.two = np.full(len(levels), np.inf)
        rest = rests[self.goal]
        for place, level in enumerate(levels):
            usable = STEMS[(np.abs(STEMS - rests[place]) >= jump) & (np.abs(STEMS - rest) >= jump)]
            for samples in range(1, min(LONGEST, length - 1) + 1):
                begun = np.full(len(usable), level)
                cost, there = _way(tank, begun, usable, goal, samples, minutes)
                back = np.full(len(usable), rest)
                cost = cost + _way(tank, there, back, goal, length - samples, minutes)[0]
                self.two[place] = min(self.two[place], float(cost.min()))

    def onwards(self, found: FloatArray) -> FloatArray:
        """Return the least sums by level and moves, (L, k + 3), after this from those before."""
        count = found.shape[1]
        after = np.full((len(found), count + 2), np.inf)
        after[:, :count] = found + self.none[:, None]
        once = (found[:, None, :] + self.one[:, :, None]).min(axis=0)
        after[:, 1 : count + 1] = np.minimum(after[:, 1 : count + 1], once)
        twice = (found + self.two[:, None]).min(axis=0)
        after[self.goal, 2:] = np.minimum(after[self.goal, 2:], twice)
        return after


def _way(
    tank: TankParameters,
    start: FloatArray,
    stems: FloatArray,
    goal: float,
    length: int,
    minutes: float,
) -> tuple[FloatArray, FloatArray]:
    """Return Σ|C − goal| over ``length`` samples at constant stems, and C after them."""
    inflow = tank.flow_a_max * stems / 100.0
    rate = (inflow + tank.flow_b) / tank.volume * minutes
    ends = (inflow * tank.concentration_a + tank.flow_b * tank.concentration_b) / (
        inflow + tank.flow_b
    )
    fading = np.exp(-np.outer(np.arange(length + 1), rate))
    path = ends + (start - ends) * fading
    return np.abs(path[:-1] - goal).sum(axis=0), path[-1]


def _rest(tank: TankParameters, concentration: float) -> float:
    """Return the stem at which C rests, %."""
    share = (concentration - tank.concentration_b) / (tank.concentration_a - concentration)
    return 100.0 * tank.flow_b * share / tank.flow_a_max
