"""The process of a loop model from a system of SciPy or python-control, or from arrays."""

from typing import Any

import numpy as np

from stiction_ros.checks import number
from stiction_ros.errors import InputError
from stiction_ros.processes.sampled import WHOLE, transition

WANTED = "give a system of scipy.signal or control, (num, den), or (A, B, C, D)"


def process_of(system: Any, sample_time: float, dead_time: float) -> dict[str, Any]:
    """Return the section ``process`` of ``LoopModel.from_system``."""
    step = number(sample_time, "sample_time", above=0.0)
    late = number(dead_time, "dead_time", low=0.0)
    dt, given = getattr(system, "dt", None) or None, system
    if hasattr(system, "A"):
        given = (system.A, system.B, system.C, system.D)
    elif hasattr(system, "num"):
        given = (system.num, system.den)
    if not isinstance(given, tuple) or len(given) not in (2, 4):
        raise InputError(f"{type(system).__name__} is no linear system", where="system", fix=WANTED)
    if dt not in (None, True, step):
        raise InputError(f"the system has {dt:g} s, not {step:g} s", where="sample_time")
    arrays = [np.asarray(part, dtype=float) for part in given]
    if len(arrays) == 2:
        parts = [np.atleast_1d(np.squeeze(array)) for array in arrays]
        if dt or any(part.ndim > 1 for part in parts):
            said = "a discrete transfer function" if dt else "several transfer functions"
            fix = (
                f"give a state space, or write kind: {'arx' if dt else 'transfer_function'} in YAML"
            )
            raise InputError(f"{said} cannot be taken", where="system", fix=fix)
        ratio = {"num": parts[0].tolist(), "den": parts[1].tolist(), "dead_time": late}
        entry = {"name": "PV1"} | {key: {"V1": value} for key, value in ratio.items()}
        return {"kind": "transfer_function", "outputs": [entry]}
    a, b, c, d = map(np.atleast_2d, arrays)
    delay = round(late / step)
    if d.any():
        raise InputError("PV answers at once: D is not 0", where="system", fix="add a lag")
    if abs(delay - late / step) > WHOLE:
        said = f"{late:g} s are no whole number of samples of {step:g} s"
        raise InputError(said, where="dead_time", fix="give a transfer function")
    a, b = (a, b) if dt else transition(a, b, step)
    return {
        "kind": "state_space",
        "delay": {f"V{j + 1}": delay for j in range(b.shape[1])},
        "outputs": [{"name": f"PV{i + 1}"} for i in range(len(c))],
        **{key: part.tolist() for key, part in (("a", a), ("b", b), ("c", c))},
    }
