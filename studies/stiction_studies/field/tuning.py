"""How plants answer steps, and controllers tuned by what they answer."""

import dataclasses

import numpy as np

from stiction_studies.field.kernels import FloatArray
from stiction_studies.field.plants import Process
from stiction_studies.field.simulation import FRICTIONLESS, Clock, Controller, Loop, Signals, run

SETTLING = 4.0  # slowest times until a plant has settled
RESOLUTION = 300  # steps of integration in the slowest time, at least
STEP = 2.0  # %: of the valve in a step test; small, so that it is linear
LOAD_STEP = 0.02  # of the load
HORIZON = 40.0  # times of the loop that a closed loop is watched for
PUSH = 0.5  # %: load by which a closed loop is tried, counted in the valve
LEFT = 0.02  # of its first swing, that a well damped loop leaves
LEAST, MOST = 0.05, 1000.0  # factors of the gain that are tried
HALVINGS = 8  # of the interval in which the ultimate gain lies


@dataclasses.dataclass(frozen=True)
class Answer:
    """How a plant answers, as a first-order lag with dead time or as an integrator with it.

    Attributes:
        gain: engineering units per % of the valve; per % and second of an integrator.
        lag: time constant, s; infinite for an integrator.
        dead_time: s.
        load: % of the valve that a load of 1 counts for.
        state: of the plant at rest, read-only.
    """

    gain: float
    lag: float
    dead_time: float
    load: float
    state: FloatArray


def step_test(process: Process) -> Answer:
    """Settle a plant, step its valve and its load, and read the answers.

    Lag and dead time are read where 35.3 % and 85.3 % of the answer have come.

    References:
        K. R. Sundaresan, P. R. Krishnaswamy: Estimation of time delay, time constant
        parameters in time, frequency and Laplace domains. Can. J. Chem. Eng. 56, 1978, 257-262.
    """
    slowest = process.slowest
    if process.integrating:
        slowest = 10.0 * (process.fastest + process.dead_time)
    step = min(process.fastest, slowest / RESOLUTION)
    count = int(SETTLING * slowest / step)
    still = Loop(
        process, FRICTIONLESS, Controller(1.0, 1.0), Clock(step, 1, 1), process.guess.copy()
    )
    settled = run(still, Signals.quiet(3 * count, 0.0, 0.0)).state
    settled.flags.writeable = False
    rest = dataclasses.replace(still, state=settled)
    start = rest.rest
    moved = Signals.quiet(count, 0.0, STEP)
    answer = run(rest, moved).clean - start
    loaded = Signals.quiet(count, 0.0, 0.0)
    loaded = dataclasses.replace(loaded, load=np.full(count, LOAD_STEP))
    by_load = float((run(rest, loaded).clean - start)[-1]) / LOAD_STEP
    end = float(answer[-1])
    load = by_load / (end / STEP)
    if process.integrating:
        slope = (answer[-1] - answer[count // 2]) / (step * (count - 1 - count // 2))
        late = (count - 1) * step - end / slope
        return Answer(slope / STEP, np.inf, max(late, 0.0), load, settled)
    share = np.abs(answer) / abs(end)
    first, second = (float(np.argmax(share >= level)) * step for level in (0.353, 0.853))
    lag = 0.67 * (second - first)
    return Answer(end / STEP, lag, max(1.3 * first - 0.29 * second, 0.0), load, settled)


@dataclasses.dataclass(frozen=True)
class Wish:
    """How a controller shall be tuned.

    Attributes:
        speed: closed-loop time over the effective dead time.
        share: closed-loop time over the plant's lag, at least; over the time in which 1 % of
            the valve makes one unit of an integrator's PV.
        derivative: T_d over the effective dead time; 0 is PI.
        filtering: PV filter over the effective dead time.
    """

    speed: float
    share: float
    derivative: float = 0.0
    filtering: float = 0.0


def late(answer: Answer, process: Process, scan: float) -> float:
    """Return the dead time with half a scan and half an analyser's cycle, s."""
    return answer.dead_time + 0.5 * scan + 0.5 * process.cycle


def closed_loop_time(answer: Answer, delay: float, wish: Wish) -> float:
    """Return the time constant wished for the closed loop, s."""
    lag = 1.0 / abs(answer.gain) if np.isinf(answer.lag) else answer.lag
    return max(wish.speed * delay, wish.share * lag)


def tuned(answer: Answer, delay: float, wish: Wish) -> Controller:
    r"""Return the controller by the SIMC rules.

    .. math::
        K_c = \tau / (K (\tau_c + \theta)), \quad T_i = \min(\tau, 4 (\tau_c + \theta))

    References:
        S. Skogestad: Simple analytic rules for model reduction and PID controller tuning. J.
        Process Control 13, 2003, 291-309.
    """
    filtering = wish.filtering * delay
    delay += filtering
    slow = closed_loop_time(answer, delay, wish) + delay
    per_lag = answer.gain if np.isinf(answer.lag) else answer.gain / answer.lag
    derivative = wish.derivative * delay
    return Controller(
        gain=1.0 / (per_lag * slow),
        integral=min(answer.lag, 4.0 * slow),
        derivative=derivative,
        pv_filter=filtering,
        derivative_filter=0.2 * derivative,
    )


def calm(loop: Loop, answer: Answer, time: float) -> Loop:
    """Return the loop made slower until it is well damped without friction.

    Its gain is lowered; of an integrating plant, which swings at low gains, so is its reset.

    Args:
        loop: as tuned.
        answer: of its plant.
        time: of the closed loop, s.
    """
    slower, factor = loop, 1.0
    while swing_left(slower, answer, time / factor, 1.0) > LEFT and factor > LEAST:
        factor *= 0.75
        controller = loop.controller.scaled(factor)
        if loop.process.integrating:
            controller = dataclasses.replace(controller, integral=controller.integral / factor)
        slower = dataclasses.replace(loop, controller=controller)
    return slower


def ultimate_factor(loop: Loop, answer: Answer, time: float) -> float:
    """Return by which factor of its gain the loop without friction begins to swing for ever."""
    low, high = 1.0, 1.6
    while swing_left(loop, answer, time, high) < 1.0 and high < MOST:
        low, high = high, 1.6 * high
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low * high))
        if swing_left(loop, answer, time, middle) < 1.0:
            low = middle
        else:
            high = middle
    return low


def swing_left(loop: Loop, answer: Answer, time: float, factor: float) -> float:
    """Return how much OP still moves late after a small load, over how much it did early.

    The loop has no friction and ``factor`` times its gain; 1 is a swing that neither grows nor
    falls.
    """
    count = int(HORIZON * time / loop.clock.step)
    free = dataclasses.replace(
        loop, valve=loop.valve.without_friction(), controller=loop.controller.scaled(factor)
    )
    signals = Signals.quiet(count, loop.rest)
    load = np.full(count, PUSH / answer.load)
    op = run(free, dataclasses.replace(signals, load=load)).op
    travel = np.abs(np.diff(op)).reshape(-1)
    quarter = count // 4
    early, end = float(travel[:quarter].sum()), float(travel[-quarter:].sum())
    return end / early if early > 0.0 else 0.0
