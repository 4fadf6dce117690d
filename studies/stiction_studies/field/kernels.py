"""The compiled loop: valve, plant and controller, all in one file so that none of it grows stale.

States and parameters are flat arrays; :mod:`.valves`, :mod:`.plants` and :mod:`.simulation` say
what stands where. Valves and plants are chosen by the numbers below, here and nowhere else.
"""

import math

import numpy as np
from numpy.typing import NDArray

from stiction_ros.compiled import compiled

FloatArray = NDArray[np.float64]
FlagArray = NDArray[np.bool_]

HE, BACKLASH, KARNOPP, LUGRE = range(4)
FLOW, PRESSURE, TANK, FOUR_TANKS, REACTOR, EXCHANGER, COLUMN = range(7)

STEM_STATES = 4  # position, speed, bristle, pressure
PLANT_STATES = 12
CELLS = 4  # of either side of the heat exchanger
SUBSTEPS = 8.0  # of the stem per natural time
AT_REST = 1e-6  # %: of speed and pressure, below which a stem is left alone for the step


@compiled
def stem_step(
    law: int, friction: FloatArray, state: FloatArray, command: float, seconds: float
) -> float:
    """Move a stem for some seconds under a held command, state in place; return its position, %.

    The mechanical laws balance forces, counted in % of travel by the spring: natural time τ,
    damping ζ, actuator pressure p behind a lag, with a proportional positioner:
    τ² ẍ = p − x − F − 2 ζ τ ẋ.
    """
    if law == HE:
        away = command - state[0]
        if abs(away) > friction[0]:
            state[0] = command - math.copysign(friction[1], away)
    elif law == BACKLASH:
        state[0] = min(max(state[0], command - friction[0]), command + friction[0])
    elif law == KARNOPP:
        _karnopp(friction, state, command, seconds)
    else:
        _lugre(friction, state, command, seconds)
    return float(state[0])


@compiled
def _karnopp(friction: FloatArray, state: FloatArray, command: float, seconds: float) -> None:
    """Coulomb friction with a band of zero speed: a stem that slows down inside it sticks."""
    static, coulomb, natural, damping, lag, positioner = friction[:6]
    steps = max(1, math.ceil(seconds * SUBSTEPS / natural))
    h = seconds / steps
    share = 1.0 - math.exp(-h / lag)
    slow = 0.02 * (static - coulomb) / natural + 1e-3 * static / natural
    x, v, p = state[0], state[1], state[3]
    for _ in range(steps):
        target = command + positioner * (command - x)
        p += share * (target - p)
        drive = p - x
        if v == 0.0:
            if abs(drive) <= static:
                if abs(target - p) < AT_REST:
                    break
                continue
            direction = math.copysign(1.0, drive)
        else:
            direction = math.copysign(1.0, v)
        push = drive - direction * coulomb
        after = (v + h * push / natural**2) / (1.0 + 2.0 * damping * h / natural)
        stops = abs(after) < slow and abs(after) <= abs(v)
        v = 0.0 if stops or after * direction <= 0.0 else after
        x += h * v
    state[0], state[1], state[3] = x, v, p


@compiled
def _lugre(friction: FloatArray, state: FloatArray, command: float, seconds: float) -> None:
    """Bristles that bend and slide; speed and bristle follow from one implicit step."""
    static, coulomb, natural, damping, lag, positioner, stiffness, stribeck = friction[:8]
    steps = max(1, math.ceil(seconds * SUBSTEPS / natural))
    h = seconds / steps
    share = 1.0 - math.exp(-h / lag)
    bristle_damping = math.sqrt(stiffness) * natural
    x, v, z, p = state[0], state[1], state[2], state[3]
    for _ in range(steps):
        target = command + positioner * (command - x)
        p += share * (target - p)
        level = coulomb + (static - coulomb) * math.exp(-((v / stribeck) ** 2))
        kept = 1.0 / (1.0 + h * stiffness * abs(v) / level)
        inertia = natural**2 / h + h + (stiffness * h + bristle_damping) * kept
        inertia += 2.0 * damping * natural
        force = natural**2 * v / h + p - x - stiffness * kept * z
        v = (force + bristle_damping * (1.0 - kept) * z / h) / inertia
        z = kept * (z + h * v)
        x += h * v
        if abs(v) * seconds < AT_REST and abs(target - p) < AT_REST:
            break
    state[0], state[1], state[2], state[3] = x, v, z, p


