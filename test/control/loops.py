"""Small models and literal re-implementations that the tests of control share."""

import numpy as np
from hypothesis import strategies as st

from stiction_ros.control import ControlDesign
from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.control.observer import ObserverKind, ObserverTuning
from stiction_ros.control.target import Target
from stiction_ros.processes import LinearModel

INF = np.inf


def stable_model(seed: int, n: int, m: int, p: int, *, pole: float = 0.9) -> LinearModel:
    """A random stable model about a random operating point."""
    random = np.random.default_rng(seed)
    a = random.normal(size=(n, n))
    a *= random.uniform(0.2, pole) / max(np.abs(np.linalg.eigvals(a)).max(), 1e-6)
    return LinearModel(
        a,
        random.normal(size=(n, m)),
        random.normal(size=(p, n)),
        np.zeros((n, 0)),
        0.1 * random.normal(size=n),
        random.uniform(30.0, 70.0, m),
        random.normal(size=p),
    )


@st.composite
def models(draw: st.DrawFn, outputs: int = 2, valves: int = 3) -> LinearModel:
    return stable_model(
        draw(st.integers(0, 2**32 - 1)),
        draw(st.integers(1, 4)),
        draw(st.integers(1, valves)),
        draw(st.integers(1, outputs)),
    )


def first_order(gain: float = 0.5, pole: float = 0.9) -> LinearModel:
    """One valve, one output, y about 20 at 50 %."""
    return LinearModel(
        np.array([[pole]]),
        np.array([[gain * (1.0 - pole)]]),
        np.eye(1),
        np.zeros((1, 0)),
        np.zeros(1),
        np.array([50.0]),
        np.array([20.0]),
    )


def weights_for(
    model: LinearModel, horizon: int = 6, move: float = 0.1, seed: int = 0
) -> HorizonWeights:
    n, m = model.order, len(model.stem0)
    root = np.random.default_rng(seed).normal(size=(n, n))
    q = model.c.T @ model.c + 0.01 * np.eye(n)
    return HorizonWeights(horizon, q, move * np.eye(m), q + 0.1 * root @ root.T)


def limits_for(
    model: LinearModel,
    low: float = 0.0,
    high: float = 100.0,
    move: float = INF,
    output: tuple[float, float] = (-INF, INF),
) -> HorizonLimits:
    m, p = len(model.stem0), len(model.pv0)
    return HorizonLimits(
        np.tile([low, high], (m, 1)), np.full(m, move), np.tile(np.array(output), (p, 1))
    )


def target_at(
    model: LinearModel, stem: np.ndarray, disturbance: np.ndarray | None = None
) -> Target:
    """The steady state with the stems at ``stem``."""
    drive = model.b @ (stem - model.stem0) + model.constant
    state = np.linalg.solve(np.eye(model.order) - model.a, drive)
    pv = model.c @ state + model.pv0
    if disturbance is not None:
        pv = pv + disturbance
    return Target(state, stem, pv, True, np.zeros(len(pv)))


def equation_19a(
    model: LinearModel,
    weights: HorizonWeights,
    state: np.ndarray,
    last: np.ndarray,
    target: Target,
    stems: np.ndarray,
) -> float:
    """The cost (19a) of the stems (N, m), summed step by step along the simulated model."""
    x, before, cost = state, last, 0.0
    for stem in stems:
        z, move = x - target.state, stem - before
        cost += z @ weights.state @ z + move @ weights.move @ move
        x = model.a @ x + model.b @ (stem - model.stem0) + model.constant
        before = stem
    z = x - target.state
    return float(cost + z @ weights.terminal @ z)


def outputs_of(
    model: LinearModel, state: np.ndarray, stems: np.ndarray, disturbance: np.ndarray
) -> np.ndarray:
    """Outputs at samples 0 … N, simulated step by step."""
    x, out = state, [model.c @ state + model.pv0 + disturbance]
    for stem in stems:
        x = model.a @ x + model.b @ (stem - model.stem0) + model.constant
        out.append(model.c @ x + model.pv0 + disturbance)
    return np.array(out)


def kalman(p: int) -> ObserverTuning:
    return ObserverTuning(ObserverKind.KALMAN, 1.0, np.full(p, 1e-2), np.full(p, 1e-2))


def luenberger(p: int, gain: float = 0.2) -> ObserverTuning:
    return ObserverTuning(ObserverKind.LUENBERGER, 1.0, np.ones(p), np.ones(p), gain)


def design_of(
    model: LinearModel, limits: HorizonLimits, weights: HorizonWeights, observer: ObserverTuning
) -> ControlDesign:
    return ControlDesign(model, limits, weights, weights, np.ones(len(model.pv0)), observer)
