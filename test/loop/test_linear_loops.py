import numpy as np
import pytest
from known_loops import DELAY, A, B, Kind, known

from stiction_ros.identification.closed_loop.repeated_runs import law_of
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.loop.linear_loops import Controllers, Process, Start, Valves, ringing, run_loop
from stiction_ros.loop.repeated_loops import Equations, RecoveredControl, Stems, run_again

PAST = 8
PROCESS = Process(
    np.array([A]), np.array([[B]]), np.array([[DELAY]]), np.array([20.0 * (1.0 + sum(A))])
)


HE = (0.0, 0.0, 1.0)


def controllers(gain: float = 1.0, reset: float = 0.1, lag: int = 0) -> Controllers:
    free, tuning = (np.array([-np.inf]), np.array([np.inf])), np.array([[gain, reset, 0.0]])
    return Controllers(np.array([0]), np.array([lag]), np.zeros(1), *free, tuning)


def run(
    controllers: Controllers,
    friction: tuple[float, float],
    sp: np.ndarray,
    load: np.ndarray | None = None,
    law: tuple[float, float, float] = HE,
) -> tuple[np.ndarray, np.ndarray]:
    stem = np.full((PAST, 1), -0.9 * friction[0])
    start = Start(np.full((PAST, 1), 20.0), stem, np.zeros(1))
    valves = Valves(np.array([friction]), np.array([law]))
    outside = sp, np.zeros_like(sp) if load is None else load
    return run_loop(PROCESS, controllers, valves, start, outside)


@pytest.mark.parametrize("friction", [(0.0, 0.0), (3.0, 1.0), (2.0, 2.0)])
@pytest.mark.parametrize("lag", [0, 1, 2])
@pytest.mark.parametrize("law", ["he", "kano", "xch", "choudhury", "semi_physical"])
def test_the_kernel_does_what_a_plain_loop_does(
    friction: tuple[float, float], lag: int, law: str
) -> None:
    load = np.random.default_rng(1).standard_normal(300).cumsum() / 10.0
    kind = Kind(friction, noise=0.0, lag=lag, law=law)
    plain = known(kind, samples=300, load=load)
    sp = np.full((PAST + 300, 1), 20.0)
    outside = np.concatenate([np.zeros(PAST), load])[:, None]
    code = law_of(plain.found.valves[0])
    op, pv = run(controllers(1.0, 1.0 / 8.0, lag), friction, sp, outside, code)
    near = 1e-9 if law != "semi_physical" else 1e-5  # a stem that remembers every last digit
    assert op[:, 0] + 50.0 == pytest.approx(plain.record.op[:, 0], abs=near)
    assert pv[:, 0] == pytest.approx(plain.record.pv[:, 0], abs=near)


@pytest.mark.parametrize("smoothing", [0.0, 0.5])
@pytest.mark.parametrize("lag", [0, 2])
@pytest.mark.parametrize("law", ["he", "xch", "kano"])
def test_a_loop_under_any_controller_moves_as_in_the_kernel(
    smoothing: float, lag: int, law: str
) -> None:
    friction, tuning = (3.0, 1.0), np.array([[1.0, 1.0 / 8.0, 0.2]])
    ways = controllers(lag=lag)._replace(smoothing=np.array([smoothing]), tuning=tuning)
    sp = np.full((PAST + 300, 1), 20.0)
    sp[PAST + 5 :] = 26.0
    code = law_of(known(Kind(friction, law=law), samples=50).found.valves[0])
    _, pv = run(ways, friction, sp, law=code)
    outside = np.full((1, 1, PAST + 300), PROCESS.bias[0])
    equations = Equations(np.array([[A]]), np.array([[[B]]]), PROCESS.delay, outside)
    op, rest = np.zeros((PAST + 300, 1)), np.full((PAST + 300, 1), 20.0)
    stems, units = np.full((1, 1, PAST), -0.9 * friction[0]), (np.zeros(1), np.ones(1))
    laws = [[behaviour_of(law, friction, {})]]
    valves = Stems(laws, op[:PAST], stems[0, :, 0], units, 1.0)
    control = RecoveredControl(ways, tuning[None], sp, rest[:PAST])
    again, _ = run_again(equations, stems, valves, control, (op, rest))
    assert again[0] == pytest.approx(pv, abs=1e-9)


def test_a_run_that_grows_without_end_is_infinite() -> None:
    sp = np.full((PAST + 4000, 1), 20.0)
    sp[PAST + 5 :] = 21.0
    op, pv = run(controllers(9.0, 3.0), (0.0, 0.0), sp)
    assert np.isinf(op[-1, 0])
    assert np.isinf(pv[-1, 0])


def test_op_stays_within_its_limits() -> None:
    limited = controllers()._replace(low=np.array([-2.0]), high=np.array([1.0]))
    sp = np.full((PAST + 300, 1), 20.0)
    sp[PAST + 5 :] = 23.0
    op, _ = run(limited, (1.0, 0.5), sp)
    assert op.max() == 1.0
    assert op.min() >= -2.0


def test_a_valve_without_a_controller_keeps_its_op() -> None:
    alone = controllers()._replace(output=np.array([-1]))
    op, pv = run(alone, (0.0, 0.0), np.full((PAST + 50, 1), 25.0))
    assert not op.any()
    assert pv == pytest.approx(20.0)


@pytest.mark.parametrize("gain", [2.0, 2.6])
@pytest.mark.parametrize("lag", [0, 1])
def test_poles_ring_as_the_simulated_loop_does(gain: float, lag: int) -> None:
    found = ringing(PROCESS, 0, 0, np.array([gain, gain / 10.0, 0.0]), lag)[0]
    sp = np.full((PAST + 600, 1), 20.0)
    sp[PAST + 5 :] = 21.0
    _, pv = run(controllers(gain, gain / 10.0, lag), (0.0, 0.0), sp)
    apart = pv[40:, 0] - 21.0
    peaks = np.flatnonzero((apart[1:-1] > apart[:-2]) & (apart[1:-1] > apart[2:]))[:5] + 1
    assert np.mean(np.diff(peaks)) == pytest.approx(found.period, rel=0.08)
    growth = (apart[peaks[-1]] / apart[peaks[0]]) ** (1.0 / (len(peaks) - 1))
    assert growth == pytest.approx(found.growth, abs=0.05)
