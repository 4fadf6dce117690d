import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loops import (
    INF,
    equation_19a,
    first_order,
    limits_for,
    models,
    outputs_of,
    stable_model,
    target_at,
    weights_for,
)
from scipy.optimize import minimize

from stiction_ros.control import embedding
from stiction_ros.control.belief import jump_form
from stiction_ros.control.embedding import SECOND_JUMPS, EmbeddingMpc, EmbeddingTuning, patterns
from stiction_ros.control.horizon import HorizonCost, HorizonLimits, HorizonWeights
from stiction_ros.control.result import Plan
from stiction_ros.control.target import Target
from stiction_ros.effects import (
    Behaviour,
    HeStiction,
    KanoStiction,
    SemiPhysicalStiction,
    XchStiction,
)
from stiction_ros.effects.friction.stiction import FrictionSpread
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

TUNING = EmbeddingTuning(jump_price=0.0, jump_margin=0.3)
frictions = st.tuples(st.floats(0.5, 15.0), st.floats(0.0, 1.0)).map(
    lambda p: HeStiction(p[0], p[0] * p[1])
)


def least_of(friction: HeStiction, tuning: EmbeddingTuning = TUNING) -> float:
    return friction.jump + tuning.jump_margin * friction.static_friction


def literal_optimum(
    model: LinearModel,
    weights: HorizonWeights,
    limits: HorizonLimits,
    friction: HeStiction,
    state: np.ndarray,
    last: float,
    target: Target,
) -> float:
    """The cheapest cost of one sticky valve over all patterns, each by a general minimiser.

    The two stems of a pattern are its only variables; costs are summed along a simulation.
    """
    least, f_d = least_of(friction), friction.dynamic_friction
    low, high = limits.stem[0]
    horizon = weights.horizon

    def cost(stems: list[float]) -> float:
        plan = np.array(stems)[:, None]
        return equation_19a(model, weights, state, np.array([last]), target, plan)

    best = cost([last] * horizon)
    for sign in (1.0, -1.0):
        first = (last + least, high - f_d) if sign > 0 else (low + f_d, last - least)
        if first[0] > first[1]:
            continue
        one = minimize(
            lambda v: cost([v[0]] * horizon), [np.mean(first)], bounds=[first], tol=1e-12
        )
        best = min(best, float(one.fun))
        back = (low + f_d, high) if sign > 0 else (low, high - f_d)
        for second in SECOND_JUMPS[1]:

            def two(v: np.ndarray, second: int = second) -> float:
                return cost([v[0]] * second + [v[1]] * (horizon - second))

            start = [np.mean(first), np.mean(first) - sign * least]
            found = minimize(
                two,
                start,
                bounds=[first, back],
                method="SLSQP",
                tol=1e-12,
                constraints={"type": "ineq", "fun": lambda v, s=sign: s * (v[0] - v[1]) - least},
            )
            if found.success:
                best = min(best, float(found.fun))
    return best


@given(st.integers(0, 10_000), frictions, st.floats(15.0, 85.0), st.floats(10.0, 90.0))
@settings(max_examples=10)
def test_no_pattern_is_cheaper_than_the_plan(
    seed: int, friction: HeStiction, last: float, goal: float
) -> None:
    model = stable_model(seed, 2, 1, 1)
    weights, limits = weights_for(model, 9), limits_for(model)
    target = target_at(model, np.array([goal]))
    state = target.state + 3.0 * np.random.default_rng(seed).normal(size=2)
    plan = EmbeddingMpc(model, weights, limits, (friction,), TUNING).plan(
        state, target, np.array([last])
    )
    assert plan is not None
    mine = equation_19a(model, weights, state, np.array([last]), target, plan.stem)
    best = literal_optimum(model, weights, limits, friction, state, last, target)
    assert mine <= best * (1.0 + 1e-5) + 1e-4


def plan_from_anywhere(
    model: LinearModel, friction: HeStiction, last: float, goal: float, seed: int
) -> Plan:
    """Return the plan from a random state, with the stem at ``last``, to rest at ``goal``."""
    target = target_at(model, np.array([goal]))
    state = target.state + 10.0 * np.random.default_rng(seed).normal(size=model.order)
    plan = EmbeddingMpc(model, weights_for(model, 9), limits_for(model), (friction,), TUNING).plan(
        state, target, np.array([last])
    )
    assert plan is not None
    return plan


