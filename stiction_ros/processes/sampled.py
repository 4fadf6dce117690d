"""Transfer functions as difference equations of samples, stems held between them."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError

WHOLE = 1e-9  # samples by which a dead time may be off a whole number of them and counts as that
Channel = tuple[FloatArray, FloatArray, int]  # b₁ …, a₀ = 1, a₁ … and the delay in samples


def held(num: ArrayLike, den: ArrayLike, dead_time: float, sample_time: float) -> Channel:
    """Return a continuous transfer function at its samples, the stem held between them.

    ``num`` and ``den`` begin with the highest power of s; the dead time, s, need be no whole
    number of samples. A PV that would answer at once is refused.
    """
    above, below = (np.trim_zeros(np.array(each, dtype=float), "f") for each in (num, den))
    n = len(below) - 1
    if len(above) > n:
        said = f"num has {len(above)} coefficients, den {len(below)}"
        raise InputError(f"PV answers at once: {said}", fix="give more in den than in num")
    whole = math.floor(dead_time / sample_time + WHOLE)
    part = max(dead_time - whole * sample_time, 0.0)
    states, poles = pulses(below, part, sample_time)
    pulse = np.pad(above, (n - len(above), 0)) / below[0] @ states
    taps = np.convolve(pulse, poles)[: n + 1]
    return taps if part > WHOLE * sample_time else taps[:n], poles, whole


def pulses(den: FloatArray, part: float, sample_time: float) -> tuple[FloatArray, FloatArray]:
    """Return what a stem does that is held at 1 for one sample, and the poles as a polynomial.

    Args:
        den: of s, the highest power first, shape (n + 1,).
        part: of the dead time beyond whole samples, s.
        sample_time: s.

    Returns:
        The answers of s^(n−1) / den, …, 1 / den by den's first figure, from the first sample on,
        shape (n, n + 1), and 1, a₁, … of the equation.
    """
    n = len(den) - 1
    a, b = np.eye(n, k=-1), np.eye(n, 1)
    a[0] = -den[1:] / den[0]
    late, late_in = transition(a, b, part)
    early, early_in = transition(a, b, sample_time - part)
    states = [early_in, early @ (late_in + late @ early_in)]
    while len(states) <= n:
        states.append(early @ late @ states[-1])
    return np.hstack(states), np.asarray(np.poly(early @ late), dtype=np.float64)


def transition(a: FloatArray, b: FloatArray, time: float) -> tuple[FloatArray, FloatArray]:
    """Return e^{A t}, and what inputs bring that are held for that time, s."""
    from scipy.linalg import expm  # slow to import

    n, m = b.shape
    whole = expm(time * np.vstack([np.hstack([a, b]), np.zeros((m, n + m))]))
    return whole[:n, :n], whole[:n, n:]


def equation(channels: Mapping[str, Channel]) -> dict[str, dict[str, list[float]] | list[float]]:
    """Return ``a``, ``b`` and ``delay`` of the ARX equation of one PV, by valve."""
    whole, taps = np.ones(1), {valve: b for valve, (b, _, _) in channels.items()}
    for valve, (_, a, _) in channels.items():
        whole = np.convolve(whole, a)
        taps = {other: b if other == valve else np.convolve(b, a) for other, b in taps.items()}
    delay = {valve: late for valve, (_, _, late) in channels.items()}
    return {
        "a": whole[1:].tolist(),
        "b": {valve: b.tolist() for valve, b in taps.items()},
        "delay": delay,
    }
