"""Noise beyond the declared one, told as an effect: what wanders, how far, and where it enters."""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_laws import (
    Law,
    best_figures,
    declared_block,
    laws_of,
    score_of,
    shown_of,
    white_block,
)
from stiction_ros.discrepancy.likelihood.declared_noise import DeclaredNoise
from stiction_ros.discrepancy.likelihood.noise import ENLARGED
from stiction_ros.effects import Behaviour, ColouredDisturbance, FloatArray, RandomWalkDisturbance

SIDES = (-1.0, 1.0)
REJECTED = 8.0  # −2 log likelihood, above that of the best figures
SHORTEST_WAY = 1e-3
FLAT = 1e-3  # curvature of the likelihood over a logarithm, below which it has none
CLEAR = 0.3  # by which the logarithm of a figure has to be inside of its range
NORMAL = 1.96
NO_LAW = 30.0  # BIC by which a law may miss an autoregression and still be its name


@dataclasses.dataclass(frozen=True)
class NoiseEffect:
    """One law of a larger noise at its best."""

    place: str  # place, behaviour: as loop models name them
    behaviour: Behaviour
    intervals: dict[str, tuple[float, float]]  # 95 % of each figure
    # −2 log likelihood of fitted and held-out rows, and the price of its figures as of an effect
    score: float
    innovation_std: float  # of what it leaves, units of the output


def noise_effects(
    base: Baseline, output: int, declared: DeclaredNoise, least: float = 0.0
) -> list[NoiseEffect]:
    """Return the laws by which an output's noise may be larger than declared, the best first.

    Each law stands beside the declared noise in one state-space model, whose innovations are
    judged on the same rows as every other explanation.

    Args:
        base: the model with its effects.
        output: its index.
        declared: its noise.
        least: what a law has to gain a row in −2 log likelihood.

    Returns:
        The laws that beat the declared noise, with its rounding; the best first, and those that are
        near it.
    """
    found = _at_their_best(base, output, declared)
    enough = _without(base, output, declared) - least * int(base.blocks[output].train.sum())
    better = [each for each in found if each.score < enough]
    lasts = float(base.run.runs.time.max())
    near = sorted(_without_walks(better, lasts), key=lambda each: each.score)
    return [each for each in near if each.score <= near[0].score + NO_LAW]


def _at_their_best(base: Baseline, output: int, declared: DeclaredNoise) -> list[NoiseEffect]:
    """Return the laws that have figures, kept."""
    name = ("noise effects", output, declared.std, declared.ar.tobytes())
    if name not in base.known:
        laws = laws_of(base, output, declared)
        fitted = [_fitted(base, output, declared, law) for law in laws]
        base.known[name] = [each for each in fitted if each is not None]
    found: list[NoiseEffect] = base.known[name]
    return found


def _without_walks(laws: list[NoiseEffect], lasts: float) -> list[NoiseEffect]:
    """Return laws without a coloured noise that may last as long as the record.

    Within the record that is a random walk, which has one figure less.
    """
    walks = [each.score for each in laws if isinstance(each.behaviour, RandomWalkDisturbance)]
    return [
        each
        for each in laws
        if not isinstance(each.behaviour, ColouredDisturbance)
        or each.intervals["tau"][1] < lasts * math.exp(-CLEAR)
        or each.score < min(walks, default=math.inf) - ENLARGED
    ]


def _without(base: Baseline, output: int, declared: DeclaredNoise) -> float:
    """Return the score of the declared noise alone, rounded values included."""
    none = Law("", [], (np.zeros(0), np.zeros(0)), lambda _: white_block(0.0), _nothing)
    own, shown = declared_block(base, output, declared), shown_of(base, output)
    whole, held, *_ = score_of(np.zeros(0), none, own, shown, base.blocks[output])
    return whole + held


def _nothing(x: FloatArray) -> Behaviour:
    raise NotImplementedError("the declared noise is no effect")


def named_laws(found: Sequence[NoiseEffect], margin: float) -> tuple[NoiseEffect, ...]:
    """Return the best law and those that the record does not tell from it."""
    return tuple(each for each in found if each.score < found[0].score + margin)


def _fitted(base: Baseline, output: int, declared: DeclaredNoise, law: Law) -> NoiseEffect | None:
    own, shown = declared_block(base, output, declared), shown_of(base, output)
    blocks = base.blocks[output]

    def loss(x: FloatArray) -> float:
        return score_of(x, law, own, shown, blocks)[0]

    found, best = best_figures(law, own, shown, blocks)
    low, high = law.range
    if not math.isfinite(best) or np.any(found < low + CLEAR) or np.any(found > high - CLEAR):
        return None  # a figure on the bound of its range is no name
    whole, held, std, louder = score_of(found, law, own, shown, blocks)
    rows = max(int(blocks.train.sum()), 2)
    price = len(found) * math.log(rows) + ENLARGED
    first = np.eye(len(found))[0]  # is a size: σ is its unit
    behaviours = [law.behaviour(found + math.log(louder) * first)]
    ends = _ends(loss, found, law.range)
    if not np.isfinite(ends).all():
        return None  # an interval that holds nothing out is no name
    for k, end in enumerate(ends):
        scale = math.log(score_of(end, law, own, shown, blocks)[3])
        scale += SIDES[k % 2] * NORMAL / math.sqrt(2.0 * rows)
        behaviours.append(law.behaviour(end + scale * first))
    keys = [(p.key, p.attribute) for p in behaviours[0].parameters()]
    intervals = {
        key: (
            min(float(getattr(b, attribute)) for b in behaviours),
            max(float(getattr(b, attribute)) for b in behaviours),
        )
        for key, attribute in keys
    }
    return NoiseEffect(law.place, behaviours[0], intervals, whole + held + price, std)


def _ends(
    loss: Callable[[FloatArray], float], found: FloatArray, limits: tuple[FloatArray, FloatArray]
) -> list[FloatArray]:
    """Return points at both ends of each figure's 95 % by the curvature of the likelihood."""
    count, step = len(found), 0.1
    shifts = step * np.eye(count)
    centre = loss(found)
    bend = np.zeros((count, count))
    for i in range(count):
        for j in range(i, count):
            corner = loss(found + shifts[i] + shifts[j]) + loss(found - shifts[i] - shifts[j])
            other = loss(found + shifts[i] - shifts[j]) + loss(found - shifts[i] + shifts[j])
            bend[i, j] = bend[j, i] = (corner - other) / (4.0 * step**2)
        plus, minus = loss(found + shifts[i]), loss(found - shifts[i])
        bend[i, i] = (plus + minus - 2.0 * centre) / step**2
    if not np.isfinite(bend).all():
        return [np.array(limits[k]) for _ in found for k in range(2)]
    sizes, axes = np.linalg.eigh(0.5 * bend)
    spread = (axes / np.maximum(sizes, FLAT)) @ axes.T  # what does not bend is not known at all
    ways = NORMAL * spread / np.sqrt(np.diag(spread))  # each figure's end, the others at their best
    ends = []
    for way in ways.T:
        for side in SIDES:  # a valley may be bent: back to what the likelihood does not reject
            share = side
            while abs(share) > SHORTEST_WAY:
                end = np.clip(found + share * way, *limits)
                if loss(end) < centre + REJECTED:
                    break
                share *= 0.5
            ends.append(end)
    return ends
