"""The declared noise as a form of its own, and what is larger than it as a named effect."""

import dataclasses

import numpy as np
import pytest
from gap_loops import loop, record
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import block_diag, solve_discrete_are
from scipy.signal import lfilter

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.discrepancy.data.controller_check import check_controller, unseen_of
from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.likelihood.declared_noise import (
    DeclaredNoise,
    Unseen,
    behind_lag,
    declared_noise,
    rounded,
    seen_noise,
    steady_gain,
)
from stiction_ros.discrepancy.likelihood.noise import Blocks, given_noise, noise_forms
from stiction_ros.effects import (
    Behaviour,
    ColouredDisturbance,
    ExtraPole,
    FloatArray,
    RandomWalkDisturbance,
)
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_ros.signals.autoregression import companion, whiten

QUICK = GapOptions(quick=True)


def with_equation_noise() -> LoopModel:
    document = loop().to_mapping()
    document["process"]["outputs"][0]["noise"] = {"std": 0.05, "enters": "equation"}
    return LoopModel.from_mapping(document)


def answer(model: LoopModel, place: str, effect: Behaviour) -> Discrepancy:
    return find_discrepancy(model, [record(model.with_effect(place, effect), seed=3)], QUICK)


def test_noise_of_the_measurement_is_white() -> None:
    (declared,) = declared_noise(loop(0.2))
    assert declared is not None
    assert (declared.std, len(declared.ar)) == (0.2, 0)


def test_noise_of_the_equation_has_the_poles_of_the_process() -> None:
    (declared,) = declared_noise(with_equation_noise())
    assert declared is not None
    assert declared.ar == pytest.approx([1.6, -0.64])


def test_a_model_without_noise_declares_none() -> None:
    assert declared_noise(loop(0.0)) == (None,)


def test_noise_beside_a_coloured_disturbance_is_whitened() -> None:
    model = loop(0.3).with_effect("disturbance:PV1", ColouredDisturbance(0.5, 20.0))
    (declared,) = declared_noise(model)
    assert declared is not None
    random, keep = np.random.default_rng(1), np.exp(-1.0 / 20.0)
    slow = lfilter([0.5 * np.sqrt(1.0 - keep**2)], [1.0, -keep], random.standard_normal(40_000))
    white = whiten(slow + 0.3 * random.standard_normal(40_000), declared.ar)[100:]
    assert float(np.std(white)) == pytest.approx(declared.std, rel=0.02)
    assert float(np.corrcoef(white[1:], white[:-1])[0, 1]) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("pole", [0.95, 1.0])
def test_rounding_is_part_of_the_noise_of_an_equation(pole: float) -> None:
    random, quantum = np.random.default_rng(2), 1.5
    a = np.convolve([1.0, -pole], [1.0, -0.8])
    noise = lfilter([1.0], a, random.standard_normal(40_000))
    values = noise + quantum * (random.random(40_000) - 0.5)  # rounding, told by its variance
    shown = rounded(DeclaredNoise(1.0, -a[1:]), quantum)
    white = whiten(values, shown.ar)[100:]
    assert float(np.std(white)) == pytest.approx(shown.std, rel=0.02)
    assert abs(float(white[1:] @ white[:-1])) < 0.02 * float(white @ white)
    plain = whiten(values, -a[1:])[100:]
    assert abs(float(plain[1:] @ plain[:-1])) > 0.1 * float(plain @ plain)
    assert rounded(shown, 0.0) is shown


def test_behind_a_lag_noise_has_one_more_pole() -> None:
    poles = np.roots(np.concatenate([[1.0], -behind_lag(np.array([0.9]), 0.5)]))
    assert sorted(poles.tolist()) == pytest.approx([0.5, 0.9])


def blocks(count: int) -> Blocks:
    train = np.ones(count, dtype=bool)
    train[:6] = False
    return Blocks(train, np.zeros(count, dtype=bool))


def test_another_noise_than_declared_has_its_price() -> None:
    white = np.random.default_rng(2).standard_normal(2000)
    forms = noise_forms(white, np.zeros((2000, 0)), blocks(2000), (None,), (np.zeros(0),))
    assert [form.enlarged for form in sorted(forms, key=lambda form: form.bic(0))] == [False, True]


def test_what_whitening_takes_away_does_not_grow() -> None:
    """The start of a settled equation is invisible to its own noise, yet shown by a free run."""
    ar, count = np.array([1.6, -0.64]), 600
    starts = lfilter([1.0], np.concatenate([[1.0], -ar]), np.eye(count, 1), axis=0)
    columns: FloatArray = np.hstack([starts, np.ones((count, 1))])
    target = lfilter(
        [1.0], np.concatenate([[1.0], -ar]), np.random.default_rng(3).normal(size=count)
    )
    fit = given_noise(target + 2.0, columns, blocks(count), ar)
    assert float(np.abs(fit.residual).max()) < 2.0 * float(np.abs(target).max())


