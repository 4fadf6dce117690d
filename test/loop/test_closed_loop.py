import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.loop import (
    LoopModel,
    Measurement,
    PiController,
    PiTuning,
    SetPoints,
    simulate_closed_loop,
)

MODEL = LoopModel.load(find_config("example1.loop.yaml"))
MOVES = SetPoints.load(find_config("siso.set_points.yaml"), ("PV1",))
LIMITS = (0.0, 100.0)


def measured(pv: float) -> Measurement:
    return Measurement(0.0, np.array([pv]), np.array([pv]), np.zeros(0))


def pi(gain: float = 0.5, limits: tuple[float, float] = LIMITS) -> PiController:
    return PiController(PiTuning(gain, 20.0), 1.0, 50.0, limits)


@pytest.mark.parametrize("gain", [0.5, -2.0])
def test_pi_is_its_velocity_form(gain: float) -> None:
    controller, random = pi(gain), np.random.default_rng(2)
    u, before = 50.0, None
    for _ in range(200):
        pv, sp = random.normal(50.0, 3.0), random.normal(50.0, 3.0)
        e = sp - pv
        u += gain * ((e - (e if before is None else before)) + 1.0 / 20.0 * e)
        u = min(max(u, 0.0), 100.0)
        before = e
        assert controller(measured(pv), np.array([sp])) == pytest.approx([u], abs=1e-12)


def test_pi_does_not_wind_up() -> None:
    controller = pi(limits=(40.0, 60.0))
    for _ in range(500):
        controller(measured(0.0), np.array([50.0]))
    assert controller(measured(50.0), np.array([50.0]))[0] < 60.0


def test_the_sticky_loop_is_its_equations() -> None:
    """He's valve, (18) with delay 5 and output noise, the PI: all written out."""
    n, seed = 300, 5
    run = simulate_closed_loop(MODEL, pi(), MOVES, n, seed)
    y, op, pv = np.zeros(n), run.record.op[:, 0], run.record.pv[:, 0]
    stem, u, before = np.zeros(n), 50.0, None
    at = 50.0
    for k in range(n):
        for i, a in enumerate((-2.0914, 1.3749, -0.2725), start=1):
            y[k] -= a * (y[k - i] if k >= i else 0.0)
        for i, b in enumerate((0.002445, 0.007181, 0.001278), start=1):
            y[k] += b * (stem[k - i - 5] - 50.0 if k - i - 5 >= 0 else 0.0)
        assert run.pv_clean[k, 0] == pytest.approx(50.0 + y[k], abs=1e-9)
        e = MOVES.at(float(k))[0] - pv[k]
        u += 0.5 * ((e - (e if before is None else before)) + e / 20.0)
        u, before = min(max(u, 0.0), 100.0), e
        assert op[k] == pytest.approx(u, abs=1e-12)
        if op[k] - at > 5.0:
            at = op[k] - 2.0
        elif op[k] - at < -5.0:
            at = op[k] + 2.0
        stem[k] = at
    assert run.record.stem is not None
    assert np.array_equal(run.record.stem[:, 0], stem)


def test_the_noise_has_the_stated_size() -> None:
    run = simulate_closed_loop(MODEL, pi(), MOVES, 1500, 5)
    assert np.std(run.record.pv - run.pv_clean) == pytest.approx(0.01, rel=0.08)


def test_the_same_seed_gives_the_same_run() -> None:
    one, two = (simulate_closed_loop(MODEL, pi(), MOVES, 200, 8).record for _ in range(2))
    assert np.array_equal(one.op, two.op)
    assert np.array_equal(one.pv, two.pv)


def test_a_shorter_run_is_the_beginning_of_a_longer_one() -> None:
    long, short = (simulate_closed_loop(MODEL, pi(), MOVES, n, 8).record for n in (200, 90))
    assert np.array_equal(long.pv[:90], short.pv)


def test_the_record_names_its_signals() -> None:
    record = simulate_closed_loop(MODEL, pi(), MOVES, 60, 8).record
    assert (record.valves, record.outputs, record.sample_time) == (("V1",), ("PV1",), 1.0)
    assert record.sp is not None
    assert record.sp[[49, 50], 0].tolist() == [50.0, 54.0]


def test_progress_counts_up() -> None:
    seen: list[int] = []
    simulate_closed_loop(MODEL, pi(), MOVES, 500, 8, seen.append)
    assert seen == sorted(seen)
    assert 90 <= len(seen) <= 110
