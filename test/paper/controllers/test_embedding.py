import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loops import limits_for, outputs_of
from paper_cases import LIMITS, STICKY, situation, tuning, two_valves

from stiction_ros.control import ControlMode
from stiction_ros.effects import ChoudhuryStiction, KanoStiction, XchStiction
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.errors import InputError
from stiction_ros.paper.controllers.augmented_cost import AugmentedCost, PlanProblem
from stiction_ros.paper.controllers.embedding import PrintedEmbeddingMpc, PrintedPlan
from stiction_ros.paper.controllers.smoothed_programme import SmoothedProgramme
from stiction_ros.paper.controllers.weights import (
    ProgrammeCost,
    WarmStart,
    WeightPreset,
    plain_weights,
    unaware_weights,
)

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


@given(away=st.floats(-30.0, 30.0), searching=st.booleans())
def test_what_is_applied_is_the_cheaper_under_the_hard_model(away: float, searching: bool) -> None:
    mpc = SEARCHING if searching else COMPENSATING
    at = situation(MODEL, away)
    start = mpc.warm_start(at)
    found = plan(mpc, at)
    if found.warm_start_cost < found.programme_cost:
        assert found.op == pytest.approx(start[0])
    assert found.stem[0] == pytest.approx(mpc.cost.stems(found.op[None], at.stem)[0])


def test_a_kick_that_pays_is_taken_from_the_warm_start() -> None:
    """6 % off the target: the programme stays, (21) goes there by way of 34 %."""
    found = plan(controller(horizon=40), situation(MODEL, 6.0))
    assert found.warm_start_cost < found.programme_cost
    assert found.op[0] == pytest.approx(50.0 - 2.1 * 8.0)
    assert found.jumps == 2


def test_a_kick_that_does_not_pay_is_not_made() -> None:
    found = plan(controller(), situation(MODEL, 0.2))
    assert found.programme_cost <= found.warm_start_cost
    assert found.jumps == 0


def test_21_starts_from_the_op_applied_last() -> None:
    mpc = controller(horizon=40)
    at = situation(MODEL, 6.0)
    first = plan(mpc, at)
    at = dataclasses.replace(at, before=first.op)
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


def test_bounds_that_it_does_not_know_are_refused() -> None:
    limits = limits_for(MODEL, move=5.0)
    with pytest.raises(InputError) as caught:
        PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits, (STICKY, None))
    assert (caught.value.where, bool(caught.value.fix)) == ("op_rate_limits", True)


def test_soft_bounds_change_no_plan_and_are_told_as_slack() -> None:
    at = situation(MODEL, 12.0)
    free = plan(controller(), at)
    high = float(free.pv[1:, 0].max()) - 0.1
    soft = np.array([[-np.inf, high], [-np.inf, np.inf]])
    limits = dataclasses.replace(limits_for(MODEL), output=soft)
    bounded = plan(PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits, (STICKY, None)), at)
    assert bounded.op.tolist() == free.op.tolist()
    assert free.slack == pytest.approx([0.0, 0.0])
    assert bounded.slack == pytest.approx([0.1, 0.0])


def test_a_loop_without_sticky_valves_is_refused() -> None:
    with pytest.raises(InputError, match="0 sticky valves"):
        PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits_for(MODEL), (None, None))


def test_a_law_without_a_smoothed_form_is_refused() -> None:
    law = ChoudhuryStiction(8.0, 7.0)
    with pytest.raises(InputError, match="He's law") as caught:
        PrintedEmbeddingMpc(MODEL, tuning(MODEL), limits_for(MODEL), (law, None))
    assert (caught.value.where, bool(caught.value.fix)) == ("formulation", True)


@pytest.mark.parametrize("away", [6.0, 12.0])
@pytest.mark.parametrize("law", [KanoStiction(9.0, 7.0), XchStiction(8.0, 1.0)])
def test_from_rest_other_laws_of_the_same_jumps_are_planned_alike(
    law: Behaviour, away: float
) -> None:
    other = PrintedEmbeddingMpc(MODEL, tuning(MODEL, 40), limits_for(MODEL), (law, None))
    found, he = (plan(mpc, situation(MODEL, away)) for mpc in (other, controller(horizon=40)))
    assert found.op == pytest.approx(he.op, abs=1e-3)
    assert found.jumps == he.jumps > 0


def test_without_a_warm_start_the_stem_stays_where_a_kick_pays() -> None:
    at = situation(MODEL, 6.0)
    helped, left = (
        plan(controller(start, horizon=40), at)
        for start in (WarmStart.COMPENSATION, WarmStart.NONE)
    )
    assert (helped.jumps, left.jumps) == (2, 0)
    assert left.programme_cost > helped.warm_start_cost


def test_the_plain_cost_penalises_op_and_not_the_stem() -> None:
    unaware = unaware_weights(WeightPreset.CORRECTED, MODEL, 5)
    cost = AugmentedCost(MODEL, plain_weights(unaware), (None, None))
    at = situation(MODEL, 0.0)
    rest = np.tile(at.stem, (5, 1))
    moved = rest.copy()
    moved[2:, 0] += 3.0
    states, state = [], at.state - at.target.state
    for stem in moved:
        state = MODEL.a @ state + MODEL.b @ (stem - at.target.stem)
        states.append(state)
    wanted = 9.0 * unaware.move[0, 0] + sum(x @ unaware.state @ x for x in states[:-1])
    wanted += states[-1] @ unaware.terminal @ states[-1]
    assert cost(at, rest) == pytest.approx(0.0, abs=1e-9)
    assert cost(at, moved) == pytest.approx(wanted)


@pytest.mark.parametrize("cost", list(ProgrammeCost))
def test_the_programme_minimises_the_cost_it_is_judged_by(cost: ProgrammeCost) -> None:
    chosen = tuning(MODEL)
    if cost is ProgrammeCost.PLAIN:
        plain = plain_weights(unaware_weights(WeightPreset.CORRECTED, MODEL, 12))
        chosen = dataclasses.replace(chosen, weights=plain)
    judged = AugmentedCost(MODEL, chosen.weights, (STICKY, None))
    programme = SmoothedProgramme(judged, chosen, LIMITS)
    at = dataclasses.replace(situation(MODEL, 12.0), before=np.array([52.0, 49.0]))
    op = np.tile(at.target.stem, (12, 1))
    found = programme.solve(at, op, judged.stems(op, at.stem))
    assert found.op is not None
    assert found.cost == pytest.approx(judged(at, found.op), rel=1e-4)
