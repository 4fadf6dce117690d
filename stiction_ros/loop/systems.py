"""The process of a loop model from a system of SciPy or python-control, or from arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.checks import number
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes.sampled import WHOLE, Sampled, beside, companion, held
from stiction_ros.texts import plural

WANTED = "give a system of scipy.signal or control, (num, den), or (A, B, C, D)"


def process_of(
    system: Any,
    sample_time: float | None,
    dead_time: float,
    valves: Sequence[str] | None,
    outputs: Sequence[str] | None,
) -> tuple[float, list[str], list[str], dict[str, Any]]:
    """Return sample time, tags of the valves and of the outputs, and the section ``process``.

    Args:
        system, sample_time, dead_time, valves, outputs: as
            :meth:`stiction_ros.loop.model.LoopModel.from_system`.

    Raises:
        InputError: no linear system, or one that no loop model can hold.
    """
    dt, parts = getattr(system, "dt", None), _parts(system)
    own = None if dt is None or dt is True or dt == 0 else float(dt)
    if own is not None and sample_time not in (None, own):
        raise InputError(f"the system has {own:g} s", where="sample_time", fix="leave it out")
    if own is None and sample_time is None:
        raise InputError("the system has none", where="sample_time", fix="give it in s")
    step = number(own or sample_time, "sample_time", above=0.0)
    late = number(dead_time, "dead_time", low=0.0)
    ratio = len(parts) == 2
    rows, columns = (len(parts[0]), len(parts[0][0])) if ratio else (len(parts[2]), len(parts[1].T))
    names = list(outputs or (f"PV{i + 1}" for i in range(rows)))
    tags = list(valves or (f"V{j + 1}" for j in range(columns)))
    if (len(names), len(tags)) != (rows, columns):
        said = f"the system has {plural(rows, 'output')} and {plural(columns, 'input')}"
        raise InputError(said, where="system", fix="name as many outputs and valves")
    if ratio and not dt:
        entries = [
            {"name": name, "num": dict(zip(tags, num, strict=True))}
            | {"den": dict(zip(tags, den, strict=True)), "dead_time": dict.fromkeys(tags, late)}
            for name, num, den in zip(names, *parts, strict=True)
        ]
        return step, tags, names, {"kind": "transfer_function", "outputs": entries}
    samples = round(late / step)
    if dt and abs(samples - late / step) > WHOLE:
        said = f"{late:g} s are no whole number of samples of {step:g} s"
        raise InputError(said, where="dead_time", fix="give a continuous system")
    if ratio:
        channels = {
            (i, j): _delayed(*companion(num, den), samples)
            for i, row in enumerate(zip(*parts, strict=True))
            for j, (num, den) in enumerate(zip(*row, strict=True))
        }
        found = beside(channels, rows, columns)
    else:
        a, b, c = parts
        found = _delayed(a, b, c, samples) if dt else held(a, b, c, late, step)
    matrices = {key: each.tolist() for key, each in zip("abc", found.with_past(), strict=True)}
    named = [{"name": name} for name in names]
    return step, tags, names, {"kind": "state_space", **matrices, "outputs": named}


def _parts(system: Any) -> tuple[Any, ...]:
    """Return numerators and denominators, lists by output and input, or A, B and C."""
    given = system
    if hasattr(system, "A"):
        given = (system.A, system.B, system.C, system.D)
    elif hasattr(system, "num") or hasattr(system, "to_tf"):
        ratio = system if hasattr(system, "num") else system.to_tf()
        given = (ratio.num, ratio.den)
    if not isinstance(given, tuple) or len(given) not in (2, 4):
        raise InputError(f"{type(system).__name__} is no linear system", where="system", fix=WANTED)
    if len(given) == 4:
        *parts, d = (np.atleast_2d(np.asarray(part, dtype=float)) for part in given)
        if d.any():
            raise InputError("PV answers at once: D is not 0", where="system", fix="add a lag")
        return tuple(parts)
    num, den = map(_grid, given)
    return num, den * len(num) if len(den) == 1 else den


def _grid(given: Any) -> list[list[list[float]]]:
    """Return coefficients by output and input, those of one input or of one channel, too."""
    if np.isscalar(given[0]):
        given = [[given]]
    elif np.isscalar(given[0][0]):
        given = [[row] for row in given]
    return [[np.asarray(each, dtype=float).tolist() for each in row] for row in given]


def _delayed(a: FloatArray, b: FloatArray, c: FloatArray, delay: int) -> Sampled:
    """Return a discrete system with a delay, samples, of all inputs."""
    return Sampled(a, np.pad(b[None], ((delay, 0), (0, 0), (0, 0))), c)
