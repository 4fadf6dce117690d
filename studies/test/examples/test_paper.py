"""The records of Examples 1 and 2."""

import numpy as np
import pytest

from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.processes import NoiseEntry, StirredTank
from stiction_studies.examples import NOISES, PLANTS, Example, example1, example2


@pytest.fixture(
    scope="module", params=[NOISES[0], pytest.param(NOISES[1], marks=pytest.mark.trial)]
)
def first(request: pytest.FixtureRequest) -> Example:
    return example1(3, request.param)


@pytest.fixture(scope="module", params=PLANTS)
def second(request: pytest.FixtureRequest) -> Example:
    return example2(3, request.param)


def stem_moves(example: Example, valve: int) -> int:
    assert example.record.stem is not None
    return int(np.count_nonzero(np.diff(example.record.stem[:, valve])))


def test_example1_has_the_printed_length_and_orders(first: Example) -> None:
    assert first.record.op.shape == first.record.pv.shape == (2500, 1)
    assert (first.options.output_order, first.options.input_order) == (3, 3)
    assert first.options.delay == (0, 10)
    assert first.friction("V1") == (5.0, 2.0)
    assert first.delay("PV1", "V1") == 5


@pytest.mark.trial
def test_a_longer_example1_goes_on_with_the_same_set_points(first: Example) -> None:
    longer = example1(3, first.variant, samples=2600).record
    assert first.record.sp is not None
    assert longer.sp is not None
    assert np.array_equal(longer.pv[:2500], first.record.pv)
    assert np.array_equal(longer.sp[2500:], first.record.sp[:100])


@pytest.mark.trial
def test_example1_is_the_same_for_the_same_seed(first: Example) -> None:
    again, other = (example1(seed, first.variant, samples=600).record for seed in (3, 4))
    assert np.array_equal(again.pv, first.record.pv[:600])
    assert not np.array_equal(other.pv, again.pv)


def test_example1_cycles(first: Example) -> None:
    assert first.record.stem is not None
    moves = np.flatnonzero(np.diff(first.record.stem[:, 0]))
    still = np.diff(np.concatenate([[0], moves, [2499]]))
    assert len(moves) >= 50
    # A half period of the cycle is 50 to 60 samples.
    assert still[still > 120].sum() < 0.5 * 2500


def test_example1_noise_enters_where_asked() -> None:
    for noise in NOISES:
        std = example1(1, noise, samples=20).truth.process.noise_std(NoiseEntry(noise))
        assert std == pytest.approx([0.01])


def test_example2_has_the_schedule(second: Example) -> None:
    assert second.record.op.shape == second.record.pv.shape == (1240, 2)
    assert second.record.sp is not None
    moves = np.flatnonzero(np.any(np.diff(second.record.sp, axis=0) != 0.0, axis=1)) + 1
    one_round = [20, 140, 260, 380, 500]
    assert moves.tolist() == [*one_round, *(620 + at for at in [0, *one_round])]
    assert second.record.sp[-1].tolist() == [7.38, 41.0]
    assert second.options.delay == (0, 0)


def test_a_shorter_example2_is_the_beginning_of_the_longer(second: Example) -> None:
    shorter = example2(3, second.variant, samples=620).record
    assert np.array_equal(shorter.pv, second.record.pv[:620])


def test_example2_has_one_sticky_valve_that_cycles(second: Example) -> None:
    assert second.record.stem is not None
    assert (second.friction("V1"), second.friction("V2")) == ((8.0, 1.0), (0.0, 0.0))
    assert np.array_equal(second.record.stem[:, 1], second.record.op[:, 1])
    assert 16 <= stem_moves(second, 0) <= 120


def test_example2_runs_on_either_plant() -> None:
    assert isinstance(example2(1, "tank", 20).truth.process, StirredTank)
    gain = example2(1, "linear", 20).truth.process.linear(60.0).gain
    assert gain == pytest.approx(np.array([[0.02424, -0.00054], [-0.19005, 0.29754]]), abs=1e-5)


def test_stems_are_those_of_he(first: Example) -> None:
    assert first.record.stem is not None
    stem = HeStiction(5.0, 2.0).simulate(first.record.op[:, 0], start=50.0)
    assert np.allclose(stem, first.record.stem[:, 0], atol=1e-12)


@pytest.mark.parametrize(("make", "where"), [(example1, "noise"), (example2, "plant")])
def test_unknown_variants_are_refused(make: object, where: str) -> None:
    assert callable(make)
    with pytest.raises(InputError, match=where):
        make(1, "nowhere")
