r"""The least IAE of the tank's C that so many moves of valve 1 can buy, whatever the controller.

Only the stem of valve 1 moves C, by

.. math:: V \dot C = K_1 \chi_1 (C_A - C) + F_B (C_B - C).

Between two moves of its set-point the stem stays (0 moves), goes once to where C comes to rest at
one of many levels, or goes at once beyond the new rest and comes back (2): of a first-order process
in which a stem may go anywhere that is the quickest, and a third move makes it no quicker. Each
jump is at least J. The plant is known exactly, there is neither noise nor a limit of a kick, and a
set-point is not known before it moves. Levels are those of all set-points and ``LEVELS`` more, so
the floor is good to their distance. The moves are distributed over the run so that they buy most.
"""

from __future__ import annotations

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.examples.wear_study import schedule_of
from stiction_ros.loop.set_points import holds
from stiction_ros.online.session import Scenario
from stiction_ros.processes.stirred_tank import StirredTank, TankParameters

STEMS = np.linspace(0.0, 100.0, 201)  # %, tried for a stem on its way
LONGEST = 30  # samples that it may stay there
LEVELS = 12


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
    minutes = scenario.plant.sample_time / 60.0
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
