"""OP and PV swapped in a record: found when clear, never seen where they are not."""

import dataclasses
import pathlib

import numpy as np
import pytest
from as_given import read_csv
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.identification.problem.input_checks import swapped_columns
from stiction_ros.records.record import Record
from stiction_studies.examples import FAMILIES, NOISES, PLANTS, example1, example2, healthy_loop

DATA = pathlib.Path(__file__).resolve().parents[4] / "shared" / "data"
CASES = [
    pytest.param(make, variant, marks=pytest.mark.trial if later else ())
    for make, variants in ((example1, NOISES), (example2, PLANTS), (healthy_loop, FAMILIES))
    for later, variant in enumerate(variants)
]


def swapped(record: Record) -> Record:
    return dataclasses.replace(record, op=record.pv, pv=record.op, stem=None)


def without_sp(record: Record) -> Record:
    return dataclasses.replace(record, sp=None)


def pi_loop(
    seed: int,
    gain: float = 0.5,
    integral: float = 20.0,
    level: float = 30.0,
    move: float = 3.0,
    derivative: float = 0.0,
) -> Record:
    """A first-order process at PV = ``level`` under PI control, OP about 50 %, white noise."""
    random = np.random.default_rng(seed)
    samples = 600
    op, pv = np.full(samples, 50.0), np.full(samples, level)
    sp = level + move * (np.arange(samples) * 4 // samples % 2)
    state = 0.0
    for k in range(1, samples):
        state = 0.9 * state + 0.1 * (op[k - 1] - 50.0)
        pv[k] = level + state + 0.1 * random.standard_normal()
        error, before = sp[k] - pv[k], sp[k - 1] - pv[k - 1]
        change = gain * (error - before) - derivative * (pv[k] - pv[k - 1])
        op[k] = op[k - 1] + change + (gain * error / integral if integral else 0.0)
    return Record("pi", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], sp[:, None])


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.trial)])
@pytest.mark.parametrize(("make", "variant"), CASES)
def test_simulated_loops(make: object, variant: str, seed: int) -> None:
    assert callable(make)
    record: Record = make(seed, variant).record
    assert swapped_columns(record) is None
    assert swapped_columns(without_sp(record)) is None
    assert swapped_columns(swapped(record)) is not None
    found = swapped_columns(without_sp(swapped(record)))
    assert found is not None
    assert "exact controller equation" in found


@given(seed=st.integers(0, 1000), gain=st.floats(0.05, 3.0), integral=st.floats(3.0, 200.0))
def test_any_pi_controller_is_told_from_its_process(
    seed: int, gain: float, integral: float
) -> None:
    record = without_sp(pi_loop(seed, gain, integral))
    assert swapped_columns(record) is None
    assert swapped_columns(swapped(record)) is not None


def test_the_set_point_shows_a_swap_where_op_is_rounded() -> None:
    record = pi_loop(1)
    rounded = dataclasses.replace(record, op=np.round(record.op, 1))
    assert swapped_columns(rounded) is None
    found = swapped_columns(swapped(rounded))
    assert found is not None
    assert "closer to the set-point" in found


@pytest.mark.parametrize("unit", [1e-3, 1.0, -40.0])
def test_signals_without_their_means_are_not_swapped_by_their_unit(unit: float) -> None:
    record = pi_loop(1, move=0.0)
    assert record.sp is not None
    op = np.round(record.op - record.op.mean(), 1)
    pv, sp = unit * (record.pv - record.sp), 0.0 * record.sp
    assert swapped_columns(dataclasses.replace(record, op=op, pv=pv, sp=sp)) is None


@pytest.mark.parametrize("decimals", [1, 3])
def test_a_rounded_op_without_set_point_says_nothing(decimals: int) -> None:
    record = without_sp(pi_loop(1))
    rounded = dataclasses.replace(record, op=np.round(record.op, decimals))
    assert swapped_columns(rounded) is None
    assert swapped_columns(swapped(rounded)) is None


def test_noise_on_op_says_nothing() -> None:
    record = without_sp(pi_loop(1))
    noise = 1e-3 * np.random.default_rng(2).standard_normal(record.op.shape)
    noisy = dataclasses.replace(record, op=record.op + noise)
    assert swapped_columns(swapped(noisy)) is None


def test_a_controller_without_integral_action_says_nothing() -> None:
    record = without_sp(pi_loop(1, integral=0.0))
    assert swapped_columns(record) is None
    assert swapped_columns(swapped(record)) is None


def test_derivative_action_does_not_mislead() -> None:
    record = without_sp(pi_loop(1, derivative=0.3))
    assert swapped_columns(record) is None
    assert swapped_columns(swapped(record)) is not None


def test_held_and_interpolated_columns_say_nothing() -> None:
    record = without_sp(pi_loop(1))
    grid, coarse = np.arange(600), np.arange(0, 600, 10)
    line = np.interp(grid, coarse, record.op[coarse, 0])[:, None]
    held = np.repeat(record.pv[coarse], 10, axis=0)
    for changed in ({"op": line}, {"pv": held}, {"op": line, "pv": held}):
        odd = dataclasses.replace(record, **changed)
        assert swapped_columns(odd) is None
        assert swapped_columns(swapped(odd)) is None


def test_a_pv_far_from_its_set_point_is_no_swap() -> None:
    record = pi_loop(1)
    assert record.sp is not None
    lost = dataclasses.replace(record, pv=record.pv + 40.0, op=record.op * 0.0 + 50.0)
    assert swapped_columns(lost) is None


@pytest.mark.parametrize("pole", [0.9, 1.0])
@pytest.mark.parametrize("ahead", [0, 1])
def test_a_record_without_noise_says_nothing(pole: float, ahead: int) -> None:
    samples, integral = 600, 20.0
    op, pv = np.full(samples, 50.0), np.full(samples, 30.0)
    sp = 30.0 + 3.0 * (np.arange(samples) * 4 // samples % 2)
    for k in range(1, samples):
        pv[k] = 30.0 + pole * (pv[k - 1] - 30.0) + 0.1 * (op[k - 1] - 50.0)
        error, before = sp[k] - pv[k], sp[k - 1] - pv[k - 1]
        op[k] = op[k - 1] + 0.5 * (error - before + error / integral)
    # One sample ahead, PV answers OP at once.
    op, pv = op[: samples - ahead, None], pv[ahead:, None]
    record = Record("quiet", 1.0, ("V1",), ("PV1",), op, pv)
    assert swapped_columns(record) is None


def test_constant_or_few_samples_say_nothing() -> None:
    record = without_sp(pi_loop(1))
    assert swapped_columns(record.part(0, 12)) is None
    still = dataclasses.replace(record, op=np.full_like(record.op, 50.0))
    assert swapped_columns(still) is None
    assert swapped_columns(swapped(still)) is None


def measured(folder: str) -> list[Record]:
    paths = [p for p in sorted((DATA / folder).glob("*.csv")) if p.stem != "index"]
    if not paths:
        pytest.skip(f"measured loops are not at ../shared/data/{folder}")
    return [read_csv(path) for path in paths]


@pytest.mark.parametrize("folder", ["isdb", "plant"])
def test_measured_loops_are_never_taken_for_swapped(folder: str) -> None:
    for record in measured(folder):
        assert swapped_columns(record) is None, record.name
        assert swapped_columns(without_sp(record)) is None, record.name


def test_most_measured_loops_with_set_point_show_the_swap() -> None:
    records = measured("plant")
    found = [swapped_columns(swapped(record)) for record in records]
    assert sum(evidence is not None for evidence in found) >= 0.8 * len(records)
