"""The noise that a loop model declares, as autoregressions of what its free run leaves.

Records show it with values rounded, and beside an OP that is not all that acted.
"""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag, solve_toeplitz

from stiction_ros.deferred import lfilter
from stiction_ros.discrepancy.likelihood.slow_noise import REMEMBERED, counting
from stiction_ros.discrepancy.measures import NEGLIGIBLE, ROUNDING, STEPS, TRACE
from stiction_ros.effects import ColouredDisturbance, FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxOutput, ArxProcess, NoiseEntry, Process
from stiction_ros.signals.autoregression import companion


@dataclasses.dataclass(frozen=True)
class DeclaredNoise:
    r"""Noise of one output as its model declares it.

    White noise of the equation leaves :math:`r = v / A(q)` behind a free run, noise of the
    measurement is left as it is, beside a coloured disturbance it is an autoregression of as
    many terms as count.
    """

    std: float  # of the innovations, units of the output
    ar: FloatArray  # φ of what the free run leaves, shape (p,); p = 0 for noise of the measurement


def arx_equations(process: Process) -> tuple[ArxOutput, ...] | None:
    """Return the equations of an ARX process, behind effects if any; None of another process."""
    inner = process.inner if isinstance(process, AlteredProcess) else process
    return inner.equations if isinstance(inner, ArxProcess) else None


def declared_noise(model: LoopModel) -> tuple[DeclaredNoise | None, ...]:
    """Return the declared noise of every output; None where there is none, or no such form.

    Noise that enters the state of a process which is no ARX equation is coloured by more than
    poles; it is left to be found.
    """
    process, equations = model.process, arx_equations(model.process)
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
        if of_equation and not coloured and equations is not None:
            ar = -np.asarray(equations[i].a, dtype=float)
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
    lags = np.arange(REMEMBERED + 1) * sample_time
    covariance = np.zeros(REMEMBERED + 1)
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
    if not count or white * (1.0 + float(noise.ar @ noise.ar)) < TRACE * noise.std**2:
        return noise
    look = np.eye(count)[0]
    driven = noise.std**2 * np.outer(look, look)
    return _whitened(companion(noise.ar), driven, look, white)


def _whitened(
    states: FloatArray, driven: FloatArray, look: FloatArray, white: float
) -> DeclaredNoise:
    """Return the noise of states that one output sees beside a white one, as an autoregression.

    Terms beyond the last one are added to the last one: noise with a pole at 1 keeps that pole.

    Args:
        states: their matrix, shape (n, n).
        driven: what is added to their covariance in a sample, shape (n, n).
        look: what is seen of them, shape (n,).
        white: variance of the white one.
    """
    (gain,), (missed,) = steady_gain(states[None], driven[None], look, white)
    over, under = (np.real(np.poly(each)) for each in (states, states - np.outer(gain, look)))
    ar = counting(-np.asarray(lfilter(over, under, np.eye(1, REMEMBERED + 1)[0]))[1:])
    ar[-1:] += 1.0 - over.sum() / under.sum() - ar.sum()
    return DeclaredNoise(float(np.sqrt(missed)), ar)


def behind_lag(ar: FloatArray, keep: float) -> FloatArray:
    """Return φ of noise that has passed a first-order lag.

    Args:
        ar: φ before the lag, shape (p,).
        keep: e^(−T_s/τ), the pole of the lag.
    """
    before = np.concatenate([[1.0], -ar])
    return -np.convolve(before, [1.0, -keep])[1:]


@dataclasses.dataclass(frozen=True)
class Unseen:
    """What may act beside the recorded OP of a valve."""

    variance: float  # %²
    keep: float = 0.0  # correlation of neighbouring samples, 0 (white) to 1


def seen_noise(
    model: LoopModel, quanta: Sequence[float], unseen: Sequence[Sequence[Unseen]]
) -> tuple[tuple[DeclaredNoise, ...], ...]:
    """Return per output the forms in which its declared noise may be seen; none without one.

    Args:
        model: that declares it.
        quanta: per output the distance of PV's values; 0 where there is none.
        unseen: per valve what may act beside the recorded OP; empty for nothing.
    """
    found = []
    for i, (noise, quantum) in enumerate(zip(declared_noise(model), quanta, strict=True)):
        forms = () if noise is None else (rounded(noise, quantum),)
        if noise is not None and any(unseen):
            beside = beside_unseen(noise, model, i, quantum, unseen)
            forms = forms if beside is None else (*forms, beside)
        found.append(forms)
    return tuple(found)


