"""Small records whose truth is known, made here and nowhere else."""

import numpy as np
from numpy.typing import NDArray

from stiction_ros.records import Record

FloatArray = NDArray[np.float64]


def he(op: FloatArray, static: float, dynamic: float) -> FloatArray:
    """Return the stem by He's law."""
    stem, out = float(op[0]), np.empty(len(op))
    for k, u in enumerate(op):
        error = u - stem
        if abs(error) > static:
            stem = u - np.sign(error) * dynamic
        out[k] = stem
    return out


def pi_loop(
    static: float, dynamic: float, *, seed: int = 0, samples: int = 700, noise: float = 0.02
) -> Record:
    """Return a first-order process with dead time under PI control, its valve sticky or not."""
    random = np.random.default_rng(seed)
    op, pv, sp = (np.zeros(samples) for _ in range(3))
    sp[:] = np.repeat(random.uniform(-2.0, 2.0, 1 + samples // 140), 140)[:samples]
    stem, stems, load = 0.0, np.zeros(samples), 0.0
    y, last = 0.0, 0.0
    for k in range(samples):
        load = 0.95 * load + 0.05 * random.standard_normal()
        y = 0.9 * y + 0.1 * (stems[k - 3] if k >= 3 else 0.0) + 0.1 * load
        pv[k] = y + noise * random.standard_normal()
        error = sp[k] - pv[k]
        op[k] = (op[k - 1] if k else 0.0) + 1.0 * (error - last) + error / 12.0
        last = error
        if abs(op[k] - stem) > static:
            stem = op[k] - np.sign(op[k] - stem) * dynamic
        stems[k] = stem
    return Record("loop", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], sp=sp[:, None])


def slow_loop(*, seed: int = 0, samples: int = 2400) -> Record:
    """Return a process with a time constant of 100 samples under PI control, no friction."""
    random = np.random.default_rng(seed)
    sp = 2.0 * (np.arange(samples) // 300 % 2)
    op, pv = np.zeros(samples), np.zeros(samples)
    y, u, last = 0.0, 0.0, 0.0
    for k in range(samples):
        y = 0.99 * y + 0.01 * u
        pv[k] = y + 0.05 * random.standard_normal()
        error = sp[k] - pv[k]
        op[k] = u = u + 3.0 * (error - last + error / 60.0)
        last = error
    return Record("slow", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], sp=sp[:, None])
