from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import limits_for, outputs_of
from paper_cases import STICKY, situation, tuning, two_valves

from stiction_ros.control import ControlMode
from stiction_ros.control.augmented_cost import PlanProblem
from stiction_ros.control.paper_weights import WarmStart
from stiction_ros.control.printed_embedding import Choice, PrintedEmbeddingMpc, PrintedPlan
from stiction_ros.effects import KanoStiction
from stiction_ros.errors import InputError

MODEL = two_valves()


def controller(start: WarmStart = WarmStart.COMPENSATION, horizon: int = 12) -> PrintedEmbeddingMpc:
    return PrintedEmbeddingMpc(
        MODEL, tuning(MODEL, horizon, start), limits_for(MODEL), (STICKY, None)
    )


COMPENSATING, SEARCHING = controller(), controller(WarmStart.SEARCH)


def plan(mpc: PrintedEmbeddingMpc, at: PlanProblem) -> PrintedPlan:
    found = mpc.plan(at.state, at.target, at.stem)
    assert found is not None
    return found


@settings(max_examples=30, deadline=None)
@given(away=st.floats(-30.0, 30.0), searching=st.booleans())
def test_what_is_applied_is_the_cheaper_under_the_hard_model(away: float, searching: bool) -> None:
    mpc = SEARCHING if searching else COMPENSATING
    at = situation(MODEL, away)
    found = plan(mpc, at)
    by_programme = found.choice is Choice.PROGRAMME
    assert by_programme == (found.programme_cost <= found.warm_start_cost)
    assert found.stem[0] == pytest.approx(mpc.cost.stems(found.op[None], at.stem)[0])


def test_a_kick_that_pays_is_taken_from_the_warm_start() -> None:
    """6 % off the target: the programme stays, (21) goes there by way of 34 %."""
    found = plan(controller(horizon=40), situation(MODEL, 6.0))
    assert found.choice is Choice.WARM_START
    assert found.op[0] == pytest.approx(50.0 - 2.1 * 8.0)
    assert found.jumps == 2


def test_a_kick_that_does_not_pay_is_not_made() -> None:
    found = plan(controller(), situation(MODEL, 0.2))
    assert (found.choice, found.jumps) == (Choice.PROGRAMME, 0)


def test_21_starts_from_the_op_applied_last() -> None:
    mpc = controller(horizon=40)
    at = situation(MODEL, 6.0)
    first = plan(mpc, at)
    assert mpc.warm_start(at)[0, 0] == pytest.approx(max(first.op[0] - 2.1 * 8.0, 0.0))


def test_the_search_is_at_least_as_good_a_start_as_21() -> None:
    at = situation(MODEL, 4.0)
    cost = SEARCHING.cost
    assert cost(at, SEARCHING.warm_start(at)) <= cost(at, controller().warm_start(at))


def test_predicted_outputs_are_those_of_the_plan() -> None:
    at = situation(MODEL, 12.0)
    found = plan(controller(), at)
    wanted = outputs_of(MODEL, at.state, found.stem, np.zeros(2))
    assert found.pv == pytest.approx(wanted, abs=1e-8)


def test_the_mode_is_embedding() -> None:
    assert COMPENSATING.mode is ControlMode.EMBEDDING


@pytest.mark.parametrize(
    ("bounds", "where"),
    [({"move": 5.0}, "op_rate_limits"), ({"output": (0.0, 1.0)}, "pv_low, pv_high")],
)
def test_bounds_that_it_does_not_know_are_refused(bounds: dict[str, object], where: str) -> None:
    limits = limits_for(MODEL, **bounds)  # type: ignore[arg-type]
    with pytest.raises(InputError) as caught:
        PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits, (STICKY, None))
    assert (caught.value.where, bool(caught.value.fix)) == (where, True)


def test_a_loop_without_sticky_valves_is_refused() -> None:
    with pytest.raises(InputError, match="0 sticky valves"):
        PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits_for(MODEL), (None, None))


def test_another_law_than_he_s_is_refused() -> None:
    with pytest.raises(InputError, match="He's law") as caught:
        PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits_for(MODEL), (KanoStiction(8.0, 7.0), None))
    assert (caught.value.where, bool(caught.value.fix)) == ("formulation", True)
