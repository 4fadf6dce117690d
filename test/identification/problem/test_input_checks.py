"""OP and PV swapped in a record: found when clear, never seen where they are not."""

import dataclasses
import pathlib

import numpy as np
import pytest
from as_given import read_csv

from stiction_ros.errors import InputError
from stiction_ros.identification.problem.input_checks import refuse_swapped
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


def is_refused(record: Record) -> bool:
    try:
        refuse_swapped(record)
    except InputError as error:
        return "look swapped" in str(error)
    return False


def pi_loop(seed: int, move: float = 3.0) -> Record:
    """A first-order process at PV = 30 under PI control, OP about 50 %, white noise."""
    random = np.random.default_rng(seed)
    samples = 600
    op, pv = np.full(samples, 50.0), np.full(samples, 30.0)
    sp = 30.0 + move * (np.arange(samples) * 4 // samples % 2)
    state = 0.0
    for k in range(1, samples):
        state = 0.9 * state + 0.1 * (op[k - 1] - 50.0)
        pv[k] = 30.0 + state + 0.1 * random.standard_normal()
        error, before = sp[k] - pv[k], sp[k - 1] - pv[k - 1]
        op[k] = op[k - 1] + 0.5 * (error - before + error / 20.0)
    return Record("pi", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], sp[:, None])


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.trial)])
@pytest.mark.parametrize(("make", "variant"), CASES)
def test_simulated_loops(make: object, variant: str, seed: int) -> None:
    assert callable(make)
    record: Record = make(seed, variant).record
    refuse_swapped(record)
    refuse_swapped(without_sp(swapped(record)))
    assert is_refused(swapped(record)) or make is example1  # its controller is no PI


def test_the_set_point_shows_a_swap_where_op_is_rounded() -> None:
    record = pi_loop(1)
    rounded = dataclasses.replace(record, op=np.round(record.op, 1))
    refuse_swapped(rounded)
    assert is_refused(swapped(rounded))


@pytest.mark.parametrize("unit", [1e-3, 1.0, -40.0])
def test_signals_without_their_means_are_not_swapped_by_their_unit(unit: float) -> None:
    record = pi_loop(1, move=0.0)
    assert record.sp is not None
    op = np.round(record.op - record.op.mean(), 1)
    pv, sp = unit * (record.pv - record.sp), 0.0 * record.sp
    refuse_swapped(dataclasses.replace(record, op=op, pv=pv, sp=sp))


def test_a_pv_far_from_its_set_point_is_no_swap() -> None:
    record = pi_loop(1)
    assert record.sp is not None
    lost = dataclasses.replace(record, pv=record.pv + 40.0, op=record.op * 0.0 + 50.0)
    refuse_swapped(lost)


def test_a_constant_column_says_nothing() -> None:
    record = pi_loop(1)
    still = dataclasses.replace(record, op=np.full_like(record.op, 50.0))
    refuse_swapped(still)
    refuse_swapped(swapped(still))


def measured(folder: str) -> list[Record]:
    paths = [p for p in sorted((DATA / folder).glob("*.csv")) if p.stem != "index"]
    if not paths:
        pytest.skip(f"measured loops are not at ../shared/data/{folder}")
    return [read_csv(path) for path in paths]


@pytest.mark.parametrize("folder", ["isdb", "plant"])
def test_measured_loops_are_never_taken_for_swapped(folder: str) -> None:
    for record in measured(folder):
        assert not is_refused(record), record.name


def test_most_measured_loops_with_set_point_show_the_swap() -> None:
    records = measured("plant")
    assert sum(is_refused(swapped(record)) for record in records) >= 0.8 * len(records)
