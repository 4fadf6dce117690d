"""The nonlinear programme: derivatives, constraints, starts, and a short loop."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.identification import FitStatus, Identification, VerdictKind
from stiction_ros.paper.methods import identify
from stiction_ros.paper.one_step_result import fit_outputs
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.programme.reduced_programme import (
    ALPHA,
    Criterion,
    ReducedProgramme,
    StemTable,
)
from stiction_ros.paper.programme.starts import (
    apparent_stictions,
    around,
    border,
    draw_starts,
    fit_ellipse,
    inside,
    stiction_line,
)
from stiction_ros.paper.smoothed_laws import final_smoothing, smooth_law
from stiction_ros.records.record import Record
from stiction_ros.signals.arx_fit import ArxOrders

OPTIONS = PaperOptions(
    method="nlp", output_order=3, input_order=3, delay=(5, 5), starts=4, friction_limit=100.0
)

TAU = np.array([1e4])


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
    orders = ArxOrders.over(3, 3, [5])
    stems = smooth_law("he").hard_stems(short().op, friction)
    assert log.squared_error == fit_outputs(short().pv, stems, ((5,),), orders).squared_error
    assert log.objective == pytest.approx(log.squared_error, rel=0.05)


def test_every_accepted_end_keeps_the_constraints(found: Identification) -> None:
    record = short()
    ends = [start for start in found.search.starts if start.accepted]
    assert ends
    least = ALPHA * record.op.var()
    for entry in ends:
        ((static, dynamic),) = entry.end
        assert -1e-6 <= dynamic <= static + 1e-5 <= np.ptp(record.op) + 1e-4
        stem = smooth_law("he").stems(record.op, np.array([[static, dynamic]]), np.array([1e4]))
        assert stem.var() >= (1.0 - 1e-3) * least


def test_the_best_accepted_end_wins(found: Identification) -> None:
    best = min(start.objective for start in found.search.starts if start.accepted)
    assert found.search.objective == pytest.approx(best, rel=1e-6)


@pytest.mark.trial
@pytest.mark.parametrize("method", ["nlp", "nlp_printed"])
def test_as_many_runs_of_ipopt_as_the_paper_makes(method: str) -> None:
    options = dataclasses.replace(OPTIONS, method=method, delay=(4, 6), starts=2)
    found = identify(short(), options)
    assert len(found.search.starts) == 2 * 3
    assert {start.delays for start in found.search.starts} == {((4,),), ((5,),), ((6,),)}


def test_the_printed_method_is_no_better_than_the_one_at_its_best(found: Identification) -> None:
    printed = identify(short(), dataclasses.replace(OPTIONS, method="nlp_printed"))
    assert found.search.squared_error <= printed.search.squared_error


@settings(max_examples=20)
@given(static=st.floats(0.0, 8.0), share=st.floats(0.0, 1.0))
def test_without_the_coefficients_it_is_the_same_criterion(static: float, share: float) -> None:
    record, friction = short(), np.array([[static, share * static]])
    orders = ArxOrders.over(3, 3, [5])
    criterion = Criterion(StemTable(record, np.ptp(record.op, axis=0), orders), ((5,),))
    value, moving = criterion(friction)
    wanted = fit_outputs(
        record.pv, smooth_law("he").stems(record.op, friction, TAU), ((5,),), orders
    )
    assert value == pytest.approx(wanted.squared_error, rel=1e-6)
    stem = smooth_law("he").stems(record.op, friction, TAU)[0]
    assert moving == pytest.approx([stem.var() / record.op.var()])


@pytest.mark.parametrize("start", [(6.0, 1.0), (3.0, 3.0), (0.0, 0.0)])
def test_a_run_never_ends_worse_than_it_began(start: tuple[float, float]) -> None:
    record = short()
    limits = np.ptp(record.op, axis=0)
    criterion = Criterion(StemTable(record, limits, ArxOrders.over(3, 3, [5])), ((5,),))
    end = ReducedProgramme(criterion).solve(np.array([start]), 0.05)
    assert end.objective <= criterion(np.array([start]))[0]
    assert end.objective == pytest.approx(criterion(np.array(end.end))[0], rel=1e-6)
    ((static, dynamic),) = end.end
    assert 0.0 <= dynamic <= static <= limits[0]


@pytest.mark.trial
def test_the_same_record_gives_the_same_result(found: Identification) -> None:
    again = identify(short(), OPTIONS)
    assert (again.valves, again.outputs, again.search) == (
        found.valves,
        found.outputs,
        found.search,
    )


@pytest.mark.trial
def test_no_stable_process_is_a_status() -> None:
    generator = np.random.default_rng(0)
    op = np.sin(np.arange(300) / 9.0)
    pv = 1.03 ** np.arange(300) * (1.0 + 1e-3 * generator.standard_normal(300))
    record = Record("unstable", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    found = identify(record, OPTIONS)
    assert found.status is FitStatus.NO_MODEL
    assert "stable" in found.reason
    assert not any(start.stable for start in found.search.starts)


def test_too_many_choices_of_delays_are_refused() -> None:
    options = PaperOptions(method="nlp", delay=(0, 10))
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


@given(limit=st.floats(0.01, 100.0), count=st.integers(1, 300))
def test_points_inside_are_inside_and_different(limit: float, count: int) -> None:
    points = inside(limit, count)
    static, dynamic = points.T
    assert ((dynamic >= 0.0) & (dynamic <= static) & (static <= limit)).all()
    assert len(np.unique(np.round(points / limit, 12), axis=0)) == count


@given(static=st.floats(0.0, 10.0), share=st.floats(0.0, 1.0), reach=st.floats(0.001, 0.5))
def test_points_around_stay_near_and_in_the_triangle(
    static: float, share: float, reach: float
) -> None:
    limits, friction = np.array([10.0, 4.0]), np.array([[static, share * static], [0.0, 0.0]])
    for point in around(friction, limits, reach, 20):
        assert ((point[:, 1] >= 0.0) & (point[:, 1] <= point[:, 0])).all()
        assert (point[:, 0] <= limits).all()
        assert (np.abs(point - friction) <= reach * limits[:, None] + 1e-12).all()


@given(stiction=st.floats(0.1, 50.0), count=st.integers(1, 6))
def test_line_points_add_up_to_the_apparent_stiction(stiction: float, count: int) -> None:
    points = stiction_line(stiction, 100.0, count)
    assert points.sum(axis=1) == pytest.approx(np.full(count, stiction))
    assert (points[:, 1] <= points[:, 0]).all()


@pytest.mark.parametrize("count", [1, 2, 5, 7])
def test_as_many_starts_as_asked(count: int) -> None:
    starts = draw_starts(np.array([10.0, 20.0]), np.array([7.0, 0.0]), count)
    assert len(starts) == count
    assert sum(start[0].sum() == pytest.approx(7.0) for start in starts) == min(3, count // 2)
    assert all(start.shape == (2, 2) for start in starts)


def test_smoothing_is_sharp_against_the_span() -> None:
    assert final_smoothing(np.array([20.0, 1.0])) == pytest.approx([1e4, 1e5])


@given(
    long=st.floats(0.5, 20.0),
    share=st.floats(0.1, 0.95),
    angle=st.floats(0.0, np.pi),
    centre=st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)),
)
def test_points_of_an_ellipse_give_it_back(
    long: float, share: float, angle: float, centre: tuple[float, float]
) -> None:
    short = share * long
    turn = np.linspace(0.0, 2.0 * np.pi, 101)[:-1]
    x = centre[0] + long * np.cos(turn) * np.cos(angle) - short * np.sin(turn) * np.sin(angle)
    y = centre[1] + long * np.cos(turn) * np.sin(angle) + short * np.sin(turn) * np.cos(angle)
    found = fit_ellipse(x, y)
    assert found is not None
    assert found.misfit < 1e-5
    chord = 2.0 * long * short / np.hypot(short * np.cos(angle), long * np.sin(angle))
    assert found.chord == pytest.approx(chord, rel=1e-5)


@pytest.mark.parametrize(
    ("x", "y"),
    [
        (np.arange(5.0), np.arange(5.0) ** 2),
        (np.arange(50.0), np.zeros(50)),
        (np.arange(50.0), 2.0 * np.arange(50.0)),
    ],
)
def test_there_need_not_be_an_ellipse(x: np.ndarray, y: np.ndarray) -> None:
    assert fit_ellipse(x, y) is None


def test_apparent_stiction_of_a_cycling_loop_is_near_the_band() -> None:
    (found,) = apparent_stictions(loops.example1(1))
    assert 4.0 < found < 10.0  # f_S + f_D = 7


def test_the_output_that_draws_the_better_ellipse_is_taken() -> None:
    record = loops.example1(1)
    noise = np.random.default_rng(0).standard_normal((len(record), 1))
    both = dataclasses.replace(
        record, outputs=("NOISE", "PV1"), pv=np.hstack([noise, record.pv]), sp=None
    )
    assert apparent_stictions(both).tolist() == apparent_stictions(record).tolist()
