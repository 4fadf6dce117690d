"""The noise that a loop model declares, as autoregressions of what its free run leaves."""

import dataclasses

import numpy as np
from scipy.linalg import solve_toeplitz

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.likelihood.slow_noise import NEGLIGIBLE
from stiction_ros.discrepancy.likelihood.state_noise import steady_gain
from stiction_ros.effects import ColouredDisturbance, FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxProcess, NoiseEntry
from stiction_ros.signals.autoregression import companion

LONGEST = 20  # samples that an autoregression of declared noises reaches back
UNSEEN = 1e-3  # of the variance of a noise, that rounding may add to it when it is whitened


@dataclasses.dataclass(frozen=True)
class DeclaredNoise:
    r"""Noise of one output as its model declares it.

    White noise of the equation leaves :math:`r = v / A(q)` behind a free run, noise of the
    measurement is left as it is, beside a coloured disturbance it is an autoregression of as
    many terms as count.
    """

    std: float  # of the innovations, units of the output
    ar: FloatArray  # φ of what the free run leaves, shape (p,); p = 0 for noise of the measurement


def declared_noise(model: LoopModel) -> tuple[DeclaredNoise | None, ...]:
    """Return the declared noise of every output; None where there is none, or no such form.

    Noise that enters the state of a process which is no ARX equation is coloured by more than
    poles; it is left to be found.
    """
    process = model.process
    inner = process.inner if isinstance(process, AlteredProcess) else process
    found: list[DeclaredNoise | None] = []
    for i, (name, noise) in enumerate(zip(process.outputs, process.noise, strict=True)):
        coloured = [
            each.behaviour
            for each in model.disturbances
            if each.place == name
            and not each.load
            and isinstance(each.behaviour, ColouredDisturbance)
        ]
        of_equation = noise.std > 0.0 and noise.enters is NoiseEntry.EQUATION
        if of_equation and not coloured and isinstance(inner, ArxProcess):
            ar = -np.asarray(inner.equations[i].a, dtype=float)
            found.append(DeclaredNoise(noise.std, ar))
        elif of_equation or (noise.std <= 0.0 and not coloured):
            found.append(None)
        else:
            found.append(_beside_white(noise.std, coloured, model.sample_time))
    return tuple(found)


def _beside_white(
    white: float, coloured: list[ColouredDisturbance], sample_time: float
) -> DeclaredNoise:
    """Return the autoregression of white noise and first-order noises together.

    Its φ solve the Yule-Walker equations of their covariance; terms at the end that do not
    count are left out.
    """
    lags = np.arange(LONGEST + 1) * sample_time
    covariance = np.zeros(LONGEST + 1)
    covariance[0] = white**2
    for each in coloured:
        covariance += each.std**2 * np.exp(-lags / each.time_constant)
    if not coloured:
        return DeclaredNoise(white, np.zeros(0))
    ar = np.asarray(solve_toeplitz(covariance[:-1], covariance[1:]))
    last = int(np.max(np.flatnonzero(np.abs(ar) > NEGLIGIBLE), initial=-1)) + 1
    variance = float(covariance[0] - ar @ covariance[1:])
    return DeclaredNoise(float(np.sqrt(max(variance, 0.0))), ar[:last])


def rounded(noise: DeclaredNoise, quantum: float) -> DeclaredNoise:
    """Return a noise as values rounded to a quantum show it, however fine they are.

    Rounding is white. Beside noise of an equation, whose whitening makes it larger, that is seen
    long before it is coarse.
    """
    count, white = len(noise.ar), quantum**2 / 12.0
    if not count or white * (1.0 + float(noise.ar @ noise.ar)) < UNSEEN * noise.std**2:
        return noise
    driven, look = np.zeros((count, count)), np.eye(count)[0]
    driven[0, 0] = 1.0
    steady = steady_gain(companion(noise.ar), driven, look, white / noise.std**2)
    if steady is None:
        return noise
    gain, missed = steady
    moving = np.concatenate([[1.0], gain - noise.ar])  # of the innovations, over A
    inverse = np.asarray(lfilter([1.0], moving, np.eye(1, LONGEST)[0]))
    last = int(np.max(np.flatnonzero(np.abs(inverse) > NEGLIGIBLE))) + 1
    whitening = np.convolve(np.concatenate([[1.0], -noise.ar]), inverse[:last])
    return DeclaredNoise(noise.std * float(np.sqrt(missed)), -whitening[1:])


def behind_lag(ar: FloatArray, keep: float) -> FloatArray:
    """Return φ of noise that has passed a first-order lag.

    Args:
        ar: φ before the lag, shape (p,).
        keep: e^(−T_s/τ), the pole of the lag.
    """
    before = np.concatenate([[1.0], -ar])
    return -np.convolve(before, [1.0, -keep])[1:]
