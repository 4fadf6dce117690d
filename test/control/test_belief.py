import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.control.belief import ValveBelief
from stiction_ros.control.jump_form import FrictionSpread, jump_form
from stiction_ros.effects import HeStiction, KanoStiction

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
