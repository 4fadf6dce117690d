"""Noise of an OP that is not all that acted, behind the process and beside the declared noise."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record
from scipy.signal import lfilter

from stiction_ros.discrepancy import GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.data.controller_check import check_controller, unseen_of
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.likelihood.declared_noise import Unseen, seen_noise
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_ros.signals.autoregression import whiten

STEP = 0.4  # %, of a coarse OP


def rounded_op(recorded: Record, step: float = STEP) -> Record:
    """Return a record whose OP is rounded, though the valve had it as it was."""
    return dataclasses.replace(recorded, op=np.round(recorded.op / step) * step)


def unseen(model: LoopModel, recorded: Record) -> tuple[Unseen, ...]:
    runs, _ = open_gate(model, [recorded])
    (found,) = unseen_of(runs, check_controller(model, runs))
    return found


def by_hand(recorded: Record) -> Record:
    """Return a record of the same length whose OP is moved by hand now and then."""
    moves = np.random.default_rng(6).normal(scale=6.0, size=len(recorded) // 90 + 1)
    op = 50.0 + np.repeat(moves, 90)[: len(recorded), None]
    return dataclasses.replace(recorded, op=op, sp=None)


def correlations(values: FloatArray) -> FloatArray:
    return np.array([np.corrcoef(values[lag:], values[:-lag])[0, 1] for lag in range(1, 8)])


@pytest.mark.parametrize("keep", [0.0, 0.8])
@pytest.mark.parametrize("enters", ["measurement", "equation"])
def test_both_noises_together_are_white_behind_their_whitening(enters: str, keep: float) -> None:
    document, size, variance = loop().to_mapping(), 0.05, 4.0
    document["process"]["outputs"][0]["noise"] = {"std": size, "enters": enters}
    model, random = LoopModel.from_mapping(document), np.random.default_rng(4)
    a, b = [1.0, -1.6, 0.64], [0.0, 0.03, 0.01]
    own, passed = size * random.normal(size=20000), random.normal(size=20000) * variance**0.5
    passed = lfilter([(1.0 - keep**2) ** 0.5], [1.0, -keep], passed)
    noise = (own if enters == "measurement" else lfilter([1.0], a, own)) + lfilter(b, a, passed)
    alone, beside = seen_noise(model, (0.0,), ((Unseen(variance, keep),),))[0]
    left = whiten(noise, beside.ar)[50:]
    assert np.abs(correlations(left)).max() < 0.03
    assert left.std() == pytest.approx(beside.std, rel=0.02)
    assert np.abs(correlations(whiten(noise, alone.ar)[50:])).max() > 0.1


def test_what_is_not_seen_behind_the_process_is_no_form_of_its_own() -> None:
    assert len(seen_noise(loop(), (0.0,), ((Unseen(1e-6),),))[0]) == 1
    assert len(seen_noise(loop(), (0.0,), ())[0]) == 1
    assert seen_noise(loop(0.0), (0.0,), ((Unseen(1.0),),)) == ((),)


def test_an_op_that_is_rounded_is_off_by_up_to_half_a_step_until_it_moves() -> None:
    recorded = record(loop())
    assert unseen(loop(), recorded) == ()
    (found,) = unseen(loop(), rounded_op(recorded, 0.2))
    assert found.variance == pytest.approx(0.2**2 / 12.0)
    assert found.keep == 0.0
    (found,) = unseen(loop(), rounded_op(by_hand(recorded), 0.2))
    assert found.variance == pytest.approx(0.2**2 / 12.0)
    assert found.keep > 0.98


def test_an_op_that_is_moved_by_hand_to_values_that_are_chosen_is_what_it_is() -> None:
    recorded = record(loop())
    assert unseen(loop(), by_hand(recorded)) == ()
    assert unseen(loop(), rounded_op(by_hand(recorded), 1.0)) == ()


def test_scans_between_samples_are_asked_where_no_law_gives_the_op() -> None:
    recorded, random = record(loop()), np.random.default_rng(0)
    moved = recorded.op + random.normal(scale=0.5, size=recorded.op.shape)
    (found,) = unseen(loop(), dataclasses.replace(recorded, op=moved))
    plain = np.diff(moved[:, 0], 2) / 2.0
    assert 0.5 * plain.var() / 4.0 < found.variance < 1.5 * plain.var() / 4.0
    assert found.keep == 0.0


@pytest.mark.trial
def test_a_rounded_op_is_no_disturbance() -> None:
    model = loop()
    answer = find_discrepancy(
        model, [rounded_op(record(model, samples=2000, seed=2))], GapOptions(quick=True)
    )
    assert answer.verdict is GapVerdict.NONE
    assert not answer.effects
    assert not answer.noise[0].disagrees
