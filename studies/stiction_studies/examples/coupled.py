"""A loop of one, two or three valves that act on all outputs, under one PI controller each."""

import math
from typing import Any

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.loop import LoopModel, PiController, PiTuning, SetPoints, simulate_closed_loop
from stiction_studies.blind.pi_controllers import PiControllers
from stiction_studies.examples.example import Example

SAMPLES = 1500
MIDDLE = 50.0  # OP and PV of the operating point
# (f_S, f_D) of each valve, %.
FRICTIONS = ((5.0, 2.0), (0.0, 0.0), (4.0, 1.0))
# Rows are outputs, columns valves: units of PV per % at rest, and dead time in samples.
GAINS = ((1.0, 0.25, 0.1), (-0.2, 0.8, 0.2), (0.15, -0.15, 1.2))
DELAYS = ((1, 3, 2), (2, 2, 3), (3, 1, 1))
# Of each output, in samples.
TIME_CONSTANTS = ((10.0, 4.0), (14.0, 3.0), (8.0, 5.0))
_NOISE = 0.02
_HOLD = 40  # samples from one set-point move to the next
_SIZE = 5.0  # half of the range of set-points


def coupled_loop(seed: int, valves: int = 3, samples: int = SAMPLES) -> Example:
    """Return a loop of m outputs of second order and m valves, each of which moves all outputs.

    Valve j is moved by a PI controller from output j. V1 has f_S = 5 and f_D = 2, V2 follows
    OP, V3 has f_S = 4 and f_D = 1. The outputs' set-points move in turn. A loop of fewer
    valves is the leading part of that of three. Orders are known, n_a = n_b = 2; each delay is
    one of 0 to 4.

    Args:
        seed: of the noise (σ = 0.02 on every output) and of the set-points.
        valves: m, 1 to 3.
        samples: N, of 1 s.

    Raises:
        InputError: ``valves`` out of range.
    """
    if not 1 <= valves <= len(FRICTIONS):
        raise InputError(f"{valves} lies outside 1 to {len(FRICTIONS)}", where="valves")
    loop = _loop(valves)
    schedule = _set_points(np.random.default_rng([seed, 1]), loop.outputs, samples)
    run = simulate_closed_loop(loop, _controllers(valves), schedule, samples, seed)
    options = IdentificationOptions("exact", output_order=2, input_order=2, delay=(0, 4))
    return Example("coupled", f"{valves} valves", seed, run.record, loop, options)


def _controllers(valves: int) -> PiControllers:
    tunings = [PiTuning(0.9 / GAINS[i][i], TIME_CONSTANTS[i][0]) for i in range(valves)]
    return PiControllers([PiController(each, 1.0, MIDDLE, (0.0, 100.0)) for each in tunings])


def _loop(count: int) -> LoopModel:
    tags = [f"V{j + 1}" for j in range(count)]
    return LoopModel.from_mapping(
        {
            "loop": "coupled",
            "sample_time": 1.0,
            "valves": [_valve(tag, *FRICTIONS[j]) for j, tag in enumerate(tags)],
            "process": {"kind": "arx", "outputs": [_output(i, tags) for i in range(count)]},
            "operating_point": {
                "op": dict.fromkeys(tags, MIDDLE),
                "pv": {f"PV{i + 1}": MIDDLE for i in range(count)},
            },
        }
    )


def _valve(tag: str, static: float, dynamic: float) -> dict[str, Any]:
    friction = {"effect": "stiction", "law": "he", "f_s": static, "f_d": dynamic}
    effects = [friction] if static > 0.0 else []
    return {"name": tag, "limits": [0.0, 100.0], "effects": effects}


def _output(row: int, tags: list[str]) -> dict[str, Any]:
    """Return the equation (7) of an output whose valves share its two poles."""
    slow, fast = (math.exp(-1.0 / constant) for constant in TIME_CONSTANTS[row])
    a = [-(slow + fast), slow * fast]
    share = 1.0 + sum(a)
    return {
        "name": f"PV{row + 1}",
        "a": a,
        "b": {
            tag: [0.6 * gain * share, 0.4 * gain * share]
            for tag, gain in zip(tags, GAINS[row], strict=False)
        },
        "delay": dict(zip(tags, DELAYS[row], strict=False)),
        "noise": {"std": _NOISE},
    }


def _set_points(random: np.random.Generator, outputs: tuple[str, ...], samples: int) -> SetPoints:
    """Return a schedule in which one output after another moves."""
    times = np.append(0.0, np.arange(30.0, max(samples, 31), _HOLD))
    values = np.full((len(times), len(outputs)), MIDDLE)
    for move in range(1, len(times)):
        values[move] = values[move - 1]
        values[move, (move - 1) % len(outputs)] = MIDDLE + random.uniform(-_SIZE, _SIZE)
    return SetPoints(outputs, times, values)
