"""The grid search finds a truth that lies on its grid."""

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.errors import InputError
from stiction_ros.identification import VerdictKind
from stiction_ros.paper.grid_search import count_points, nodes
from stiction_ros.paper.methods import identify
from stiction_ros.paper.paper_options import PaperOptions


def test_truth_on_the_grid_is_found() -> None:
    record = loops.example1(1, "equation", samples=900)
    options = PaperOptions(
        method="grid",
        output_order=3,
        input_order=3,
        delay=(4, 6),
        grid_step=1.0,
        friction_limit=6.0,
    )
    seen: list[float] = []
    found = identify(record, options, seen.append)
    valve = found.valves[0]
    assert (valve.static_friction, valve.dynamic_friction) == (5.0, 2.0)
    assert found.outputs[0].delay == {"V1": 5}
    assert valve.verdict is VerdictKind.UNDECIDED
    assert found.search.points == count_points(record, options) == len(seen) == 28
    assert found.search.objective == pytest.approx(found.search.squared_error, rel=1e-6)
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_two_valves_are_searched_at_once() -> None:
    record = loops.tank(1, samples=300)
    options = PaperOptions(
        method="grid",
        output_order=2,
        input_order=2,
        delay=(0, 0),
        grid_step=4.0,
        friction_limit=8.5,
    )
    found = identify(record, options)
    assert found.search.points == 6 * 6
    assert found.valves[0].static_friction == 8.0
    assert found.valves[1].static_friction == 0.0


def test_nodes_are_multiples_of_the_step() -> None:
    rows = nodes(1.0, 0.1)
    assert len(rows) == 66
    assert rows.max() == pytest.approx(1.0)
    assert (rows[:, 1] <= rows[:, 0]).all()
    assert np.allclose(np.round(rows / 0.1), rows / 0.1)


@pytest.mark.parametrize(("step", "words"), [(1e3, "coarser"), (1e-4, "grid has")])
def test_unusable_steps_are_refused(step: float, words: str) -> None:
    options = PaperOptions(method="grid", grid_step=step)
    with pytest.raises(InputError, match=words):
        identify(loops.example1(1, samples=400), options)
