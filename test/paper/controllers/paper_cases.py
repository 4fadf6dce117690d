"""Small sticky loops for the tests of the paper's own formulations."""

import numpy as np
from loops import stable_model, target_at

from stiction_ros.effects import HeStiction
from stiction_ros.paper.controllers.augmented_cost import PlanProblem
from stiction_ros.paper.controllers.weights import (
    AugmentedWeights,
    PaperTuning,
    WarmStart,
    WeightPreset,
    augmented_weights,
)
from stiction_ros.processes import LinearModel

STICKY = HeStiction(8.0, 1.0)
LIMITS = np.array([[0.0, 100.0], [0.0, 100.0]])


def two_valves(seed: int = 3) -> LinearModel:
    """The first valve is the sticky one."""
    return stable_model(seed, 3, 2, 2)


def weights(model: LinearModel, horizon: int = 12) -> AugmentedWeights:
    return augmented_weights(WeightPreset.CORRECTED, model, horizon)


def tuning(
    model: LinearModel, horizon: int = 12, start: WarmStart = WarmStart.COMPENSATION
) -> PaperTuning:
    return PaperTuning(weights(model, horizon), start)


def situation(model: LinearModel, away: float, stem: float = 50.0) -> PlanProblem:
    """At rest with the stems at (``stem``, 50); the target lies ``away`` from the first stem."""
    start = np.array([stem, 50.0])
    rest = target_at(model, start)
    goal = target_at(model, start + np.array([away, 0.0]))
    return PlanProblem(rest.state, start, goal)
