"""Open-loop experiments: random binary moves of the valves, and what the plant answers."""

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop.closed_loop import ClosedLoopRun, simulate_closed_loop
from stiction_ros.loop.model import LoopModel
from stiction_ros.records import Record

SWITCH_PROBABILITY = 0.05
LEVELS = (40.0, 60.0)


def random_binary(
    random: np.random.Generator,
    samples: int,
    valves: int,
    switch_probability: float = SWITCH_PROBABILITY,
    levels: tuple[float, float] = LEVELS,
) -> FloatArray:
    """Return independent random binary sequences, shape (samples, valves), %.

    Each valve starts at either of two ``levels`` with equal chance and changes to the other with
    ``switch_probability`` at every further sample, as in Appendix A.
    """
    if samples < 1 or valves < 1:
        raise InputError(f"{samples} samples of {valves} valves", where="samples", fix="use 1 up")
    low, high = levels
    switches = random.random((samples, valves)) < switch_probability
    switches[0] = random.random(valves) < 0.5
    return np.where(np.cumsum(switches, axis=0) % 2 == 1, high, low)


def simulate_open_loop(model: LoopModel, op: FloatArray, seed: int) -> ClosedLoopRun:
    """Return the run of the plant of ``model`` under given OP, (N, m), %, without set-points."""
    op = np.asarray(op, dtype=float)
    if op.ndim != 2 or op.shape[1] != len(model.valves):
        raise InputError(f"op has shape {op.shape}, not (N, {len(model.valves)})", where=model.name)
    if not np.isfinite(op).all():
        raise InputError("op is not finite", where=model.name)
    rows = iter(op)
    return simulate_closed_loop(model, lambda *_: next(rows), None, len(op), seed)


def prbs_experiment(model: LoopModel, samples: int, seed: int) -> Record:
    """Return the identification experiment of Appendix A on the plant of ``model``.

    Every valve moves by :func:`random_binary`, in open loop. The moves and the noise come from
    one seed but do not depend on each other.

    Raises:
        InputError: as :func:`random_binary`; a negative seed.

    Args:
        model: plant and starting point.
        samples: N ≥ 1.
        seed: 0 up.

    Returns:
        OP and stem in %, shape (N, m); PV in engineering units, shape (N, p); no set-points.

    Examples:
        >>> from stiction_ros import LoopModel, find_config, prbs_experiment
        >>> model = LoopModel.load(find_config("flow.loop.yaml"))
        >>> record = prbs_experiment(model, samples=200, seed=1)
        >>> sorted(set(record.op[:, 0].tolist()))
        [40.0, 60.0]
    """
    if seed < 0:
        raise InputError(f"{seed} is negative", where="seed")
    moves = np.random.default_rng([seed, 1])
    op = random_binary(moves, samples, len(model.valves))
    return simulate_open_loop(model, op, seed).record
