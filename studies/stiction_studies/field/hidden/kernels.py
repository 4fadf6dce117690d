"""The compiled loop with everything that can be hidden in it.

The stem's friction is stepped by the kernels of the field, with which this file shares a folder.
"""

import math

import numpy as np

from stiction_ros.compiled import compiled
from stiction_studies.field.kernels import FlagArray, FloatArray, stem_step

SMOOTH, EXPONENTIAL, QUADRATIC, IN_A_LINE = range(4)
NO_FRICTION = -1
VELOCITY, WINDING_UP = range(2)


@compiled
def curved(kind: int, curve: float, stem: float) -> float:
    """Return the flow behind a stem, %: a curve through (0, 0) and (100, 100).

    Exponential: 100 (R^x − 1)/(R − 1) with ln R = ``curve``; quadratic: (1 − q) x + q x² with
    q = ``curve``; in a line: x / √(s + (1 − s) x²), a linear valve that keeps the share s = 1 −
    ``curve`` of the pressure drop of its line when it is open; x is the stem over 100.

    References:
        W. L. Luyben: Process Modeling, Simulation, and Control for Chemical Engineers. 2nd ed.,
        McGraw-Hill 1990, section 7.1.
    """
    if kind == EXPONENTIAL:
        return 100.0 * (math.exp(curve * stem / 100.0) - 1.0) / (math.exp(curve) - 1.0)
    if kind == QUADRATIC:
        x = stem / 100.0
        return 100.0 * ((1.0 - curve) * x + curve * x * x)
    if kind == IN_A_LINE:
        return stem / math.sqrt(1.0 - curve + curve * (stem / 100.0) ** 2)
    return stem


@compiled
def run_hidden(
    valve: tuple[int, FloatArray, FloatArray, FloatArray],
    plant: tuple[FloatArray, FloatArray, FloatArray, int, FloatArray],
    sensor: FloatArray,
    controller: FloatArray,
    signals: FloatArray,
    load: FloatArray,
) -> FloatArray:
    """Run a loop from rest; the states of stem and plant go on in place.

    Args:
        valve: law of friction (:data:`NO_FRICTION` for none), its parameters, the stem's state,
            and what follows: slew (%/s), lag (s), low and high end (%), curve's kind and
            figure, offset (%).
        plant: matrices of one fine step in deviations from rest, shapes (n, n), (n,), (n,),
            dead time in fine steps, state.
        sensor: lag (s), low and high end, first row that is frozen and the one behind the
            last, quantum; engineering units.
        controller: K_c, T_i (s), low, high (%), :data:`VELOCITY` or :data:`WINDING_UP`, samples
            of a scan, sample time (s), OP and PV at rest.
        signals: rows set-point, what adds to the output, what adds to the reading, whether the
            loop is in manual, OP then; shape (5, K).
        load: what adds to the stem at each fine step, %, shape (K S,).

    Returns:
        Rows OP, PV as recorded, stem at the end of the sample, PV before the sensor,
        shape (4, K).
    """
    law, friction, stem_state, chain = valve
    step_a, step_b, c, dead, x = plant
    slew, lag, low, high, kind, curve, offset = chain
    sensor_lag, least, most, frozen, thawed, quantum = sensor
    gain, integral, op_low, op_high, form, scan, sample_time, op0, pv0 = controller
    count = signals.shape[1]
    fine = len(load) // count
    h = sample_time / fine
    interval = scan * sample_time
    valve_share = 1.0 - math.exp(-h / lag) if lag > 0.0 else 1.0
    sensor_share = 1.0 - math.exp(-h / sensor_lag) if sensor_lag > 0.0 else 1.0
    out = np.empty((4, count))
    waiting = np.zeros(dead + 1)
    following = np.empty(len(x))
    op = u = followed = stem_state[0]
    shown = pv0
    summed, before, last = 0.0, 0.0, pv0
    for k in range(count):
        clean = pv0 + signals[1, k]
        for i in range(len(x)):
            clean += c[i] * x[i]
        if k == 0 or sensor_lag <= 0.0:
            shown = clean
        reading = min(max(shown + signals[2, k], least), most)
        if quantum > 0.0:
            reading = round(reading / quantum) * quantum
        if frozen <= k < thawed:
            reading = last
        last = reading
        if signals[3, k] > 0.0:
            op = u = signals[4, k]
            summed = 0.0
        elif k % scan == 0:
            error = signals[0, k] - reading
            if form == WINDING_UP:
                summed += interval / integral * error
                u = op0 + gain * (error + summed)
            else:
                u = op + gain * (error - before + interval / integral * error)
            op = min(max(u, op_low), op_high)
            before = error
        out[0, k], out[1, k], out[3, k] = op, reading, clean
        for j in range(fine):
            stem = op if law == NO_FRICTION else stem_step(law, friction, stem_state, op, h)
            followed += valve_share * (
                min(max(stem, _slowed(followed, -slew, h)), _slowed(followed, slew, h)) - followed
            )
            out[2, k] = min(max(followed, low), high)
            at = (k * fine + j) % (dead + 1)
            waiting[at] = curved(int(kind), curve, out[2, k]) + offset + load[k * fine + j] - op0
            arriving = waiting[(at + 1) % (dead + 1)]
            for i in range(len(x)):
                following[i] = step_b[i] * arriving
                for m in range(len(x)):
                    following[i] += step_a[i, m] * x[m]
            x[:] = following
            clean = pv0 + signals[1, k]
            for i in range(len(x)):
                clean += c[i] * x[i]
            shown += sensor_share * (clean - shown)
    return out


@compiled
def _slowed(position: float, rate: float, h: float) -> float:
    return position + rate * h


@compiled
def whitened(values: FloatArray, gains: FloatArray, f: FloatArray, c: FloatArray) -> FloatArray:
    """Return what a Kalman filter of given gains does not foresee of each column, shape (N, m).

    Args:
        values: columns, shape (N, m).
        gains: of the filter at each sample, shape (N, d).
        f: transition, shape (d, d).
        c: what is measured of the state, shape (d,).
    """
    count, columns = values.shape
    d = len(c)
    left = np.empty((count, columns))
    state = np.empty(d)
    after = np.empty(d)
    for column in range(columns):
        state[:] = 0.0
        for k in range(count):
            foreseen = 0.0
            for i in range(d):
                foreseen += c[i] * state[i]
            e = values[k, column] - foreseen
            left[k, column] = e
            for i in range(d):
                state[i] += gains[k, i] * e
            for i in range(d):
                after[i] = 0.0
                for m in range(d):
                    after[i] += f[i, m] * state[m]
            state[:] = after
    return left


@compiled
def kalman_gains(
    f: FloatArray, q: FloatArray, c: FloatArray, white: float, start: FloatArray, seen: FlagArray
) -> tuple[FloatArray, FloatArray]:
    """Return a filter's gains, shape (N, d), and variances of what it does not foresee, (N,).

    Samples that are not ``seen`` are gone over without a correction.
    """
    count, d = len(seen), len(c)
    p = start.copy()
    gains = np.zeros((count, d))
    spread = np.ones(count)
    for k in range(count):
        if seen[k]:
            pc = p @ c
            spread[k] = float(c @ pc) + white
            gains[k] = pc / spread[k]
            p = p - np.outer(gains[k], pc)
        p = f @ p @ f.T + q
        p = 0.5 * (p + p.T)
    return gains, spread
