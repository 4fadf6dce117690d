"""What the controller tells of the process, and what that does to the evidence."""

import dataclasses

import numpy as np
import pytest
from evidence_loops import FloatArray, pi_loop
from hypothesis import given, settings
from hypothesis import strategies as st

from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.closed_loop.tuning import RESETS, Tuning, tunings
from stiction_ros.identification.evidence.accepted import HARMLESS, accepted
from stiction_ros.identification.evidence.candidate import ideal
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.output_fit import beginnings, fit_output
from stiction_ros.identification.evidence.rates import looks
from stiction_ros.identification.evidence.search import search
from stiction_ros.identification.evidence.whitened import Whitened
from stiction_ros.identification.linear.response_prior import (
    FACTOR,
    FREE,
    MIDDLE,
    REACHES,
    Reach,
    ResponsePrior,
)
from stiction_ros.records import Record

GAIN, RESET = 1.0, 12.0  # of the controller of pi_loop


def of_noise(*, seed: int = 0, samples: int = 900) -> Record:
    """Return a first-order process under PI control that coloured noise alone moves."""
    random = np.random.default_rng(seed)
    op, pv = np.zeros(samples), np.zeros(samples)
    y, drift, u, last = 0.0, 0.0, 0.0, 0.0
    for k in range(samples):
        y = 0.85 * y + 0.15 * u
        drift = 0.9 * drift + 0.1 * random.standard_normal()
        pv[k] = y + drift
        error = -pv[k]
        op[k] = u = u + 1.0 * (error - last) + error / 8.0
        last = error
    return Record(
        "noise", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None], sp=np.zeros_like(pv[:, None])
    )


def in_scale(record: Record, tuning: Tuning) -> float:
    """Return the gain of a tuning in the units of the record."""
    return tuning.gain * float(record.op.std() / record.pv.std())


def test_the_controller_is_recovered_and_counted_in_the_scale_of_the_record() -> None:
    record = pi_loop(3.0, 1.0)
    (tuning,) = tunings(record)
    assert tuning is not None
    assert tuning.valve == 0
    assert in_scale(record, tuning) == pytest.approx(GAIN, rel=0.02)
    assert tuning.time == pytest.approx(RESETS * RESET, rel=0.05)


def test_what_no_controller_moves_has_no_tuning() -> None:
    random = np.random.default_rng(5)
    steps = np.cumsum(random.standard_normal((600, 1)), axis=0)
    record = Record("open", 1.0, ("V1",), ("PV1",), steps, random.standard_normal((600, 1)))
    assert tunings(record) == (None,)


@pytest.mark.parametrize("factors", [(20.0, 50.0, 1.0), (1.0, -3.0, 0.2)])
def test_no_unit_changes_what_the_controller_tells(factors: tuple[float, float, float]) -> None:
    record = pi_loop(3.0, 1.0)
    by, offset, scale = factors
    other = dataclasses.replace(
        record,
        op=by * record.op + offset,
        pv=scale * record.pv + offset,
        sp=None if record.sp is None else scale * record.sp + offset,
    )
    (one,), (two,) = tunings(record), tunings(other)
    assert one is not None
    assert two is not None
    assert two.gain == pytest.approx(one.gain, rel=1e-6)
    assert two.time == pytest.approx(one.time, rel=1e-6)


@pytest.mark.parametrize(
    ("time", "rate", "heights", "seen"),
    [
        (3.0, 1, [1.0, 1.0, 1.0, 0.0], 1.0),  # two samples in the third group, one of them counts
        (8.0, 1, [1.0, 1.0, 2.0, 2.0], 0.75),  # six taps of eight
        (8.0, 2, [1.0, 1.0, 2.0, 0.0], 1.0),
        (0.1, 1, [1.0, 0.0, 0.0, 0.0], 1.0),  # one row at least
    ],
)
def test_a_reach_sums_the_taps_up_to_three_reset_times(
    time: float, rate: int, heights: list[float], seen: float
) -> None:
    reach = Tuning(1, 4.0, time).reach(rate, 0.5, np.array([0, 1, 2, 4, 6]))
    assert reach.valve == 1
    assert reach.heights.tolist() == heights
    assert reach.unit == pytest.approx(seen / (4.0 * 0.5))


@settings(max_examples=20)
@given(st.integers(0, 10**6), st.sampled_from(range(len(REACHES))), st.floats(0.1, 5.0))
def test_a_held_response_has_the_likelihood_of_the_record_given_its_sum(
    seed: int, reach: int, unit: float
) -> None:
    random = np.random.default_rng(seed)
    edges, count = np.array([0, 1, 2, 4]), 30
    rows, y = random.standard_normal((3, count)), random.standard_normal(count)
    expected = Reach(0, np.array([1.0, 1.0, 2.0]), unit)
    prior = ResponsePrior(1, 3, reach=reach)
    held = prior.held(edges, expected)
    equations = rows @ rows.T + prior.precision(edges) + held.precision
    seen = rows @ y + held.pull
    left = y @ y + held.energy - seen @ np.linalg.solve(equations, seen)
    loss = count * np.log(left / count) + np.linalg.slogdet(equations)[1]
    loss += prior.log_determinant(edges) + held.determinant
    kernel = np.linalg.inv(prior.precision(edges))
    spread = expected.heights @ kernel @ expected.heights
    goal = MIDDLE * FACTOR ** REACHES[reach] * unit
    mean = kernel @ expected.heights * goal / spread
    given_sum = kernel - np.outer(kernel @ expected.heights, expected.heights @ kernel) / spread
    covariance = np.eye(count) + rows.T @ given_sum @ rows
    rest = y - rows.T @ mean
    wanted = count * np.log(rest @ np.linalg.solve(covariance, rest) / count)
    wanted += np.linalg.slogdet(covariance)[1] + REACHES[reach] ** 2
    assert loss == pytest.approx(wanted, abs=2e-2)
    response = np.linalg.solve(equations, seen)
    assert expected.heights @ response == pytest.approx(goal, abs=0.01 * spread**0.5)