@compiled
def stem_path(
    law: int, friction: FloatArray, state: FloatArray, commands: FloatArray, seconds: float
) -> FloatArray:
    """Return the stem after each command, held for ``seconds`` each, %, shape (K,)."""
    path = np.empty(len(commands))
    for k in range(len(commands)):
        path[k] = stem_step(law, friction, state, commands[k], seconds)
    return path


@compiled
def opening(stem: float, rangeability: float) -> float:
    """Return the inherent characteristic, 0 to 1: linear for rangeability 1, else equal percent."""
    share = min(max(stem / 100.0, 0.0), 1.0)
    if rangeability <= 1.0:
        return share
    return float(rangeability ** (share - 1.0))


@compiled
def plant_rates(
    kind: int, p: FloatArray, s: FloatArray, stem: float, load: float, out: FloatArray
) -> None:
    """Write the rates of change of a plant's state; ``p[0]`` is the valve's rangeability."""
    flow = opening(stem, p[0])
    if kind == FLOW:
        installed = flow / math.sqrt(p[1] + (1.0 - p[1]) * flow**2)
        wanted = p[2] * installed * math.sqrt(max(1.0 + load, 0.0))
        out[0] = (wanted - s[0]) / p[3]
        out[1] = (s[0] - s[1]) / p[4]
    elif kind == PRESSURE:
        supply = math.sqrt(max(p[1] * (p[1] - s[0]), 0.0))
        leaving = math.sqrt(max(s[0] * (s[0] - p[2]), 0.0))
        out[0] = (p[3] * flow * supply - p[4] * (1.0 + load) * leaving) / p[5]
        out[1] = (s[0] - s[1]) / p[6]
    elif kind == TANK:
        head = 1.0 if p[4] == 0.0 else math.sqrt(max(s[0], 0.0) / 50.0)
        out[0] = p[5] * (p[2] * (1.0 + load) - p[1] * flow * head) / p[3]
        if (s[0] <= 0.0 and out[0] < 0.0) or (s[0] >= 100.0 and out[0] > 0.0):
            out[0] = 0.0
        out[1] = (s[0] - s[1]) / p[6]
    elif kind == FOUR_TANKS:
        _four_tanks(p, s, flow, load, out)
    elif kind == REACTOR:
        _reactor(p, s, flow, load, out)
    elif kind == EXCHANGER:
        _exchanger(p, s, flow, load, out)
    else:
        out[0] = (p[1] * (stem - p[5]) - s[0]) / p[2]
        out[1] = (p[3] * load - s[1]) / p[4]


@compiled
def _four_tanks(p: FloatArray, s: FloatArray, flow: float, load: float, out: FloatArray) -> None:
    first, second = p[1] * flow, p[2] * (1.0 + load)
    gamma1, gamma2, stretch = p[3], p[4], p[5]
    leaving1 = p[8] * math.sqrt(2.0 * 981.0 * max(s[0], 0.0))
    leaving2 = p[9] * math.sqrt(2.0 * 981.0 * max(s[1], 0.0))
    leaving3 = p[8] * math.sqrt(2.0 * 981.0 * max(s[2], 0.0))
    leaving4 = p[9] * math.sqrt(2.0 * 981.0 * max(s[3], 0.0))
    out[0] = (-leaving1 + leaving3 + gamma1 * first) / (p[6] * stretch)
    out[1] = (-leaving2 + leaving4 + gamma2 * second) / (p[7] * stretch)
    out[2] = (-leaving3 + (1.0 - gamma2) * second) / (p[6] * stretch)
    out[3] = (-leaving4 + (1.0 - gamma1) * first) / (p[7] * stretch)


