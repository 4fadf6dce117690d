"""Simulated closed loops with known friction for the tests of identification."""

import numpy as np

from stiction_ros.effects import Behaviour, FloatArray, HeStiction
from stiction_ros.records.record import Record

A = (-2.0914, 1.3749, -0.2725)
B = (0.002445, 0.007181, 0.001278)
DELAY = 5


def example1(
    seed: int,
    noise: str = "measurement",
    friction: tuple[float, float] = (5.0, 2.0),
    samples: int = 2500,
    gain: float = 2.0,
    integral_time: float = 20.0,
    disturbance: FloatArray | None = None,
    valve: Behaviour | None = None,
) -> Record:
    """Process (18) under PI control with set-point steps; σ = 0.01 on PV or in (18).

    The valve follows He's law with ``friction`` unless ``valve`` says otherwise.
    """
    values = 0.01 * np.random.default_rng(seed).standard_normal(samples)
    law = valve or HeStiction(*friction)
    memory = law.rest(0.0)
    ideal = valve is None and max(friction) == 0.0
    set_points = np.array([0.0, 2.0, 2.0, -1.0, -1.0, 3.0, 1.0, 1.0])
    sp = set_points[np.arange(samples) * 8 // samples]
    y, pv, op, stem = (np.zeros(samples + 10) for _ in range(4))  # the last ten stay zero
    command = error = 0.0
    for k in range(samples):
        y[k] = sum(-A[i] * y[k - i - 1] + B[i] * stem[k - i - 1 - DELAY] for i in range(3))
        y[k] += values[k] if noise == "equation" else 0.0
        pv[k] = y[k] + (values[k] if noise == "measurement" else 0.0)
        pv[k] += 0.0 if disturbance is None else disturbance[k]
        change = sp[k] - pv[k] - error
        error += change
        command += gain * (change + error / integral_time)
        op[k] = command
        memory, stem[k] = law.step(memory, float(command), float(k))
        stem[k] = command if ideal else stem[k]
    columns = (part[:samples, None] for part in (op, pv, sp, stem))
    return Record("example1", 1.0, ("V1",), ("PV1",), *columns)


def compensated(seed: int, friction: tuple[float, float] = (5.0, 2.0)) -> Record:
    """Process (18) after compensation: the valve stays with e = 0 or slips by a wide margin."""
    generator = np.random.default_rng(seed)
    samples, (f_s, f_d) = 2500, friction
    y, op, stem = np.zeros(samples + 10), np.zeros(samples + 10), np.zeros(samples + 10)
    position = 0.0
    for k in range(samples):
        y[k] = sum(-A[i] * y[k - i - 1] + B[i] * stem[k - i - 1 - DELAY] for i in range(3))
        op[k] = position
        if k % 60 == 20:
            sign = -1.0 if position > 0.0 else 1.0
            move = sign * (1.3 * f_s - f_d + 3.0 * generator.random())
            position += move
            op[k] = position + sign * f_d
        stem[k] = position
    pv = y[:samples] + 0.01 * generator.standard_normal(samples)
    columns = (op[:samples, None], pv[:, None], None, stem[:samples, None])
    return Record("compensated", 1.0, ("V1",), ("PV1",), *columns)


STATE = np.array(
    [
        [0.8987, -0.0035, -0.0204, 0.0099, 0.0065],
        [-0.0064, 0.9038, -0.0224, -0.0269, -0.0062],
        [0.0307, 0.0136, 0.9801, -0.0183, 0.0365],
        [-0.0031, 0.0013, -0.0188, 0.8319, -0.1507],
        [0.0038, -0.0018, 0.0020, 0.0127, 0.8985],
    ]
)
INPUT = np.array(
    [
        [-2.7524e-3, 1.7493e-4],
        [1.1984e-3, -2.5430e-3],
        [6.4088e-4, 2.7857e-4],
        [-6.1987e-5, 1.3907e-6],
        [1.0405e-4, -3.4249e-5],
    ]
)
OUTPUT = np.array(
    [[-0.9168, -0.0684, -0.0777, 0.0360, 0.0327], [1.1241, -11.0733, -0.8478, -1.5393, -0.4602]]
)
MOVES = {20: (7.7, 42.324), 140: (7.7, 45.0), 260: (7.62, 45.0), 380: (7.35, 41.0)}


def tank(seed: int, static: float = 8.0, dynamic: float = 1.0, samples: int = 620) -> Record:
    """The linear tank (A.3) about (50, 50) % under two PI controllers, valve 1 sticky."""
    generator = np.random.default_rng(seed)
    valve = HeStiction(static, dynamic)
    rest = np.array([7.5, 42.324])
    state, set_point = np.zeros(5), rest.copy()
    op, error, position = np.array([50.0, 50.0]), np.zeros(2), 50.0
    rows = []
    for k in range(samples):
        set_point = np.array(MOVES.get(k, set_point))
        pv = rest + OUTPUT @ state + 0.01 * generator.standard_normal(2)
        change = set_point - pv - error
        error = error + change
        op = np.clip(op + np.array([45.0, 1.5]) * (change + error / [14.0, 12.0]), 0.0, 100.0)
        position = float(valve.step(position, float(op[0]))[1])
        stem = np.array([position, op[1]])
        rows.append(np.concatenate([op, pv, set_point, stem]))
        state = STATE @ state + INPUT @ (stem - 50.0)
    table = np.array(rows)
    parts = (table[:, i : i + 2] for i in (0, 2, 4, 6))
    return Record("tank", 60.0, ("V1", "V2"), ("C", "T"), *parts)
