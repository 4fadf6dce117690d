"""The declared noise as records show it: values rounded, and an OP that is not all that acted."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from stiction_ros.discrepancy.likelihood.declared_noise import (
    UNSEEN,
    DeclaredNoise,
    declared_noise,
    rounded,
)
from stiction_ros.discrepancy.likelihood.slow_noise import NEGLIGIBLE, REMEMBERED, counting
from stiction_ros.discrepancy.likelihood.state_noise import steady_gain
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, ArxOutput, ArxProcess
from stiction_ros.signals.autoregression import companion


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
    inner = model.process.inner if isinstance(model.process, AlteredProcess) else model.process
    if not isinstance(inner, ArxProcess):
        return None
    passed, driven, shown = _of_op(inner.equations[output], model, unseen)
    white = quantum**2 / 12.0 + (0.0 if len(noise.ar) else noise.std**2)
    own = companion(noise.ar)
    excited = np.zeros(own.shape)
    if len(own):
        excited[0, 0] = noise.std**2
    states, moved = block_diag(own, passed), block_diag(excited, driven)
    look = np.concatenate([np.eye(1, len(own))[0], shown])
    steady = steady_gain(states, moved, look, max(white, UNSEEN * noise.std**2))
    if steady is None:
        return None
    gain, missed = steady
    whitening, kept, state = np.zeros(REMEMBERED), states - np.outer(gain, look), gain.copy()
    for lag in range(REMEMBERED):
        whitening[lag] = look @ state
        state = kept @ state
    found = DeclaredNoise(float(np.sqrt(missed)), counting(whitening))
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
