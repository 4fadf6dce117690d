"""Noise and set-points of a blind loop."""

import dataclasses

import numpy as np

from stiction_ros.effects import ColouredDisturbance, FloatArray
from stiction_ros.loop import LoopModel, SetPoints
from stiction_studies.blind.loops.base_loops import BaseLoop
from stiction_studies.blind.loops.truth import Regime

PROCESSES = {"first": 2.0, "second": 3.0, "late": 1.5, "slow": 1.5, "coupled": 1.0, "tank": 1.0}
NOISES = {"measurement": 0.4, "ar1": 0.3, "equation": 0.3}
EXCITATIONS = {"moves": 0.7, "none": 0.15, "noise": 0.15}
REACH = 12.0  # % of travel that a set-point may ask, about the middle
KICK = 20.0  # % by which it may move OP at once


def drawn_regime(random: np.random.Generator) -> Regime:
    """Return random circumstances; without set-point moves a load keeps the loop busy."""
    excitation = pick(random, EXCITATIONS)
    loads = {name: NOISES[name] for name in ("ar1", "equation")}
    return Regime(
        process=pick(random, PROCESSES),
        tuning="tight" if random.random() < 0.2 else "normal",
        excitation=excitation,
        noise=pick(random, NOISES if excitation == "moves" else loads),
        half=bool(random.random() < 0.25),
    )


def pick(random: np.random.Generator, weights: dict[str, float]) -> str:
    """Return a key with a chance in proportion to its weight."""
    chances = np.array(list(weights.values()))
    return str(random.choice(list(weights), p=chances / chances.sum()))


@dataclasses.dataclass(frozen=True)
class NoiseSizes:
    """Noise of every output, units of PV; each of shape (p,)."""

    white: FloatArray  # on PV
    loads: FloatArray  # standard deviation at rest of what enters the loop, AR(1) or equation noise
    memory: FloatArray  # samples that AR(1) noise remembers


def drawn_noise(random: np.random.Generator, loop: BaseLoop, regime: Regime) -> NoiseSizes:
    """Return noise in proportion to the output's gain: so much per cent of travel."""
    p = len(loop.gains)
    white = random.uniform(0.03, 0.15, p)
    loads = random.uniform(0.1, 0.4, p)
    if regime.excitation == "noise":
        loads *= 3.0
    return NoiseSizes(white * loop.gains, loads * loop.gains, random.uniform(5.0, 40.0, p))


def with_noise(model: LoopModel, sizes: NoiseSizes, noise: str) -> LoopModel:
    """Return the loop with its noise.

    Equation noise has the place in the model that white noise on PV has otherwise; AR(1)
    noise is a coloured disturbance.
    """
    document = model.to_mapping()
    for i, output in enumerate(document["process"]["outputs"]):
        output["noise"] = {"std": float(sizes.white[i]), "enters": "measurement"}
        if noise == "equation":
            share = _stationary(model, i)
            output["noise"] = {"std": float(sizes.loads[i] / share), "enters": "equation"}
    noisy = LoopModel.from_mapping(document, model.name)
    if noise != "ar1":
        return noisy
    for i, name in enumerate(model.outputs):
        seconds = float(sizes.memory[i]) * model.sample_time
        coloured = ColouredDisturbance(float(sizes.loads[i]), seconds)
        noisy = noisy.with_effect(f"disturbance:{name}", coloured)
    return noisy


def _stationary(model: LoopModel, output: int) -> float:
    """Return the standard deviation of an output under equation noise of one, in open loop.

    Slow loops take what 200 samples gather.
    """
    process = model.process
    linear = process.linear(model.sample_time)
    gain = getattr(process, "noise_gain", np.eye(linear.order))
    state, total = gain[:, output], 0.0
    for _ in range(200):
        total += float(linear.c[output] @ state) ** 2
        state = linear.a @ state
    return float(np.sqrt(total))


def drawn_set_points(
    random: np.random.Generator, loop: BaseLoop, regime: Regime, samples: int
) -> SetPoints:
    """Return moves of one output after another, or none; ``samples`` after time 0."""
    start = loop.model.pv_start
    kicks = np.array([abs(tuning.gain) for tuning in loop.tunings]) * loop.gains
    reach = np.minimum(REACH, 0.5 * KICK / kicks)
    times, rows = [0.0], [start]
    if regime.excitation == "moves":
        settled = float((loop.slow + loop.delays).max())
        hold = min(max(3.0 * settled, 60.0), 200.0) / len(start)
        at, output = float(random.uniform(20.0, 60.0)), 0
        while at < samples - 20:
            row = rows[-1].copy()
            asked = float(random.uniform(-1.0, 1.0) * reach[output])
            row[output] = start[output] + asked * loop.gains[output]
            times.append(round(at) * loop.model.sample_time)
            rows.append(row)
            at += hold * float(random.uniform(0.7, 1.4))
            output = (output + 1) % len(start)
    return SetPoints(loop.model.outputs, np.array(times), np.array(rows))
