"""Loops of the field: what a seed gives."""

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_studies.field import MANY, Cause, FieldLoop, ValveKind, field_loop, with_friction
from stiction_studies.field.circumstances import (
    Friction,
    Hole,
    Keeping,
    Outside,
    Sampling,
    draw_circumstances,
)
from stiction_studies.field.plants import Plant
from stiction_studies.field.valves import Law

SEEDS = range(900, 924)


@pytest.fixture(scope="module")
def loops() -> list[FieldLoop]:
    return [field_loop(seed) for seed in SEEDS]


def test_a_seed_gives_the_same_loop_again(loops: list[FieldLoop]) -> None:
    again = field_loop(SEEDS[0])
    assert again.truth == loops[0].truth
    assert np.array_equal(again.record.op, loops[0].record.op)
    assert np.array_equal(again.record.pv, loops[0].record.pv, equal_nan=True)


def test_other_seeds_give_other_loops(loops: list[FieldLoop]) -> None:
    assert len({float(loop.record.op[5, 0]) for loop in loops}) == len(loops)
    assert len({len(loop.record) for loop in loops}) > 15
    assert len({loop.plant for loop in loops}) > 4


def test_records_are_what_the_package_reads(loops: list[FieldLoop]) -> None:
    for loop in loops:
        assert 390 <= len(loop.record) <= 4000
        assert loop.record.stem is None
        assert loop.stem.shape == loop.record.op.shape
        assert loop.kind in ("flow", "pressure", "level", "temperature", "analyser")
        first, last = loop.judged_rows
        assert last - first >= 0.35 * len(loop.record)
        assert np.isfinite(loop.record.pv[first:last]).all()


def test_about_half_have_friction_and_most_of_it_slips_often(loops: list[FieldLoop]) -> None:
    sticks = [loop for loop in loops if loop.truth.valve is not ValveKind.HEALTHY]
    assert 6 <= len(sticks) <= 18
    assert sum(loop.judged_slips >= MANY for loop in sticks) >= 0.7 * len(sticks)


def test_the_truth_agrees_with_itself(loops: list[FieldLoop]) -> None:
    for loop in loops:
        truth = loop.truth
        if truth.f_s is not None and truth.f_d is not None and truth.band > 0.0:
            assert truth.band == pytest.approx(truth.f_s + truth.f_d, rel=0.03)
            assert truth.jump == pytest.approx(truth.f_s - truth.f_d, rel=0.05)
        if truth.valve is ValveKind.HEALTHY:
            assert truth.band_share <= 0.05
            assert Cause.VALVE not in truth.causes
        if truth.valve is ValveKind.BACKLASH:
            assert truth.jump == 0.0
        assert truth.causes
        assert truth.slips_between(0, len(loop.record)) == truth.slips
        assert truth.slips >= loop.judged_slips


def test_every_circumstance_is_drawn() -> None:
    drawn = [draw_circumstances(np.random.default_rng([seed, 0])) for seed in range(1000)]
    for key, kinds in {
        "plant": Plant,
        "friction": Friction,
        "law": Law,
        "outside": Outside,
        "sampling": Sampling,
        "keeping": Keeping,
        "hole": Hole,
    }.items():
        assert {getattr(each, key) for each in drawn} == set(kinds)
    much = sum(each.friction is Friction.MUCH for each in drawn)
    assert 430 <= much <= 530


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(InputError, match="negative"):
        field_loop(-1)


def test_friction_that_is_put_in_leaves_all_else_as_it_was_drawn(loops: list[FieldLoop]) -> None:
    before = next(
        loop
        for loop in loops
        if loop.truth.valve is ValveKind.HEALTHY and loop.record.quality.any()
    )
    much = with_friction(before.seed, 0.3)
    assert much is not None
    assert (much.kind, much.plant, much.circumstances) == (
        before.kind,
        before.plant,
        before.circumstances,
    )
    assert np.array_equal(much.record.quality, before.record.quality)
    assert not np.array_equal(much.record.pv, before.record.pv)
    assert much.truth.f_s is not None
    assert much.truth.f_d is not None
    assert much.truth.f_s == pytest.approx(1.5 * much.truth.f_d)
    assert much.truth.band == pytest.approx(much.truth.f_s + much.truth.f_d, rel=0.02)
    again = with_friction(before.seed, 0.3)
    assert again is not None
    assert np.array_equal(again.record.pv, much.record.pv, equal_nan=True)
