import numpy as np
import pytest

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.gain.answering import LAGS, Answering

DEAD_TIME = 3


def answered(stem: FloatArray, outside: FloatArray, pole: float) -> FloatArray:
    """Return y_k = pole y_{k-1} + .2 χ_{k-1-3} + what comes from outside."""
    y = np.zeros(len(stem))
    for k in range(DEAD_TIME + 1, len(y)):
        y[k] = pole * y[k - 1] + 0.2 * stem[k - 1 - DEAD_TIME] + outside[k]
    return y


@pytest.mark.parametrize("pole", [0.8, 1.0])
def test_process_and_what_comes_from_outside_are_told_apart(pole: float) -> None:
    random = np.random.default_rng(2)
    stem = np.repeat(random.standard_normal(150), 10)
    outside = 0.05 * random.standard_normal(len(stem))
    pv = answered(stem, outside, pole)
    answering = Answering.of(pv, stem[:, None], np.array([DEAD_TIME]), np.array([]))
    answer = answering.fit(stem[:, None])
    a, b = answer.split(answer.mean)
    assert a.shape == (LAGS,)
    assert b.shape == (1, LAGS)
    left = answering.left(stem[:, None], answer.mean)[answering.past :]
    assert np.corrcoef(left, outside[answering.past :])[0, 1] > 0.95
    response = _response(a, b[0], 20)
    assert response == pytest.approx(_response(np.array([-pole]), np.eye(4)[3] * 0.2, 20), abs=0.1)


def test_a_wave_from_outside_is_none_of_the_process() -> None:
    random = np.random.default_rng(3)
    time = np.arange(1500)
    stem = np.repeat(random.standard_normal(150), 10)
    wave = 0.5 * np.sin(2.0 * np.pi * time / 40.0)
    pv = answered(stem, 0.05 * random.standard_normal(1500), 0.8) + wave
    beside = Answering.of(pv, stem[:, None], np.array([DEAD_TIME]), np.array([1.0 / 40.0]))
    assert beside.wave.shape == (1500, 2)
    quiet = answered(stem, 0.05 * random.standard_normal(1500), 0.8)
    plain = Answering.of(quiet, stem[:, None], np.array([DEAD_TIME]), np.array([1.0 / 40.0]))
    assert plain.wave.shape == (1500, 0)


def test_drawn_equations_lie_about_the_likeliest() -> None:
    random = np.random.default_rng(4)
    stem = np.repeat(random.standard_normal(100), 8)[:, None]
    pv = answered(stem[:, 0], 0.05 * random.standard_normal(800), 0.8)
    answer = Answering.of(pv, stem, np.array([DEAD_TIME]), np.array([])).fit(stem)
    drawn = np.array([answer.drawn(random) for _ in range(400)])
    spread = np.sqrt(answer.variance * np.diag(np.linalg.inv(answer.factor @ answer.factor.T)))
    assert np.all(np.abs(drawn.mean(axis=0) - answer.mean) < 5.0 * spread / np.sqrt(400))
    assert np.allclose(drawn.std(axis=0), spread, rtol=0.25)


def _response(a: FloatArray, b: FloatArray, count: int) -> FloatArray:
    """Return the impulse response of an equation."""
    y = np.zeros(count)
    for k in range(count):
        y[k] = b[k] if k < len(b) else 0.0
        for lag in range(1, min(len(a), k) + 1):
            y[k] -= a[lag - 1] * y[k - lag]
    return y
