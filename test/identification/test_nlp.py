"""The nonlinear programme: derivatives, constraints, starts, and a short loop."""

import casadi as ca
import numpy as np
import pytest
import simulated_loops as loops
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.identification import (
    FitStatus,
    Identification,
    IdentificationOptions,
    VerdictKind,
    identify,
)
from stiction_ros.identification.equation_error import ArxOrders, squared_error
from stiction_ros.identification.friction_programme import FrictionProgramme
from stiction_ros.identification.programme_data import ProgrammeData
from stiction_ros.identification.programme_terms import ALPHA, Terms
from stiction_ros.identification.smoothed_stems import final_smoothing, smoothed_stems
from stiction_ros.identification.starts import StartKind, border, draw_starts, stiction_line
from stiction_ros.records.record import Record

OPTIONS = IdentificationOptions(method="nlp", output_order=3, input_order=3, delay=(5, 5), starts=2)


def short() -> Record:
    """Example 1 for 450 samples: f_S = 5, f_D = 2, delay 5."""
    return loops.example1(0, "equation", samples=450)


@pytest.fixture(scope="module")
def found() -> Identification:
    return identify(short(), OPTIONS)


def test_it_finds_the_friction(found: Identification) -> None:
    valve = found.valves[0]
    assert found.status is FitStatus.OK
    assert valve.static_friction == pytest.approx(5.0, abs=0.15)
    assert valve.dynamic_friction == pytest.approx(2.0, abs=0.15)
    assert found.outputs[0].a == pytest.approx(loops.A, abs=0.1)
    assert found.outputs[0].fit_free_run > 80.0


def test_it_claims_no_evidence(found: Identification) -> None:
    valve = found.valves[0]
    assert valve.verdict is VerdictKind.UNDECIDED
    assert valve.static_interval == (0.0, pytest.approx(np.ptp(short().op)))
    assert any("no interval and no verdict" in note for note in found.notes)


def test_squared_error_is_that_of_he_s_law(found: Identification) -> None:
    log, valve = found.search, found.valves[0]
    assert log is not None
    friction = np.array([[valve.static_friction, valve.dynamic_friction]])
    orders = ArxOrders(log.output_order, log.input_order, log.first)
    assert log.squared_error == squared_error(short(), friction, ((5,),), orders)
    assert log.objective == pytest.approx(log.squared_error, rel=0.05)


def test_every_accepted_end_keeps_the_constraints(found: Identification) -> None:
    record = short()
    assert found.search is not None
    ends = [start for start in found.search.starts if start.accepted]
    assert {start.kind for start in ends} >= {"border", "restart"}
    least = ALPHA * record.op.var()
    for entry in ends:
        ((static, dynamic),) = entry.end
        assert -1e-6 <= dynamic <= static + 1e-5 <= np.ptp(record.op) + 1e-4
        stem = smoothed_stems(record.op, np.array([[static, dynamic]]), np.array([1e4]))
        assert stem.var() >= (1.0 - 1e-3) * least


def test_the_best_accepted_end_wins(found: Identification) -> None:
    assert found.search is not None
    best = min(start.objective for start in found.search.starts if start.accepted)
    assert found.search.objective == pytest.approx(best, rel=1e-6)


def test_the_same_record_gives_the_same_result(found: Identification) -> None:
    again = identify(short(), OPTIONS)
    assert (again.valves, again.outputs, again.search) == (
        found.valves,
        found.outputs,
        found.search,
    )


def test_derivatives_are_those_of_the_objective_and_constraints() -> None:
    record = loops.tank(1, samples=120)
    orders = ArxOrders.over(2, 2, [2, 2])
    data = ProgrammeData.of(record.op, record.pv, np.ptp(record.op, axis=0), orders)
    frame = FrictionProgramme(data, ((0, 1), (2, 0))).frame
    x, smoothing = ca.MX.sym("x", frame.size), ca.MX.sym("tau", 2)
    price = ca.MX.sym("price", 4)
    zero, one, two = (Terms(frame, x, smoothing, order) for order in range(3))
    objective, limits = zero.objective(), zero.constraints()
    lagrangian = 1.3 * objective + ca.dot(price, limits)
    ours = [one.gradient(), one.jacobian(), two.hessian(1.3, price)]
    automatic = [
        ca.gradient(objective, x),
        ca.jacobian(limits, x),
        ca.hessian(lagrangian, x)[0],
    ]
    both = ca.Function("both", [x, smoothing, price], [*ours, *automatic])
    at = 0.2 * np.random.default_rng(0).standard_normal(frame.size)
    at[:4] = [0.4, 0.1, 0.3, 0.2]
    values = [np.array(value) for value in both(at, [3.0, 6.0], [0.3, 0.2, 0.5, 0.7])]
    for mine, theirs in zip(values[:3], values[3:], strict=True):
        assert np.abs(mine - theirs).max() <= 1e-9 * np.abs(theirs).max()


def test_no_stable_process_is_a_status() -> None:
    generator = np.random.default_rng(0)
    op = np.sin(np.arange(300) / 9.0)
    pv = 1.03 ** np.arange(300) * (1.0 + 1e-3 * generator.standard_normal(300))
    record = Record("unstable", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    found = identify(record, OPTIONS)
    assert found.status is FitStatus.NO_MODEL
    assert "stable" in found.reason
    assert found.search is not None
    assert not any(start.stable for start in found.search.starts)


def test_too_many_choices_of_delays_are_refused() -> None:
    options = IdentificationOptions(method="nlp", delay=(0, 10))
    with pytest.raises(InputError, match="14641 choices"):
        identify(loops.tank(0), options)


@given(limit=st.floats(0.01, 100.0))
def test_border_is_the_edge_of_the_triangle(limit: float) -> None:
    points = border(limit)
    static, dynamic = points.T
    assert ((dynamic >= 0.0) & (dynamic <= static) & (static <= limit)).all()
    on_edge = (dynamic == 0.0) | (static == limit) | (static == dynamic)
    assert on_edge.all()
    assert len(np.unique(points, axis=0)) == len(points)


@given(stiction=st.floats(0.1, 50.0), count=st.integers(1, 6))
def test_line_points_add_up_to_the_apparent_stiction(stiction: float, count: int) -> None:
    points = stiction_line(stiction, 100.0, count)
    assert points.sum(axis=1) == pytest.approx(np.full(count, stiction))
    assert (points[:, 1] <= points[:, 0]).all()


@pytest.mark.parametrize("count", [1, 2, 5, 7])
def test_as_many_starts_as_asked(count: int) -> None:
    starts = draw_starts(np.array([10.0, 20.0]), np.array([7.0, 0.0]), count)
    assert len(starts) == count
    assert sum(start.kind is StartKind.ELLIPSE for start in starts) == min(3, count // 2)
    assert all(start.friction.shape == (2, 2) for start in starts)


def test_smoothing_is_sharp_against_the_span() -> None:
    assert final_smoothing(np.array([20.0, 1.0])) == pytest.approx([1e4, 1e5])