@pytest.mark.parametrize("model", [loop(0.1), with_equation_noise()], ids=["white", "equation"])
def test_the_noise_of_a_healthy_loop_agrees(model: LoopModel) -> None:
    found = find_discrepancy(model, [record(model, seed=4)], QUICK)
    assert found.verdict is GapVerdict.NONE
    assert not any(noise.disagrees for noise in found.noise)
    assert found.noise[0].found == pytest.approx(found.noise[0].declared, rel=0.1)


@pytest.mark.trial
def test_slow_noise_is_named_although_an_autoregression_describes_it() -> None:
    found = answer(loop(0.1), "disturbance:PV1", ColouredDisturbance(1.0, 25.0))
    names = {(e.place, e.effect) for e in found.effects} | set(found.alternatives)
    assert ("disturbance:PV1", "coloured") in names
    assert found.noise[0].disagrees
    assert any("the model declares" in sentence for sentence in found.where)


@pytest.mark.trial
def test_a_load_that_wanders_is_told_where_it_enters() -> None:
    found = answer(loop(0.05), "load:V1", RandomWalkDisturbance(0.4))
    (effect,) = found.effects
    assert (effect.place, effect.effect) == ("load:V1", "random_walk")
    low, high = effect.intervals["rate"]
    assert low <= 0.4 <= high


def test_a_model_that_declares_no_noise_is_not_contradicted() -> None:
    model = loop(0.0)
    noisy = dataclasses.replace(record(loop(0.1), seed=4))
    found = find_discrepancy(model, [noisy], QUICK)
    assert not any(noise.disagrees for noise in found.noise)


@pytest.mark.trial
def test_noise_that_passes_the_lag_is_no_second_effect() -> None:
    model = with_equation_noise()
    found = answer(model, "process:PV1", ExtraPole(8.0))
    assert {e.effect for e in found.effects} <= {"lag", "pole"}


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
    rounded = rounded_op(recorded, 0.2)
    found, scan = unseen(loop(), rounded)
    assert found.variance == pytest.approx(0.2**2 / 12.0)
    assert scan.keep == 0.0  # rounding hides whether the law scans again between the samples
    assert 0.0 < scan.variance < np.diff(recorded.op[:, 0], 2).var() / 16.0
    hidden = (recorded.op - rounded.op)[:, 0]
    assert found.keep == pytest.approx(np.corrcoef(hidden[1:], hidden[:-1])[0, 1], abs=0.2)
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


@pytest.mark.parametrize("keeps", [1.0, 1.0005, 1.01])
def test_a_load_that_walks_into_a_level_is_foretold_steadily(keeps: float) -> None:
    """Noise of its equation wanders for ever as well: nothing tells the two levels apart."""
    level = np.array([[keeps + 0.7018108, 1.0], [-0.7018108 * keeps, 0.0]])
    walked = block_diag(level, 1.0)
    walked[:2, 2] = 0.00257384, 0.00228754
    a, c = block_diag(level, walked), np.array([1.0, 0.0, 1.0, 0.0, 0.0])
    q = np.stack([np.diag([1.0, 0.0, 0.0, 0.0, size]) for size in np.logspace(-5, -3, 100)])
    gains, missed = steady_gain(np.stack([a] * len(q)), q, c, 0.001)
    assert np.all((missed > 1.0) & (missed < 1.01))
    for gain in gains:
        assert np.abs(np.linalg.eigvals(a - np.outer(gain, c))).max() < keeps + 1e-6


@given(
    poles=st.lists(st.floats(-0.9, 0.95), min_size=1, max_size=4),
    seed=st.integers(0, 100),
    r=st.floats(1e-3, 10.0),
)
def test_the_steady_gain_is_that_of_the_riccati_equation(
    poles: list[float], seed: int, r: float
) -> None:
    a, random = companion(-np.poly(poles)[1:]), np.random.default_rng(seed)
    root, c = random.normal(size=(2, len(a), len(a))), random.normal(size=len(a))
    q = root[0] @ root[0].T
    (gain,), (missed,) = steady_gain(a[None], q[None], c, r)
    p = solve_discrete_are(a.T, c[:, None], q, np.array([[r]]))
    assert missed == pytest.approx(c @ p @ c + r, rel=1e-6)
    assert gain == pytest.approx(a @ p @ c / missed, rel=1e-6, abs=1e-9)