def test_a_free_response_costs_as_much_as_the_farthest_reach() -> None:
    edges = np.array([0, 1, 2])
    held = ResponsePrior(reach=FREE).held(edges, Reach(0, np.ones(2), 1.0))
    assert not held.precision.any()
    assert not held.pull.any()
    assert (held.energy, held.determinant) == (0.0, max(REACHES) ** 2)


def test_a_step_of_noise_and_responses_at_once_is_better_than_turns() -> None:
    problem = Problem.of(of_noise())
    stems = problem.ideal_stems()
    fit = fit_output(problem, 0, stems)
    whole = Whitened.of(problem, 0, stems, fit.noise)
    assert whole.loss(fit.prior)[0] == pytest.approx(fit.loss)
    again = Whitened.of(problem, 0, stems, whole.noise_step(fit.prior, fit.rest))
    assert again.loss(fit.prior)[0] < fit.loss + 1.0  # at rest already: no step leads away


@pytest.mark.parametrize("seed", range(3))
def test_noise_alone_shows_the_process_where_the_controller_is_known(seed: int) -> None:
    record = of_noise(seed=seed)
    told = tunings(record)
    known = Problem.of(record, tunings=told)
    fit = ideal(known).fits[0]
    reach = known.reaches[0]
    assert reach is not None
    assert fit.prior.reach != FREE
    heights = np.diff(known.edges)
    gain = float(heights @ fit.responses[0]) * float(record.pv.std() / record.op.std())
    assert 0.5 < gain < 2.0  # true: 1


def test_fits_begin_from_several_reaches_only_where_one_is_expected() -> None:
    record = pi_loop(3.0, 1.0)
    assert len(beginnings(Problem.of(record), 0)) == 1
    begun = beginnings(Problem.of(record, tunings=tunings(record)), 0)
    assert len({prior.reach for prior in begun}) == len(begun) > 1
    assert FREE in {prior.reach for prior in begun}


def test_a_rate_that_takes_the_controller_for_the_process_sees_none() -> None:
    look = looks(pi_loop(0.0, 0.0), IdentificationOptions())[0]
    assert look.sees_process(0)
    fits = look.found.ideal.fits
    free = [dataclasses.replace(f, prior=ResponsePrior(reach=FREE)) for f in fits]
    turned = tuple(dataclasses.replace(f, responses=-f.responses) for f in free)
    far = dataclasses.replace(look.found.ideal, fits=tuple(free))
    found = dataclasses.replace(look.found, ideal=far)
    assert dataclasses.replace(look, found=found).sees_process(0)  # farther than it was tuned for
    backwards = dataclasses.replace(look.found.ideal, fits=turned)
    other = dataclasses.replace(look, found=dataclasses.replace(look.found, ideal=backwards))
    assert not other.sees_process(0)
    assert not dataclasses.replace(look, carries_news=False).sees_process(0)


def test_a_band_that_matters_is_above_what_is_harmless() -> None:
    problem = Problem.of(pi_loop(3.0, 1.0), tunings=tunings(pi_loop(3.0, 1.0)))
    held = accepted(problem, search(problem), 0, 0.95)
    assert held.band[0] > HARMLESS
    assert held.material_gain == pytest.approx(held.gain, abs=0.1)  # its grids go on by a hair


def first_order(gain: float, pole: float, taps: int = 200) -> FloatArray:
    """Return the impulse response of b q⁻¹ / (1 − a q⁻¹)."""
    return gain * (1.0 - pole) * pole ** np.arange(taps)


@pytest.mark.trial
@given(st.floats(0.05, 12.0), st.floats(2.0, 200.0), st.floats(0.3, 0.97), st.sampled_from([1, 2]))
def test_a_controller_holds_a_process_when_the_loop_of_both_comes_to_rest(
    gain: float, reset: float, pole: float, rate: int
) -> None:
    taps = first_order(1.0, pole)
    held = Tuning(0, gain, RESETS * reset * rate).holds(rate, 0.5, 2.0 * taps)
    # u = u₋ + K ((e − e₋) + e / T), e = −y and y = a y₋ + (1 − a) u₋ have this characteristic
    by = gain * (1.0 - pole)
    wanted = np.abs(np.roots([1.0, by * (1.0 + 1.0 / reset) - 1.0 - pole, pole - by])).max() < 1.0
    assert held is bool(wanted)


def test_no_controller_holds_a_process_of_the_other_sign() -> None:
    tuning = Tuning(0, 1.0, RESETS * 10.0)
    assert tuning.holds(1, 1.0, first_order(1.0, 0.9))
    assert not tuning.holds(1, 1.0, first_order(-1.0, 0.9))
    assert not Tuning(0, 40.0, RESETS * 10.0).holds(1, 1.0, first_order(1.0, 0.9))


def test_a_rate_speaks_of_what_the_controller_of_its_valve_holds() -> None:
    look = looks(pi_loop(3.0, 1.0), IdentificationOptions())[0]
    assert look.is_held(0, look.found.best)
    best = look.found.best
    fits = tuple(dataclasses.replace(fit, responses=60.0 * fit.responses) for fit in best.fits)
    wild = dataclasses.replace(best, fits=fits)
    other = dataclasses.replace(look, found=dataclasses.replace(look.found, best=wild))
    assert not other.is_held(0, other.found.best)
    assert not look.is_held(0, wild)
    unknown = dataclasses.replace(other.problem, tunings=())
    assert dataclasses.replace(other, problem=unknown).is_held(0, other.found.best)