def beside_unseen(
    noise: DeclaredNoise,
    model: LoopModel,
    output: int,
    quantum: float,
    unseen: Sequence[Sequence[Unseen]],
) -> DeclaredNoise | None:
    r"""Return a noise beside first-order noise of the OP that has passed the process.

    .. math:: r_k = n_k + \sum_j \frac{B_j(q)}{A(q)} w_{j,k}

    None where the process is no ARX process, or nothing of the OP's noise is seen.

    Args:
        noise: n, as it is declared.
        model: of the loop.
        output: its index.
        quantum: distance of PV's values.
        unseen: per valve the parts of w.
    """
    equations = arx_equations(model.process)
    if equations is None:
        return None
    states, driven, look = _of_op(equations[output], model, unseen)
    white = quantum**2 / 12.0
    if np.array_equal(noise.ar, -np.asarray(equations[output].a)):  # it passes the same poles
        driven[0, 0] += noise.std**2
    elif len(noise.ar):
        own, first = companion(noise.ar), np.eye(len(noise.ar))[0]
        driven = block_diag(noise.std**2 * np.outer(first, first), driven)
        states, look = block_diag(own, states), np.concatenate([first, look])
    else:
        white += noise.std**2
    found = _whitened(states, driven, look, max(white, TRACE * noise.std**2))
    return None if _alike(found, noise) else found


def _of_op(
    equation: ArxOutput, model: LoopModel, unseen: Sequence[Sequence[Unseen]]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return states of B/A and of w, what is added to their covariance, and what is seen of them.

    White parts of w are no states.
    """
    ways = [np.asarray(equation.b.get(name, ()), dtype=float) for name in model.valve_names]
    count = max(len(equation.a), *(len(way) for way in ways))
    states = companion(-np.pad(np.asarray(equation.a, dtype=float), (0, count - len(equation.a))))
    parts = [
        (np.pad(way, (0, count - len(way))), each)
        for way, beside in zip(ways, unseen, strict=True)
        for each in beside
    ]
    lasting = [(way, each) for way, each in parts if each.keep > 0.0]
    driven = np.zeros((count + len(lasting),) * 2)
    for way, each in parts:
        if not each.keep > 0.0:
            driven[:count, :count] += each.variance * np.outer(way, way)
    whole = block_diag(states, np.diag([each.keep for _, each in lasting]))
    for k, (way, each) in enumerate(lasting, start=count):
        whole[:count, k] = way
        driven[k, k] = each.variance * (1.0 - each.keep**2)
    return whole, driven, np.eye(1, len(whole))[0]


def _alike(one: DeclaredNoise, other: DeclaredNoise) -> bool:
    """Tell whether two noises are whitened alike."""
    count = max(len(one.ar), len(other.ar))
    apart = np.pad(one.ar, (0, count - len(one.ar))) - np.pad(other.ar, (0, count - len(other.ar)))
    return float(np.abs(apart).max(initial=0.0)) <= NEGLIGIBLE


def steady_gain(
    a: FloatArray, q: FloatArray, c: FloatArray, r: float
) -> tuple[FloatArray, FloatArray]:
    """Return Kalman's gains, shape (G, n), and the variances of what their predictions miss, (G,).

    They are those after a million samples, by doubling, or before what no output tells has grown
    beyond all bounds: the levels of two noises of which only the sum is seen.

    Args:
        a, q: of the states, shape (G, n, n).
        c: of the one output, shape (n,).
        r: its variance, above 0.

    References:
        E. K.-W. Chu, H.-Y. Fan, W.-W. Lin, C.-S. Wang, Int. J. Control 77 (2004) 767-788.
    """
    eye, moves, p = np.eye(len(c)), np.swapaxes(a, 1, 2), q
    told = np.broadcast_to(np.outer(c, c) / r, a.shape)
    for _ in range(STEPS):
        now = np.linalg.solve(eye + told @ p, np.concatenate([moves, told], axis=2))
        on, across = now[:, :, : len(c)], now[:, :, len(c) :]
        back = np.swapaxes(moves, 1, 2)
        more = p + back @ p @ on
        if np.abs(more).max(initial=0.0) > np.abs(q).max(initial=0.0) / ROUNDING:
            break
        told, p, moves = told + moves @ across @ back, more, moves @ on
    missed = c @ p @ c + r
    return a @ p @ c / missed[:, None], missed
