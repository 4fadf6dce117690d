"""Whether a noise is one: what wanders by itself has no relation to what OP and the stem do."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_laws import Block, Law
from stiction_ros.discrepancy.gap.noise_score import best_figures, score_of, shown_of
from stiction_ros.effects import Backlash
from stiction_ros.effects.behaviour import BoolArray, FloatArray

PLAYS = (0.1, 0.25, 0.5)  # of the span of OP: bands whose strain is asked for
RESTS = 0.1  # of the samples, in which a stem has to rest for its moves to be told from all others
SAME = 10.0  # BIC by which a relation to OP has to be clear, and a noise clearer than none
SMALL = 0.01  # %, of a change of the stem, by which a process that is not linear is asked


def of_the_stem(base: Baseline, output: int, law: Law, own: Block, figures: FloatArray) -> bool:
    """Tell whether something that OP does, other than straight, explains part of a noise.

    A law of noise has as many figures as there are samples: it can stand for whatever a stem does
    and the model does not. What wanders by itself has no relation to OP.

    Args:
        base: the model with its effects.
        output: its index.
        law: of the noise.
        own: states of the declared noise.
        figures: of the law at its best.
    """
    straight, bent = _known(base, output)
    if not bent.shape[1]:
        return False
    start, scores = figures, []
    for more in (straight, np.hstack([straight, bent])):
        begun = dataclasses.replace(law, starts=[start])
        start, score = _scored(base, output, begun, own, more)
        scores.append(score)
    price = bent.shape[1] * math.log(max(base.noise[output].rows, 2))
    return bool(scores[0] - scores[1] > price + SAME)


def with_a_stem(base: Baseline, output: int, laws: Sequence[Law], own: Block) -> float:
    """Return the score of the best walk that moves while a stem of the model does; inf of none.

    What a stem does and its effect does not tell changes while it moves, and rests while it rests.

    Args:
        base: the model with its effects.
        output: its index.
        laws: of the noise; those that enter at a valve are asked.
        own: states of the declared noise.
    """
    least = math.inf
    for j, valve in enumerate(base.run.model.valve_names):
        through = [law for law in laws if law.place == f"load:{valve}"]
        for law, share in itertools.product(through, _shares(base, j)):
            moved = dataclasses.replace(law, when=share)
            least = min(least, _scored(base, output, moved, own, None)[1])
    return least


def _scored(
    base: Baseline, output: int, law: Law, own: Block, more: FloatArray | None
) -> tuple[FloatArray, float]:
    """Return the best figures of a law, and its score on fitted and held-out rows."""
    blocks, shown = base.blocks[output], shown_of(base, output, more)
    figures, _ = best_figures(law, own, shown, blocks)
    whole, held, *_ = score_of(figures, law, own, shown, blocks)
    return figures, whole + held


def _known(base: Baseline, output: int) -> tuple[FloatArray, FloatArray]:
    """Return what straight and what other functions of OP and stem do to an output, kept."""
    name = ("relations to OP", output)
    if name not in base.known:
        base.known[name] = relations(base, output)
    found: tuple[FloatArray, FloatArray] = base.known[name]
    return found


def relations(base: Baseline, output: int) -> tuple[FloatArray, FloatArray]:
    """Return what straight and what other functions of OP and stem do to an output, (N, q) each.

    The straight ones are stem and OP themselves: a process that is a little off has them. The
    others are direction, square, and the strain of plays of several bands.
    """
    run = base.run
    straight: list[FloatArray] = []
    bent: list[FloatArray] = []
    for j in range(run.stems.shape[1]):
        if not run.responses.reaches(output, j):
            continue
        op, stem = run.runs.op[:, j], run.stems[:, j]
        span = float(np.ptp(op))
        if span <= 0.0:
            continue
        plain, others = [stem], [_direction(op), ((op - op.mean()) / span) ** 2]
        plays = Backlash.simulate_grid(np.array([[share * span] for share in PLAYS]), op, op[0])
        others += [(op - play) / span for play in plays.T]
        if float(np.abs(op - stem).max()) > SMALL * span:
            plain.append(op)
            others.append(_direction(stem))
        straight.append(_answers(base, output, j, plain))
        bent.append(_answers(base, output, j, others))
    none = np.zeros((len(run.runs), 0))
    return np.hstack([none, *straight]), np.hstack([none, *bent])


def _answers(base: Baseline, output: int, valve: int, signals: list[FloatArray]) -> FloatArray:
    """Return how an output answers small changes of a stem, shape (N, q)."""
    run = base.run
    changed = run.stems[:, valve, None] + SMALL * np.column_stack(signals)
    return np.asarray((run.drive(output, valve, changed) - run.forced[:, output, None]) / SMALL)


def _shares(base: Baseline, valve: int) -> list[FloatArray]:
    """Return when a stem moves that also rests, shape (N,) each.

    While it moves, by how much it does, and when it starts or stops. A stem that moves within a
    sample moves on in the next one.
    """
    travel = np.abs(np.diff(base.run.stems[:, valve], prepend=base.run.stems[0, valve]))
    moves = travel > 0.0
    moved, turned = _and_next(moves), _and_next(moves != np.roll(moves, 1))
    if not 0.0 < float(moved.mean()) <= 1.0 - RESTS:
        return []
    return [moved.astype(float), turned.astype(float), travel / float(travel.mean())]


def _and_next(marked: BoolArray) -> BoolArray:
    return marked | np.roll(marked, 1)


def _direction(signal: FloatArray) -> FloatArray:
    """Return the sign of the last move of a signal, shape (N,)."""
    signs = np.sign(np.diff(signal, prepend=signal[0]))
    last = np.maximum.accumulate(np.where(signs != 0.0, np.arange(len(signs)), 0))
    return np.asarray(signs[last])
