import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from paper_cases import STICKY

from stiction_ros.effects import HeStiction
from stiction_ros.paper.controllers.embedding import compensation

POSITIONS = st.floats(20.0, 80.0)


@pytest.mark.parametrize(
    ("before", "goal", "first_three"),
    [
        # up by 2 f_S, the stem to 65; 1 above it; down to the goal, OP 1 below.
        (50.0, 46.0, [66.0, 66.0, 45.0]),
        # down by 2 f_S, the stem to 35; 1 below it; up to the goal, OP 1 above.
        (50.0, 54.0, [34.0, 34.0, 55.0]),
        (50.0, 50.0, [66.0, 66.0, 49.0]),
    ],
)
def test_the_three_moves_of_21(before: float, goal: float, first_three: list[float]) -> None:
    op = compensation(STICKY, before, (50.0, goal), 5, 2.0)
    assert op.tolist() == pytest.approx([*first_three, first_three[-1], first_three[-1]])


@given(static=st.floats(0.5, 10.0), share=st.floats(0.0, 1.0), stem=POSITIONS, goal=POSITIONS)
def test_a_first_move_above_2_slips_from_anywhere_in_the_band(
    static: float, share: float, stem: float, goal: float
) -> None:
    friction = HeStiction(static, 0.5 * static)
    before = stem + (2.0 * share - 1.0) * static
    op = compensation(friction, before, (stem, goal), 4, 2.1)
    assert friction.step(stem, float(op[0]))[1] != stem


@given(stem=POSITIONS, goal=POSITIONS)
def test_the_third_move_brings_the_stem_to_its_target(stem: float, goal: float) -> None:
    op = compensation(STICKY, stem, (stem, goal), 6, 2.1)
    stems = STICKY.simulate(op, start=stem)
    assume(abs(goal - stems[1]) > STICKY.jump + 1e-6)  # nearer than J the stem stays
    assert stems[2:] == pytest.approx(np.full(4, goal))


def test_a_horizon_of_two_samples_has_room_for_two_moves() -> None:
    assert compensation(STICKY, 50.0, (50.0, 46.0), 2, 2.0).tolist() == [66.0, 66.0]
