"""PI controllers for the plants, and gains near the limit of stability."""

import dataclasses
import math

import numpy as np

from stiction_studies.field.hidden.plants import Plant
from stiction_studies.field.kernels import FloatArray

HALVINGS = 30  # of the interval in which a gain lies
CALM = 0.985  # per sample over 30 samples: a tuning is made weaker until it decays as fast
WEAKER = 0.8


@dataclasses.dataclass(frozen=True)
class Tuning:
    """A PI controller: signed gain K_c in % per unit, integral time T_i in s."""

    gain: float
    integral_time: float


def simc(plant: Plant, sample_time: float, speed: float) -> Tuning:
    r"""Return a tuning by the SIMC rules with the half rule for more than one lag.

    .. math:: K_c = \tau / (K (\tau_c + \theta)), \quad T_i = \min(\tau, 4 (\tau_c + \theta))

    Args:
        plant: to be controlled.
        sample_time: s; half of it counts as dead time.
        speed: τ_c over θ.

    References:
        S. Skogestad: Simple analytic rules for model reduction and PID controller tuning. J.
        Process Control 13, 2003, 291-309.
    """
    ordered = sorted(plant.lags, reverse=True)
    dead = plant.dead_time + 0.5 * sample_time + max(-plant.lead, 0.0)
    if plant.integrating:
        dead += sum(ordered)
        slow = (speed + 1.0) * dead
        return Tuning(1.0 / (plant.gain * slow), 4.0 * slow)
    lag = ordered[0]
    if len(ordered) > 1:
        lag += 0.5 * ordered[1]
        dead += 0.5 * ordered[1] + sum(ordered[2:])
    slow = (speed + 1.0) * dead
    return Tuning(lag / (plant.gain * slow), min(lag, 4.0 * slow))


def closed_radius(plant: Plant, sample_time: float, scan: int, tuning: Tuning) -> float:
    """Return the largest closed-loop pole of a scan, counted per sample.

    A scan of several samples is the same loop with that sample time.
    """
    interval = scan * sample_time
    a, b, dead = plant.sampled(interval)
    forward = np.concatenate([np.zeros(dead + 1), b])
    share = interval / tuning.integral_time
    pi = tuning.gain * np.array([1.0 + share, -1.0])
    left = np.convolve([1.0, -1.0], np.concatenate([[1.0], a]))
    right = np.convolve(pi, forward)
    total = np.zeros(max(len(left), len(right)))
    total[: len(left)] += left
    total[: len(right)] += right
    roots: FloatArray = np.abs(np.roots(total))
    return math.pow(float(roots.max()), 1.0 / scan)


def calmed(plant: Plant, sample_time: float, scan: int, tuning: Tuning) -> Tuning:
    """Return the tuning with a gain so low that the loop decays well."""
    slow = 3.0 * (plant.slow + plant.dead_time)
    if plant.integrating:
        slow = max(slow, 1.5 * tuning.integral_time)
    limit = max(CALM, math.exp(-1.0 / (slow / sample_time + 10.0)))
    for _ in range(HALVINGS):
        if closed_radius(plant, sample_time, scan, tuning) <= limit:
            break
        tuning = Tuning(WEAKER * tuning.gain, tuning.integral_time / WEAKER**plant.integrating)
    return tuning


def tight(plant: Plant, sample_time: float, scan: int, tuning: Tuning, memory: float) -> Tuning:
    """Return the tuning with a gain so high that swings decay in ``memory`` samples only."""
    wanted = math.exp(-1.0 / memory)
    low, high = 0.2, 50.0
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        trial = Tuning(middle * tuning.gain, tuning.integral_time)
        if closed_radius(plant, sample_time, scan, trial) < wanted:
            low = middle
        else:
            high = middle
    return Tuning(low * tuning.gain, tuning.integral_time)