@given(
    models(valves=1), frictions, st.floats(0.0, 100.0), st.floats(0.0, 100.0), st.integers(0, 99)
)
def test_a_sticky_stem_stays_or_jumps_far_enough(
    model: LinearModel, friction: HeStiction, last: float, goal: float, seed: int
) -> None:
    plan = plan_from_anywhere(model, friction, last, goal, seed)
    moves = np.abs(np.diff(plan.stem[:, 0], prepend=last))
    assert np.all((moves < 1e-9) | (moves >= least_of(friction) - 1e-6))


@given(
    models(valves=1), frictions, st.floats(0.0, 100.0), st.floats(0.0, 100.0), st.integers(0, 99)
)
def test_op_is_the_new_stem_and_dynamic_friction_on_a_slip_else_the_stem(
    model: LinearModel, friction: HeStiction, last: float, goal: float, seed: int
) -> None:
    plan = plan_from_anywhere(model, friction, last, goal, seed)
    move = plan.stem[0, 0] - last
    expected = plan.stem[0, 0]
    if abs(move) > 1e-9:
        expected += np.sign(move) * friction.dynamic_friction
    assert plan.op[0] == pytest.approx(expected, abs=1e-6)


@given(
    models(valves=1), frictions, st.floats(0.0, 100.0), st.floats(0.0, 100.0), st.integers(0, 99)
)
def test_a_valve_by_hes_law_follows_the_whole_plan(
    model: LinearModel, friction: HeStiction, last: float, goal: float, seed: int
) -> None:
    plan = plan_from_anywhere(model, friction, last, goal, seed)
    stem: float = last
    for wanted in plan.stem[:, 0]:
        move = wanted - stem
        op = wanted if abs(move) < 1e-9 else wanted + np.sign(move) * friction.dynamic_friction
        assert -1e-6 <= op <= 100.0 + 1e-6
        stem = friction.step(stem, op)[1]
        assert stem == pytest.approx(wanted, abs=1e-6)


@given(
    models(valves=1), frictions, st.floats(-0.3, 0.29), st.floats(0.0, 100.0), st.integers(0, 99)
)
def test_the_margin_covers_friction_that_is_a_little_higher(
    model: LinearModel, friction: HeStiction, off: float, goal: float, seed: int
) -> None:
    """With a margin of 0.3 f_S the first slip happens for f_S less than 30 % higher."""
    true = HeStiction(friction.static_friction * (1.0 + off), 0.0)
    target = target_at(model, np.array([goal]))
    plan = EmbeddingMpc(model, weights_for(model, 9), limits_for(model), (friction,), TUNING).plan(
        target.state, target, np.array([50.0])
    )
    assert plan is not None
    slips = abs(plan.stem[0, 0] - 50.0) > 1e-9
    assert (true.step(50.0, plan.op[0])[1] != 50.0) == slips


@given(frictions, st.floats(0.0, 100.0), st.floats(0.0, 100.0))
def test_without_a_margin_the_smallest_jump_still_slips(
    friction: HeStiction, last: float, goal: float
) -> None:
    model = first_order()
    target = target_at(model, np.array([goal]))
    mpc = EmbeddingMpc(
        model, weights_for(model, 9), limits_for(model), (friction,), EmbeddingTuning(0.0, 0.0)
    )
    plan = mpc.plan(target.state, target, np.array([last]))
    assert plan is not None
    assert friction.step(last, plan.op[0])[1] == pytest.approx(plan.stem[0, 0], abs=1e-6)


def test_a_valve_at_its_end_can_only_go_back() -> None:
    model, friction = first_order(), HeStiction(8.0, 1.0)
    mpc = EmbeddingMpc(model, weights_for(model, 9), limits_for(model), (friction,), TUNING)
    target = target_at(model, np.array([100.0]))
    plan = mpc.plan(target.state - 30.0, target, np.array([97.0]))
    assert plan is not None
    assert plan.op == pytest.approx([97.0])


def test_a_price_per_jump_is_paid() -> None:
    model, friction = first_order(), HeStiction(8.0, 1.0)
    target = target_at(model, np.array([62.0]))

    def jumps(price: float) -> int:
        tuning = EmbeddingTuning(price, 0.3)
        mpc = EmbeddingMpc(model, weights_for(model, 20), limits_for(model), (friction,), tuning)
        plan = mpc.plan(np.zeros(1), target, np.array([50.0]))
        assert plan is not None
        return plan.jumps

    assert jumps(0.0) > 0
    assert jumps(1e9) == 0