@compiled
def _reactor(p: FloatArray, s: FloatArray, flow: float, load: float, out: FloatArray) -> None:
    # p: rangeability, q/V, c_in, T_in, k0, E/R, −ΔH/ρc, UA/Vρc, coolant in, F_max/V_j,
    # UA/V_jρ_jc_j, sensor lag; time in s
    rate = p[4] * math.exp(-p[5] / s[1]) * s[0]
    out[0] = p[1] * (p[2] - s[0]) - rate
    out[1] = p[1] * (p[3] + 10.0 * load - s[1]) + p[6] * rate + p[7] * (s[2] - s[1])
    out[2] = p[9] * flow * (p[8] - s[2]) + p[10] * (s[1] - s[2])
    out[3] = (s[1] - s[3]) / p[11]


@compiled
def _exchanger(p: FloatArray, s: FloatArray, flow: float, load: float, out: FloatArray) -> None:
    # p: rangeability, hot flow/cell, cold flow/cell, exchange hot, exchange cold, hot in,
    # cold in, sensor lag; s: hot cells, cold cells against the current, sensor
    hot, cold = p[1] * flow, p[2] * (1.0 + load)
    for i in range(CELLS):
        before = p[5] if i == 0 else s[i - 1]
        out[i] = hot * (before - s[i]) + p[3] * (s[CELLS + i] - s[i])
        coming = p[6] if i == CELLS - 1 else s[CELLS + i + 1]
        out[CELLS + i] = cold * (coming - s[CELLS + i]) + p[4] * (s[i] - s[CELLS + i])
    out[2 * CELLS] = (s[CELLS] - s[2 * CELLS]) / p[7]


@compiled
def plant_output(kind: int, s: FloatArray) -> float:
    """Return what the transmitter shows, engineering units."""
    if kind == COLUMN:
        return float(s[0] + s[1])
    if kind == FOUR_TANKS:
        return float(s[0])
    if kind == REACTOR:
        return float(s[3])
    if kind == EXCHANGER:
        return float(s[2 * CELLS])
    return float(s[1])


@compiled
def plant_step(
    kind: int, p: FloatArray, s: FloatArray, stem: float, load: float, h: float, work: FloatArray
) -> None:
    """Advance a plant by ``h`` s with the classical Runge-Kutta rule, in place."""
    rates, total, at = work[0], work[1], work[2]
    plant_rates(kind, p, s, stem, load, rates)
    for i in range(PLANT_STATES):
        total[i] = rates[i]
        at[i] = s[i] + 0.5 * h * rates[i]
    plant_rates(kind, p, at, stem, load, rates)
    for i in range(PLANT_STATES):
        total[i] += 2.0 * rates[i]
        at[i] = s[i] + 0.5 * h * rates[i]
    plant_rates(kind, p, at, stem, load, rates)
    for i in range(PLANT_STATES):
        total[i] += 2.0 * rates[i]
        at[i] = s[i] + h * rates[i]
    plant_rates(kind, p, at, stem, load, rates)
    for i in range(PLANT_STATES):
        s[i] += h * (total[i] + rates[i]) / 6.0


