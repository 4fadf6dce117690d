"""Random binary moves, and the experiment of Appendix A."""

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, prbs_experiment, random_binary, simulate_open_loop

TANK = LoopModel.load(find_config("tank.loop.yaml")).with_ideal_valves()


def test_moves_take_two_levels_and_switch_at_the_rate() -> None:
    op = random_binary(np.random.default_rng(0), 40_000, 2, 0.05, (40.0, 60.0))
    assert set(np.unique(op)) == {40.0, 60.0}
    rate = (np.diff(op, axis=0) != 0.0).mean(axis=0)
    # Five standard deviations of a binomial share.
    assert rate == pytest.approx(0.05, abs=5.0 * np.sqrt(0.05 * 0.95 / 40_000))


def test_switches_have_no_memory() -> None:
    op = random_binary(np.random.default_rng(1), 100_000, 1, 0.2)
    switches = (np.diff(op[:, 0]) != 0.0).astype(float)
    after = switches[1:][switches[:-1] == 1.0].mean()
    assert after == pytest.approx(0.2, abs=0.015)


def test_valves_move_independently() -> None:
    op = random_binary(np.random.default_rng(2), 100_000, 3, 0.3) - 50.0
    correlation = np.corrcoef(op.T) - np.eye(3)
    assert np.abs(correlation).max() < 0.03


def test_both_levels_can_be_the_first() -> None:
    firsts = {random_binary(np.random.default_rng(s), 1, 1)[0, 0] for s in range(20)}
    assert firsts == {40.0, 60.0}


def test_no_samples_are_refused() -> None:
    with pytest.raises(InputError, match="0 samples of 1 valves"):
        random_binary(np.random.default_rng(0), 0, 1)


def test_seed_repeats_the_experiment_bit_for_bit() -> None:
    first, second = (prbs_experiment(TANK, 50, 3) for _ in range(2))
    assert np.array_equal(first.op, second.op)
    assert np.array_equal(first.pv, second.pv)
    assert not np.array_equal(first.op, prbs_experiment(TANK, 50, 4).op)


def test_moves_and_noise_do_not_depend_on_each_other() -> None:
    record = prbs_experiment(TANK, 4000, 5)
    clean = simulate_open_loop(LoopModel.from_mapping(_without_noise()), record.op, 5).record
    noise = record.pv - clean.pv
    assert noise.std(axis=0) == pytest.approx([0.01, 0.01], rel=0.05)
    assert np.abs(np.corrcoef(np.hstack([noise, record.op]).T)[:2, 2:]).max() < 0.06


def _without_noise() -> dict[str, object]:
    document = TANK.to_mapping()
    for output in document["process"]["outputs"]:
        output.pop("noise")
    return document


def test_open_loop_record_has_the_stem() -> None:
    sticky = LoopModel.load(find_config("tank.loop.yaml"))
    record = prbs_experiment(sticky, 200, 1)
    assert record.stem is not None
    assert record.sp is None
    moved = np.abs(np.diff(record.op[:, 0])) > 0.0
    assert np.abs(record.stem[1:, 0] - record.op[1:, 0])[moved] == pytest.approx(1.0)  # f_D
    assert np.array_equal(record.stem[:, 1], record.op[:, 1])


@pytest.mark.parametrize("op", [np.zeros((5, 1)), np.zeros(5), np.full((5, 2), np.nan)])
def test_op_that_does_not_fit_is_refused(op: np.ndarray) -> None:
    with pytest.raises(InputError):
        simulate_open_loop(TANK, op, 1)


def test_negative_seed_is_refused() -> None:
    with pytest.raises(InputError, match="negative"):
        prbs_experiment(TANK, 10, -1)
