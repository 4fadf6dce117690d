import dataclasses

import numpy as np
import pytest
from evidence_loops import FloatArray, pi_loop

from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.evidence.candidate import ideal
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.outside_waves import outside_wave
from stiction_ros.identification.evidence.rates import looks
from stiction_ros.identification.evidence.search import better, search
from stiction_ros.records import Record
from stiction_ros.records.parts import longest_part
from stiction_studies.field import field_loop

PERIOD = 43.7


def turns(samples: int, period: float = PERIOD) -> FloatArray:
    return np.mod(np.arange(samples) / period, 1.0)


def waved(record: Record, size: float, shape: str = "square", period: float = PERIOD) -> Record:
    """Return the record with a wave in PV that the controller has not answered."""
    at = turns(len(record), period)
    wave = {
        "square": np.where(at < 0.5, 1.0, -1.0),
        "triangle": 1.0 - 4.0 * np.abs(at - 0.5),
        "sine": np.sin(2.0 * np.pi * at),
    }[shape]
    return dataclasses.replace(record, pv=record.pv + size * wave[:, None])


@pytest.mark.parametrize("shape", ["square", "triangle", "sine"])
@pytest.mark.parametrize("period", [17.3, PERIOD, 110.0])
def test_a_wave_is_found_with_its_period(shape: str, period: float) -> None:
    record = waved(pi_loop(0.0, 0.0, samples=1200), 0.2, shape, period)
    found = outside_wave([Problem.of(record)], 0)
    assert found is not None
    assert 1.0 / found.frequency == pytest.approx(period, abs=0.1 * period**2 / len(record))
    assert found.harmonics >= {"square": 3, "triangle": 1, "sine": 1}[shape]


@pytest.mark.parametrize("friction", [(0.0, 0.0), (3.0, 1.0)])
def test_where_there_is_none_none_is_found(friction: tuple[float, float]) -> None:
    assert outside_wave([Problem.of(pi_loop(*friction, samples=1200))], 0) is None


def test_a_wave_is_taken_out_and_the_process_stays() -> None:
    plain = pi_loop(0.0, 0.0, samples=1200)
    problem = Problem.of(waved(plain, 0.2))
    wave = outside_wave([problem], 0)
    assert wave is not None
    alone, beside = ideal(problem), ideal(problem.with_waves([wave.lines]))
    assert beside.loss < alone.loss - 300.0
    true = Problem.of(plain)
    scale = true.pv.std() * plain.pv.std() / waved(plain, 0.2).pv.std()
    rests = [one.fits[0].rest[true.first :].std() for one in (beside, ideal(true))]
    assert rests[0] == pytest.approx(rests[1] * scale, rel=0.1)


def test_no_waves_change_nothing() -> None:
    problem = Problem.of(pi_loop(3.0, 1.0))
    assert ideal(problem.with_waves([()])).loss == ideal(problem).loss


def test_lines_that_the_rows_are_too_slow_for_are_left_out() -> None:
    problem = Problem.of(pi_loop(3.0, 1.0), rate=4)
    lines = problem.with_waves([(0.05, 0.09, 0.11, 0.3)]).lines
    assert lines == ((0.05, 0.09),)


@pytest.mark.trial
def test_friction_gains_little_beside_the_wave_that_it_stood_for() -> None:
    """A healthy valve and a square load, of a simulator that shares nothing with the search."""
    record = longest_part([field_loop(66).record])
    alone = search(Problem.of(record, rate=2))
    seen = looks(record, IdentificationOptions())
    assert alone.ideal.loss - alone.best.loss > seen[1].price
    assert all(look.beyond_price(0) < 0.0 for look in seen[:3])


@pytest.mark.trial
def test_friction_is_found_beside_a_wave() -> None:
    record = waved(pi_loop(3.0, 1.0, samples=1200), 0.2)
    seen = looks(record, IdentificationOptions())
    assert all(look.beyond_price(0) > 0.0 for look in seen[:2])
    assert seen[0].wave_gain is not None
    assert seen[0].found.best.friction[0] * seen[0].problem.span == pytest.approx(
        [3.0, 1.0], abs=0.2
    )


def test_the_better_of_two_searches_keeps_the_lesser_rivals() -> None:
    problem = Problem.of(pi_loop(3.0, 1.0, samples=300))
    one = search(problem)
    other = dataclasses.replace(one, best=one.without[0], without=(one.best,))
    both = better(one, other)
    assert both.best is one.best
    assert both.without == (one.best,)
