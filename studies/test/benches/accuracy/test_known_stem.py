"""What a record holds of a friction: the gain of the stem that truly moved."""

import pytest

from stiction_ros.identification.evidence.rates import PRICE
from stiction_ros.records.record import Record
from stiction_studies.benches.accuracy.known_stem import beyond_price
from stiction_studies.field import FieldLoop, field_loop

STICKY = 38
"""Seed of a loop of the field whose valve sticks plainly, without a wave beside it."""


@pytest.fixture(scope="module")
def loop() -> FieldLoop:
    return field_loop(STICKY)


def part_of(loop: FieldLoop) -> Record:
    return loop.record.part(*loop.judged_rows)


def test_a_stem_that_is_op_gains_nothing_and_misses_the_price(loop: FieldLoop) -> None:
    record = part_of(loop)
    assert beyond_price(record, record.op[:, 0]) == pytest.approx(-PRICE, abs=1.0)


def test_the_stem_that_moved_shows_where_friction_is_plain(loop: FieldLoop) -> None:
    first, last = loop.judged_rows
    shown = beyond_price(part_of(loop), loop.stem[first:last, 0])
    assert shown is not None
    assert shown > 5.0 * PRICE


def test_a_unit_of_op_changes_nothing(loop: FieldLoop) -> None:
    first, last = loop.judged_rows
    record, stem = part_of(loop), loop.stem[first:last, 0]
    other = Record(
        "other",
        record.sample_time,
        record.valves,
        record.outputs,
        0.16 * record.op + 4.0,
        record.pv,
    )
    plain = Record("same", record.sample_time, record.valves, record.outputs, record.op, record.pv)
    assert beyond_price(other, 0.16 * stem + 4.0) == pytest.approx(beyond_price(plain, stem))


def test_of_a_record_that_is_searched_in_part_nothing_is_said(loop: FieldLoop) -> None:
    first, last = loop.judged_rows
    record, stem = part_of(loop), loop.stem[first:last, 0]
    times = 6000 // len(record) + 1
    long = Record(
        "long",
        record.sample_time,
        record.valves,
        record.outputs,
        record.op.repeat(times, axis=0),
        record.pv.repeat(times, axis=0),
    )
    assert beyond_price(long, stem.repeat(times)) is None
