"""What is believed of the stems, and which laws may be."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from stiction_ros.control.belief import ValveBelief, jump_form
from stiction_ros.effects import (
    Behaviour,
    ChoudhuryStiction,
    FrictionPair,
    HeStiction,
    KanoStiction,
    SemiPhysicalStiction,
    SlipJumpPair,
    Stiction,
    XchStiction,
    behaviours,
)
from stiction_ros.effects.friction.stiction import FrictionSpread
from stiction_ros.errors import InputError

HE = HeStiction(8.0, 1.0)


def started(op: float = 50.0) -> ValveBelief:
    belief = ValveBelief(jump_form(HE), FrictionSpread(0.3, 0.2))
    belief.start(op, 0.0, 100.0)
    return belief


def test_at_the_start_the_stem_is_anywhere_within_static_friction_of_op() -> None:
    belief = started()
    assert belief.interval == (42.0, 58.0)
    assert belief.stem == 50.0
    assert not belief.sure


def test_the_start_lies_within_the_limits() -> None:
    assert started(3.0).interval == (0.0, 11.0)


def test_op_that_moves_shrinks_the_interval() -> None:
    belief = started()
    belief.apply_op(55.0)
    low, high = belief.interval
    assert high == 58.0
    assert 42.0 < low < 50.0
    assert not belief.sure


def test_a_slip_that_no_position_escapes_makes_it_sure() -> None:
    belief = started()
    belief.apply_op(58.0 + 8.0 + 0.1)
    assert belief.sure
    assert belief.interval == pytest.approx((65.1, 65.1))


@pytest.mark.parametrize("law", [HE, KanoStiction(9.0, 7.0)])
@given(start=st.integers(0, 16), ops=st.lists(st.floats(0.0, 100.0), min_size=1, max_size=12))
def test_the_true_stem_is_in_the_interval_and_known_when_it_is_sure(
    law: HeStiction | KanoStiction, start: int, ops: list[float]
) -> None:
    belief = ValveBelief(jump_form(law))
    belief.start(50.0)
    true = float(np.linspace(42.0, 58.0, 17)[start])
    memory = law.step(law.rest(true), 50.0, 0.0)[0]
    for op in ops:
        memory, true = law.step(memory, op, 0.0)
        belief.apply_op(op)
        low, high = belief.interval
        assert low - 1e-9 <= true <= high + 1e-9
        if belief.sure:
            assert belief.stem == pytest.approx(true, abs=1e-9)


def test_raising_static_friction_drops_the_intervals_that_it_contradicts() -> None:
    belief = started()
    belief.apply_op(70.0)
    belief.raise_static(11.0, 44.0)
    assert (belief.form.static_friction, belief.form.dynamic_friction) == (11.0, 1.0)
    assert belief.spread is None
    assert (belief.stem, belief.sure) == (44.0, True)
    assert belief.apply_op(54.0) == 44.0


frictions = st.tuples(st.floats(0.5, 15.0), st.floats(0.0, 1.0)).map(
    lambda pair: (pair[0], pair[0] * pair[1])
)
laws = frictions.flatmap(
    lambda f: st.sampled_from(
        [
            HeStiction(*f),
            KanoStiction(f[0] + f[1], f[0] - f[1]),
            ChoudhuryStiction(f[0] + f[1], f[0] - f[1]),
            XchStiction(*f),
            SemiPhysicalStiction(*f, 1.6),
        ]
    )
)


def follow(law: Behaviour, stem: float, ops: list[float]) -> list[float]:
    memory, out = law.rest(stem), []
    for op in ops:
        memory, moved = law.step(memory, op, 0.0)
        out.append(moved)
    return out


@given(laws, st.floats(10.0, 90.0), st.floats(-60.0, 60.0), st.integers(1, 4))
def test_a_jump_goes_where_it_was_sent_and_the_stem_then_stays(
    law: Behaviour, stem: float, move: float, rest: int
) -> None:
    form = jump_form(law)
    assume(abs(move) > form.least * (1 + 1e-6) + 1e-6)
    op = form.op(stem, stem + move)
    assert form.slips(stem, op)
    way = form.way(stem, stem, op)
    stems = follow(law, stem, [*way, *[stem + move] * rest])
    moved = stems[form.strokes - 1 :]
    assert stems[: form.strokes - 1] == [stem] * (form.strokes - 1)
    assert moved == pytest.approx([stem + move] * len(moved), abs=1e-6)


@given(laws, st.floats(10.0, 90.0), st.floats(-60.0, 60.0), st.sampled_from([1.0, -1.0]))
def test_a_second_jump_from_rest_goes_where_it_was_sent(
    law: Behaviour, stem: float, move: float, sign: float
) -> None:
    form = jump_form(law)
    assume(abs(move) > form.least * (1 + 1e-6) + 1e-6)
    there = stem + move
    onwards = there + sign * abs(move)
    first = [*form.way(stem, stem, form.op(stem, there)), there]
    second = form.way(there, there, form.op(there, onwards))
    stems = follow(law, stem, first + second)
    assert stems[-1] == pytest.approx(onwards, abs=1e-6)


@given(laws, st.floats(10.0, 90.0), st.floats(-0.999, 0.999))
def test_op_within_static_friction_of_a_resting_stem_does_not_move_it(
    law: Behaviour, stem: float, share: float
) -> None:
    form = jump_form(law)
    op = stem + share * form.static_friction
    assert not form.slips(stem, op)
    assert follow(law, stem, [op]) == [stem]


@given(laws, st.floats(10.0, 90.0), st.floats(-60.0, 60.0))
def test_the_inverse_moves_the_stem_at_least_as_near_as_staying(
    law: Behaviour, stem: float, move: float
) -> None:
    form = jump_form(law)
    moved = follow(law, stem, form.way(stem, stem, form.inverse(stem, stem + move)))[-1]
    assert abs(moved - stem - move) <= abs(move) + 1e-6


def test_a_law_without_a_jump_form_is_refused_with_those_that_have_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(ChoudhuryStiction, "jump_form", Stiction.jump_form)
    with pytest.raises(InputError, match=r"choudhury.*kano"):
        jump_form(ChoudhuryStiction(9.0, 7.0))


@pytest.mark.parametrize("law", [HeStiction(8.0, 1.0), KanoStiction(9.0, 7.0)])
def test_raising_static_friction_keeps_dynamic_friction(law: Behaviour) -> None:
    raised = jump_form(law).raised(12.0)
    assert (raised.static_friction, raised.dynamic_friction) == pytest.approx((12.0, 1.0))
    again = jump_form(raised.law)
    assert (again.static_friction, again.dynamic_friction) == pytest.approx((12.0, 1.0))


@pytest.mark.parametrize("applied", [50.0, 44.0, 58.0, 63.0])
def test_a_slip_that_takes_two_strokes_happens_wherever_op_was(applied: float) -> None:
    law = ChoudhuryStiction(9.0, 7.0)
    form = jump_form(law)
    op = form.op(50.0, 62.0)
    assert follow(law, 50.0, [applied, *form.way(applied, 50.0, op)])[-1] == pytest.approx(62.0)
    assert form.way(applied, 50.0, 51.0) == [51.0]


def test_a_margin_is_never_zero() -> None:
    form = jump_form(HeStiction(8.0, 1.0))
    assert form.margin(None, 0.0, 0.0) > 0.0
    assert form.margin(FrictionSpread(0.0, 0.0), 0.3, 0.0) > 0.0


DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_the_pages_agree_on_the_laws_that_controllers_plan_for() -> None:
    jumping = {
        kind.law
        for kind in behaviours()
        if issubclass(kind, FrictionPair | SlipJumpPair)
        and kind(*kind.rows_of_frictions(np.array([[4.0, 1.5]]))[0]).jump_form() is not None
    }
    section = (DOCS / "control.md").read_text(encoding="utf-8").partition("### Other laws")[2]
    same = section.partition("have the same form")[0]
    assert {"he", *re.findall(r"`(\w+)`", same)} == jumping
    for page in DOCS.glob("*.md"):
        text = " ".join(page.read_text(encoding="utf-8").split())
        assert not re.search(r"controllers? keeps? (to )?He's law", text), page.name
