"""Lines of a spectrum: sine and cosine at a period and at its harmonics."""

import functools

import numpy as np
from numpy.typing import NDArray

from stiction_ros.effects.behaviour import FloatArray

LEAST_PER_HARMONIC = 2.5  # samples that the fastest harmonic has per period at least
DEPENDENT = 1e-7  # size of a direction, of scaled columns, below which it is rounding


def waves_of(angle: FloatArray, harmonics: int) -> FloatArray:
    """Return sine and cosine of one harmonic after the other, shape (N, 2 H).

    Args:
        angle: of the fundamental, rad, shape (N,).
        harmonics: H.
    """
    turns = np.cumprod(np.tile(np.exp(1j * angle), (harmonics, 1)), axis=0)
    return np.stack([turns.imag, turns.real], axis=1).reshape(-1, len(angle)).T


def taken_by_waves(
    angle: FloatArray, harmonics: int, plain: FloatArray, left: FloatArray
) -> FloatArray:
    """Return what each sine and cosine takes of a signal beside those before it, shape (2 H,).

    Args:
        angle: of the fundamental, rad, shape (N,).
        harmonics: H.
        plain: orthonormal basis of what explains the signal without a wave, shape (N, q).
        left: of the signal by that basis, shape (N,).

    Returns:
        Energies, squared units of the signal; 0 where nothing but rounding is left of a wave.
    """
    lines = waves_of(angle, harmonics)
    basis, sizes = np.linalg.qr(lines - plain @ (plain.T @ lines))
    there = np.diag(sizes) ** 2 > DEPENDENT * np.einsum("ij,ij->j", lines, lines)
    return np.where(there, (basis.T @ left) ** 2, 0.0)


@functools.lru_cache(maxsize=2)
def _doubled(count: int, length: int) -> NDArray[np.complex128]:
    """Return the transform of a constant at twice each frequency, not to be written to."""
    return np.fft.fft(np.ones(count), length)[::2]


def taken_by_lines(left: FloatArray, plain: FloatArray, length: int) -> FloatArray:
    """Return the energy that one line takes, at k / ``length`` turns a row, (length / 2,).

    Products of sine and cosine with anything come from its Fourier transform, those with each
    other from that of a constant at twice the frequency.

    Args:
        left: of a signal by ``plain``, shape (N,).
        plain: orthonormal basis of what explains the signal without a line, shape (N, q).
        length: even, at least N.
    """
    count, half = len(left), length // 2
    sums = np.fft.rfft(left, length)[:half]
    double = _doubled(count, length)
    cc, ss = 0.5 * (count + double.real), 0.5 * (count - double.real)
    cs = -0.5 * double.imag
    for column in plain.T:
        known = np.fft.rfft(column, length)[:half]
        cc, ss = cc - known.real**2, ss - known.imag**2
        cs = cs + known.real * known.imag
    c, s = sums.real, -sums.imag
    determinant = np.maximum(cc * ss - cs**2, 1e-9 * count**2)
    taken = (ss * c**2 - 2.0 * cs * c * s + cc * s**2) / determinant
    return np.clip(taken, 0.0, float(left @ left))


def fitted_lines(
    values: FloatArray, period: float, harmonics: int = 1
) -> tuple[FloatArray, FloatArray]:
    """Return a constant and the lines that fit a signal best, and their sum, shape (N,).

    Args:
        values: shape (N,).
        period: samples.
        harmonics: H.

    Returns:
        Constant, then cosine and sine amplitude of each harmonic, shape (1 + 2 H,).
    """
    angle = 2 * np.pi / period * np.arange(len(values))
    columns = [np.ones(len(values))]
    for k in range(1, harmonics + 1):
        columns += [np.cos(k * angle), np.sin(k * angle)]
    basis = np.column_stack(columns)
    fitted = np.linalg.lstsq(basis, values, rcond=None)[0]
    return np.asarray(fitted), np.asarray(basis @ fitted)