def test_a_small_miss_is_met_by_two_opposite_jumps() -> None:
    model, friction = first_order(), HeStiction(8.0, 1.0)
    target = target_at(model, np.array([53.0]))  # nearer than one jump
    weights = weights_for(model, 40, 1e-6)
    mpc = EmbeddingMpc(model, weights, limits_for(model), (friction,), EmbeddingTuning(0.0, 0.0))
    plan = mpc.plan(np.zeros(1), target, np.array([50.0]))
    assert plan is not None
    assert plan.jumps == 2
    assert plan.stem[-1] == pytest.approx([53.0], abs=0.5)


@pytest.mark.parametrize("sticky", [1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_several_sticky_valves_are_planned_together(sticky: int, seed: int) -> None:
    model = stable_model(seed, 3, 3, 2)
    every = (HeStiction(8.0, 1.0), HeStiction(4.0, 2.0), HeStiction(6.0, 6.0))
    known = tuple(f if j < sticky else None for j, f in enumerate(every))
    weights, limits = weights_for(model, 9), limits_for(model, move=20.0)
    random = np.random.default_rng(seed)
    target = target_at(model, random.uniform(20.0, 80.0, 3))
    state, last = target.state + random.normal(size=3), random.uniform(20.0, 80.0, 3)
    plan = EmbeddingMpc(model, weights, limits, known, TUNING).plan(state, target, last)
    assert plan is not None
    moves = np.abs(np.diff(np.vstack([last, plan.stem]), axis=0))
    for j, friction in enumerate(known):
        if friction is None:
            assert moves[:, j].max() <= 20.0 + 1e-6
        else:
            assert np.all((moves[:, j] < 1e-9) | (moves[:, j] >= least_of(friction) - 1e-6))
    assert np.all((plan.op >= 0.0) & (plan.op <= 100.0))
    # Each valve alone with the others staying is among the patterns: it cannot be cheaper.
    mine = equation_19a(model, weights, state, last, target, plan.stem)
    for direction in itertools.product((-1, 0, 1), repeat=sticky):
        stems = np.tile(last, (9, 1))
        for j, sign in enumerate(direction):
            friction = known[j]
            assert friction is not None
            stems[:, j] += sign * least_of(friction)
        if np.all((stems >= 6.0) & (stems <= 94.0)):
            assert mine <= equation_19a(model, weights, state, last, target, stems) + 1e-6


def test_healthy_valves_beside_a_sticky_one_move_freely() -> None:
    model = stable_model(1, 3, 2, 2)
    target = target_at(model, np.array([50.0, 55.5]))
    mpc = EmbeddingMpc(
        model, weights_for(model, 9), limits_for(model), (HeStiction(8.0, 1.0), None), TUNING
    )
    plan = mpc.plan(target.state, target, np.array([50.0, 55.0]))
    assert plan is not None
    assert 0.0 < abs(plan.op[1] - 55.0) < 1.0


def test_valves_that_wait_stay_where_a_jump_would_be_cheaper() -> None:
    model = stable_model(1, 3, 2, 2)
    target = target_at(model, np.array([70.0, 50.0]))
    stem, friction = np.array([50.0, 50.0]), (HeStiction(8.0, 1.0), None)
    mpc = EmbeddingMpc(model, weights_for(model, 20), limits_for(model), friction, TUNING)
    free = mpc.plan(target.state, target, stem)
    mpc.waits = True
    waiting = mpc.plan(target.state, target, stem)
    assert free is not None
    assert waiting is not None
    assert (free.jumps > 0, waiting.jumps) == (True, 0)
    assert waiting.op[0] == 50.0
    assert waiting.cost > free.cost


def soft_limits(model: LinearModel) -> HorizonLimits:
    return limits_for(model, output=(-INF, 27.0))


def test_staying_pays_for_the_output_bound_that_it_breaks() -> None:
    """At 60 % the output settles at 25 + 4: only a jump down keeps it below 27."""
    model, friction = first_order(), HeStiction(8.0, 1.0)
    d = np.array([4.0])
    target = target_at(model, np.array([60.0]), d)
    state = np.array([2.5])  # the output is at 26.5 now
    mpc = EmbeddingMpc(model, weights_for(model, 30), soft_limits(model), (friction,), TUNING)
    plan = mpc.plan(state, target, np.array([60.0]))
    assert plan is not None
    assert plan.jumps > 0
    assert plan.pv.max() <= 27.0 + 0.3


def test_the_slack_of_a_plan_is_how_far_it_breaks_the_bound() -> None:
    model, friction = first_order(), HeStiction(8.0, 1.0)
    target = target_at(model, np.array([60.0]), np.array([9.0]))
    tuning = EmbeddingTuning(jump_price=1e12)  # staying is all that is left
    mpc = EmbeddingMpc(model, weights_for(model, 30), soft_limits(model), (friction,), tuning)
    plan = mpc.plan(np.array([2.5]), target, np.array([60.0]))
    assert plan is not None
    assert plan.jumps == 0
    assert plan.slack == pytest.approx([plan.pv[1:].max() - 27.0])


def test_the_plan_predicts_the_outputs() -> None:
    model = stable_model(3, 3, 2, 2)
    d = np.array([0.5, -0.2])
    target = target_at(model, np.array([45.0, 60.0]), d)
    mpc = EmbeddingMpc(
        model, weights_for(model, 9), limits_for(model), (None, HeStiction(8.0, 1.0)), TUNING
    )
    plan = mpc.plan(target.state + 1.0, target, np.array([50.0, 50.0]))
    assert plan is not None
    literal = outputs_of(model, target.state + 1.0, plan.stem, d)
    assert plan.pv == pytest.approx(literal, abs=1e-9)


@pytest.mark.parametrize("count", [0, 4])
def test_too_few_or_too_many_sticky_valves_are_refused(count: int) -> None:
    model = stable_model(1, 3, 4, 2)
    known = tuple(HeStiction(5.0, 2.0) if j < count else None for j in range(4))
    with pytest.raises(InputError) as caught:
        EmbeddingMpc(model, weights_for(model), limits_for(model), known, TUNING)
    assert f"{count} sticky valves" in caught.value.what
    assert caught.value.fix


def test_there_are_17_patterns_of_one_valve_and_81_of_two() -> None:
    assert [len(patterns(n)) ** n for n in (1, 2, 3)] == [17, 81, 125]


def test_a_law_of_two_strokes_jumps_a_sample_later_and_back_after_a_rest() -> None:
    once, twice = patterns(1), patterns(1, strokes=2)
    assert [(p.direction, p.wait) for p in twice] == [
        (p.direction, p.wait + abs(p.direction)) for p in once
    ]
    assert [p.second for p in twice] == [p.second + 2 * (p.second > 0) for p in once]


def test_a_jump_that_is_better_later_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Patterns that wait a sample are never dearer, and now and then gain a lot."""
    model, friction = first_order(), HeStiction(8.0, 1.0)
    random, gains = np.random.default_rng(2), []
    mpc = EmbeddingMpc(model, weights_for(model, 30), limits_for(model), (friction,), TUNING)
    monkeypatch.setattr(embedding, "WAITS", ())
    hasty = EmbeddingMpc(model, weights_for(model, 30), limits_for(model), (friction,), TUNING)
    for _ in range(30):
        target = target_at(model, random.uniform(40.0, 60.0, 1))
        state, last = target.state + random.normal(size=1), random.uniform(40.0, 60.0, 1)
        plans = [m.plan(state, target, last) for m in (mpc, hasty)]
        costs = [plan.cost for plan in plans if plan is not None]
        gains.append(costs[1] / costs[0])
    assert min(gains) >= 1.0 - 1e-9
    assert max(gains) > 1.05


@pytest.mark.parametrize(("known", "least"), [(None, 2.4), ((0.5, 0.25), 0.8), ((2.0, 0.5), 2.5)])
def test_the_margin_follows_the_intervals_of_the_frictions(
    known: tuple[float, float] | None, least: float
) -> None:
    """A share of f_S without intervals; else their half-widths, but a tenth of f_S at least."""
    model, friction = first_order(), HeStiction(8.0, 1.0)
    mpc = EmbeddingMpc(model, weights_for(model), limits_for(model), (friction,), TUNING)
    mpc.know([jump_form(friction)], [None if known is None else FrictionSpread(*known)])
    assert mpc.valves(np.array([50.0])).least[0] == pytest.approx(friction.jump + least)


def test_a_jump_is_sure_from_wherever_the_stem_may_be() -> None:
    model, friction = first_order(), HeStiction(8.0, 1.0)
    mpc = EmbeddingMpc(model, weights_for(model, 20), limits_for(model), (friction,), TUNING)
    mpc.know([jump_form(friction)], None, np.array([[45.0, 56.0]]))
    for goal, start, sign in ((90.0, 56.0, 1.0), (10.0, 45.0, -1.0)):
        target = target_at(model, np.array([goal]))
        plan = mpc.plan(np.zeros(1), target, np.array([50.0]))
        assert plan is not None
        assert sign * (plan.op[0] - start) > friction.static_friction
        assert {friction.step(stem, plan.op[0])[1] for stem in (45.0, 50.0, 56.0)} == {
            plan.op[0] - sign * friction.dynamic_friction
        }


def test_a_valve_without_room_for_a_jump_is_known_as_immobile() -> None:
    model = first_order()
    for static, immobile in ((40.0, ()), (120.0, (0,))):
        known = (HeStiction(static, 1.0),)
        mpc = EmbeddingMpc(model, weights_for(model), limits_for(model), known, TUNING)
        assert mpc.immobile == immobile


@pytest.mark.parametrize(
    "law", [KanoStiction(9.0, 7.0), XchStiction(8.0, 1.0), SemiPhysicalStiction(8.0, 5.0, 1.5)]
)
@given(last=st.floats(20.0, 80.0), goal=st.floats(20.0, 80.0), seed=st.integers(0, 99))
@settings(max_examples=10)
def test_a_valve_by_another_law_follows_the_first_move(
    law: Behaviour, last: float, goal: float, seed: int
) -> None:
    model = first_order()
    target = target_at(model, np.array([goal]))
    state = target.state + 5.0 * np.random.default_rng(seed).normal(size=1)
    plan = EmbeddingMpc(model, weights_for(model, 9), limits_for(model), (law,), TUNING).plan(
        state, target, np.array([last])
    )
    assert plan is not None
    assert law.step(law.rest(last), float(plan.op[0]), 0.0)[1] == pytest.approx(
        plan.stem[0, 0], abs=1e-6
    )


def test_the_cost_of_a_plan_is_that_of_19a() -> None:
    model, friction = stable_model(5, 3, 1, 2), HeStiction(8.0, 1.0)
    weights = weights_for(model, 12)
    target = target_at(model, np.array([61.0]))
    last, state = np.array([50.0]), target.state + 2.0
    tuning = EmbeddingTuning(jump_price=0.7)
    mpc = EmbeddingMpc(model, weights, limits_for(model), (friction,), tuning)
    plan = mpc.plan(state, target, last)
    assert plan is not None
    literal = equation_19a(model, weights, state, last, target, plan.stem) + 0.7 * plan.jumps
    assert plan.cost == pytest.approx(literal, rel=1e-9)


@given(
    frictions,
    st.floats(15.0, 85.0),
    st.floats(10.0, 90.0),
    st.floats(0.5, 40.0),
    st.integers(0, 99),
)
def test_op_never_steps_further_than_a_kick_may_or_a_slip_needs(
    friction: HeStiction, last: float, goal: float, limit: float, seed: int
) -> None:
    model = stable_model(seed, 2, 1, 1)
    tuning = EmbeddingTuning(kick_limits=np.array([limit]))
    mpc = EmbeddingMpc(model, weights_for(model, 9), limits_for(model), (friction,), tuning)
    target, stem, op = target_at(model, np.array([goal])), last, last
    state = target.state + np.random.default_rng(seed).normal(size=2)
    needed = least_of(friction, tuning) + 2.0 * friction.dynamic_friction
    for _ in range(6):
        plan = mpc.plan(state, target, np.array([stem]))
        assert plan is not None
        assert abs(plan.op[0] - op) <= max(limit, needed) + 1e-6
        state = model.a @ state + model.b @ (plan.stem[0] - model.stem0) + model.constant
        stem, op = float(plan.stem[0, 0]), float(plan.op[0])


def test_the_smallest_jump_has_the_price_that_is_set_whatever_the_friction() -> None:
    model, spread = stable_model(4, 2, 2, 2), FrictionSpread(0.3, 0.1)
    tuning = EmbeddingTuning(move_prices=np.array([2.5, 0.0]))
    for friction in (HeStiction(4.0, 1.0), HeStiction(12.0, 2.0)):
        laws, spreads = (friction, HeStiction(6.0, 1.0)), (spread, None)
        weights = weights_for(model, 9)
        mpc = EmbeddingMpc(model, weights, limits_for(model), laws, tuning, spreads)
        least = mpc.valves(np.array([50.0, 50.0])).least
        state = np.zeros(model.order)
        jump = np.zeros((9, 2))
        jump[:, 0] = least[0]
        free = HorizonCost(model, dataclasses.replace(weights, move=np.zeros((2, 2))))
        v = jump.reshape(-1)
        costs = [
            0.5 * v @ c.hessian @ v + v @ c.linear(state, np.zeros(2)) for c in (mpc.cost, free)
        ]
        assert costs[0] - costs[1] == pytest.approx(2.5)
        assert mpc.move_weights[1, 1] == weights.move[1, 1]
