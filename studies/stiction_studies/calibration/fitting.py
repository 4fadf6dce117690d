"""The probability of friction fitted to figures of known loops, and how well it is calibrated."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.judgement import (
    Figures,
    Model,
    Node,
    VerdictKind,
    definitions,
    friction_probability,
    verdict_of,
)

TREES, LEAVES, RATE = 300, 12, 0.04  # of the boosting
DRAWN = 0.3  # share of the figures that may divide a node: trees differ, and one loop moves P less
FEWEST = 6  # loops in a leaf
SHRUNK = 4.0
"""Penalty of the squared values of leaves. In eight-fold trials on six worlds it gives the least
loss; with 2, one in a hundred more is found, and a quarter more wrongly."""
FOLDS = 8


@dataclasses.dataclass(frozen=True)
class Judged:
    """One known loop and its figures."""

    world: str
    seed: int
    friction: bool
    figures: Figures


def fitted(rows: Sequence[Judged], without: str | None = None) -> Model:
    """Return the trees fitted to known loops.

    Args:
        rows: known loops.
        without: name of a figure that is left out.
    """
    from sklearn.ensemble import HistGradientBoostingClassifier  # type: ignore[import-untyped]

    names = [name for name in definitions() if name != without]
    features = np.array([[row.figures.to_dict()[name] for name in names] for row in rows])
    truth = np.array([row.friction for row in rows])
    boosting = HistGradientBoostingClassifier(
        max_iter=TREES,
        max_leaf_nodes=LEAVES,
        learning_rate=RATE,
        min_samples_leaf=FEWEST,
        max_features=DRAWN,
        l2_regularization=SHRUNK,
        monotonic_cst=[definitions()[name]["sign"] for name in names],
        early_stopping=False,
        random_state=0,
    ).fit(features, truth)
    trees = tuple(_nodes(tree.nodes, names) for (tree,) in boosting._predictors)
    return Model(float(boosting._baseline_prediction[0, 0]), trees)


def _nodes(nodes: Any, names: Sequence[str]) -> tuple[Node, ...]:
    """Return a tree; the value of an inner node is the mean of the leaves below it."""
    told: dict[int, Node] = {}

    def add(place: int) -> float:
        node = nodes[place]
        if node["is_leaf"]:
            told[place] = Node(round(float(node["value"]), 5))
        else:
            low, high = int(node["left"]), int(node["right"])
            values = add(low), add(high)
            counts = float(nodes[low]["count"]), float(nodes[high]["count"])
            mean = round(float(np.average(values, weights=counts)), 5)
            at = float(f"{float(node['num_threshold']):.6g}")
            told[place] = Node(mean, names[int(node["feature_idx"])], at, low, high)
        return told[place].value

    add(0)
    return tuple(told[place] for place in range(len(nodes)))


def probabilities(model: Model, rows: Sequence[Judged]) -> FloatArray:
    """Return the probability of friction of each loop, shape (R,)."""
    return np.array([friction_probability(row.figures, model) for row in rows])


def by_folds(rows: Sequence[Judged], without: str | None = None) -> FloatArray:
    """Return the probability of each loop by trees fitted without its fold, shape (R,)."""
    told = np.empty(len(rows))
    fold = np.random.default_rng(1).integers(0, FOLDS, len(rows))
    for k in range(FOLDS):
        rest = [row for row, its in zip(rows, fold, strict=True) if its != k]
        model = fitted(rest, without)
        left_out = [row for row, its in zip(rows, fold, strict=True) if its == k]
        told[fold == k] = probabilities(model, left_out)
    return told


def loss(told: FloatArray, rows: Sequence[Judged]) -> float:
    """Return the mean of −log likelihood, nats a loop."""
    truth = np.array([row.friction for row in rows])
    right = np.where(truth, told, 1.0 - told)
    return float(-np.log(np.maximum(right, 1e-12)).mean())


def counts(told: FloatArray, rows: Sequence[Judged]) -> dict[str, float]:
    """Return the shares that verdicts are held to."""
    truth = np.array([row.friction for row in rows])
    verdicts = [verdict_of(p, responds=True, deadband=False) for p in told.tolist()]
    found = np.array([verdict.has_friction for verdict in verdicts])
    cleared = np.array([verdict is VerdictKind.HEALTHY for verdict in verdicts])
    return {
        "loops": len(rows),
        "friction found": float(found[truth].mean()),
        "friction called healthy": float(cleared[truth].mean()),
        "others called sticky": float(found[~truth].mean()),
        "others called healthy": float(cleared[~truth].mean()),
        "loss": loss(told, rows),
    }