@compiled
def run_loop(
    valve: tuple[int, FloatArray, FloatArray],
    plant: tuple[int, FloatArray, FloatArray],
    controller: FloatArray,
    clock: tuple[float, int, int, int],
    set_point: FloatArray,
    load: FloatArray,
    noise: FloatArray,
    manual: FlagArray,
    by_hand: FloatArray,
) -> FloatArray:
    """Run a loop step by step; states of stem and plant go on in place.

    Args:
        valve: law, its parameters, the stem's state.
        plant: kind, its parameters, its state.
        controller: K_c, T_i, T_d, PV filter, derivative filter (s), low, high (%), weight of
            the set-point in the proportional part, whether the form is velocity (1) or position
            with back-calculation (0), OP at the start (%).
        clock: step (s), steps of a scan, of the dead time and of an analyser's cycle.
        set_point: at each step, shape (K,).
        load: on the plant behind the valve, as a share, shape (K,).
        noise: of the transmitter, engineering units, shape (K,).
        manual: whether the loop is in manual, shape (K,).
        by_hand: how far OP then is from where it was found, %, shape (K,).

    Returns:
        Rows OP, PV as the controller reads it, stem and PV without noise, shape (4, K).
    """
    law, friction, stem_state = valve
    kind, parameters, state = plant
    h, scan, dead, cycle = clock
    gain, integral, derivative, pv_filter, d_filter, low, high, weight, velocity, op = controller
    count = len(set_point)
    out = np.empty((4, count))
    work = np.zeros((3, PLANT_STATES))
    waiting = np.full(dead + 1, stem_state[0])
    interval = scan * h
    shown = measured = filtered = plant_output(kind, state)
    before = weight * set_point[0] - filtered
    rate = 0.0
    held = op - gain * before  # integral part of the position form
    found = op
    for k in range(count):
        clean = plant_output(kind, state)
        if k % cycle == 0:
            shown = clean + noise[k]
        if k % scan == 0:
            measured = shown
            last = filtered
            filtered += (measured - filtered) * interval / (pv_filter + interval)
            error = set_point[k] - filtered
            proportional = weight * set_point[k] - filtered
            turned = (d_filter * rate - gain * derivative * (filtered - last)) / (
                d_filter + interval
            )
            if manual[k]:
                op = min(max(found + by_hand[k], low), high)
                held = op - gain * proportional - turned
            elif velocity > 0.0:
                op += gain * (proportional - before + interval / integral * error)
                op = min(max(op + turned - rate, low), high)
            else:
                held += gain * interval / integral * error
                free = gain * proportional + held + turned
                op = min(max(free, low), high)
                held += (op - free) * min(interval / integral, 1.0)
            if not manual[k]:
                found = op
            before, rate = proportional, turned
        stem = stem_step(law, friction, stem_state, op, h)
        at = k % (dead + 1)
        waiting[at] = stem
        arriving = waiting[(at + 1) % (dead + 1)]
        out[0, k], out[1, k], out[2, k], out[3, k] = op, measured, stem, clean
        plant_step(kind, parameters, state, arriving, load[k], h, work)
    return out


@compiled
def run_held(
    valve: tuple[int, FloatArray, FloatArray],
    plant: tuple[int, FloatArray, FloatArray],
    clock: tuple[float, int],
    waiting: FloatArray,
    op: float,
    load: FloatArray,
) -> tuple[float, float]:
    """Run valve and plant under one OP; states of stem and plant and ``waiting`` go on in place.

    Args:
        valve: law, its parameters, the stem's state.
        plant: kind, its parameters, its state.
        clock: step (s), steps before the first of these.
        waiting: stems on their way through the dead time, in a ring, shape (dead + 1,).
        op: %.
        load: at each step, shape (K,).

    Returns:
        Stem after the first step, and PV without noise after the last one.
    """
    law, friction, stem_state = valve
    kind, parameters, state = plant
    h, begun = clock
    work = np.zeros((3, PLANT_STATES))
    first = stem_state[0]
    for k in range(len(load)):
        stem = stem_step(law, friction, stem_state, op, h)
        if k == 0:
            first = stem
        at = (begun + k) % len(waiting)
        waiting[at] = stem
        arriving = waiting[(at + 1) % len(waiting)]
        plant_step(kind, parameters, state, arriving, load[k], h, work)
    return first, plant_output(kind, state)
