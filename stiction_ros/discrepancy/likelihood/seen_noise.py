"""The declared noise as records show it: values rounded, and an OP that is not all that acted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.likelihood.declared_noise import (
    LONGEST,
    NEGLIGIBLE,
    UNSEEN,
    DeclaredNoise,
    declared_noise,
    rounded,
)
from stiction_ros.discrepancy.likelihood.state_noise import steady_gain
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxOutput, ArxProcess


def seen_noise(
    model: LoopModel, quanta: Sequence[float], unseen: Sequence[float]
) -> tuple[tuple[DeclaredNoise, ...], ...]:
    """Return per output the forms in which its declared noise may be seen; none without one.

    Args:
        model: that declares it.
        quanta: per output the distance of PV's values; 0 where there is none.
        unseen: per valve the variance of what may act beside the recorded OP, %²; empty for
            nothing.
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
    noise: DeclaredNoise, model: LoopModel, output: int, quantum: float, unseen: Sequence[float]
) -> DeclaredNoise | None:
    r"""Return a noise beside white noise of the OP that has passed the process.

    .. math:: r_k = n_k + \sum_j \frac{B_j(q)}{A(q)} w_{j,k}

    None where the process is no ARX process, or nothing of the OP's noise is seen.

    Args:
        noise: n, as it is declared.
        model: of the loop.
        output: its index.
        quantum: distance of PV's values.
        unseen: per valve the variance of w, %².
    """
    inner = model.process.inner if isinstance(model.process, AlteredProcess) else model.process
    if not isinstance(inner, ArxProcess):
        return None
    passed, driven = _of_op(inner.equations[output], model, unseen)
    white = quantum**2 / 12.0 + (0.0 if len(noise.ar) else noise.std**2)
    own = _companion(noise.ar)
    excited = np.zeros(own.shape)
    if len(own):
        excited[0, 0] = noise.std**2
    states, moved = block_diag(own, passed), block_diag(excited, driven)
    look = np.concatenate([np.eye(1, len(own))[0], np.eye(1, len(passed))[0]])
    steady = steady_gain(states, moved, look, max(white, UNSEEN * noise.std**2))
    if steady is None:
        return None
    gain, missed = steady
    whitening, kept, state = np.zeros(LONGEST), states - np.outer(gain, look), gain.copy()
    for lag in range(LONGEST):
        whitening[lag] = look @ state
        state = kept @ state
    last = int(np.max(np.flatnonzero(np.abs(whitening) > NEGLIGIBLE), initial=-1)) + 1
    found = DeclaredNoise(float(np.sqrt(missed)), whitening[:last])
    return None if _alike(found, noise) else found


def _of_op(
    equation: ArxOutput, model: LoopModel, unseen: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """Return the states of B/A, and what noise of the OP adds to their covariance."""
    ways = [np.asarray(equation.b.get(name, ()), dtype=float) for name in model.valve_names]
    count = max(len(equation.a), *(len(way) for way in ways))
    states = _companion(-np.pad(np.asarray(equation.a, dtype=float), (0, count - len(equation.a))))
    driven = np.zeros((count, count))
    for way, variance in zip(ways, unseen, strict=True):
        padded = np.pad(way, (0, count - len(way)))
        driven += variance * np.outer(padded, padded)
    return states, driven


def _companion(ar: FloatArray) -> FloatArray:
    """Return the states of an autoregression, the first of which is seen, shape (p, p)."""
    states = np.zeros((len(ar), len(ar)))
    if len(ar):
        states[:, 0] = ar
        states[:-1, 1:] += np.eye(len(ar) - 1)
    return states


def _alike(one: DeclaredNoise, other: DeclaredNoise) -> bool:
    """Tell whether two noises are whitened alike."""
    count = max(len(one.ar), len(other.ar))
    apart = np.pad(one.ar, (0, count - len(one.ar))) - np.pad(other.ar, (0, count - len(other.ar)))
    return float(np.abs(apart).max(initial=0.0)) <= NEGLIGIBLE
