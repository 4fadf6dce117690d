"""Simulated loops, their controller, process and friction known, as identification tells them."""

import dataclasses

import numpy as np

from stiction_ros.effects import FloatArray
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.identification.result import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.records.record import Record

A = (-1.5, 0.56)
B = (0.04, 0.02)
DELAY = 2


@dataclasses.dataclass(frozen=True)
class Kind:
    """What a loop is made of: K in OP per PV, T_i in samples, σ of the noise of PV."""

    friction: tuple[float, float] = (0.0, 0.0)
    gain: float = 1.0
    integral_time: float = 8.0
    noise: float = 0.02
    lag: int = 0
    limits: tuple[float, float] = (-np.inf, np.inf)
    law: str = "he"


@dataclasses.dataclass(frozen=True)
class Known:
    """A record, and what it was made with."""

    record: Record
    found: Identification


def known(
    kind: Kind,
    seed: int = 0,
    samples: int = 900,
    sp: FloatArray | None = None,
    load: FloatArray | None = None,
) -> Known:
    """Return y = B/A χ(u) + load under a PI controller about (50, 20)."""
    noise = kind.noise * np.random.default_rng(seed).standard_normal(samples)
    outside = np.zeros(samples) if load is None else load
    wanted = np.full(samples, 20.0) if sp is None else sp
    valve = behaviour_of(kind.law, kind.friction, {})
    y, pv, op, stem = np.zeros(samples), np.zeros(samples), np.zeros(samples), np.zeros(samples)
    start = -0.9 * kind.friction[0]  # no rest to stay in
    position, command, before = start, 0.0, 0.0
    memory = valve.rest(start)
    if isinstance(memory, tuple):  # OP rests at its middle
        memory = (start, command, *memory[2:])
    error = np.zeros(samples)
    for k in range(samples):
        for i in range(2):
            if k > i:
                y[k] -= A[i] * y[k - 1 - i]
            late = k - 1 - i - DELAY
            y[k] += B[i] * (stem[late] if late >= 0 else start)
        pv[k] = 20.0 + y[k] + outside[k] + noise[k]
        error[k] = wanted[k] - pv[k]
        seen = error[k - kind.lag] if k >= kind.lag else 0.0
        command += kind.gain * (seen - before + seen / kind.integral_time)
        command = min(max(command, kind.limits[0] - 50.0), kind.limits[1] - 50.0)
        before = seen
        op[k] = command
        memory, position = valve.step(memory, float(command))
        stem[k] = command if max(kind.friction) == 0.0 else position
    columns = (50.0 + op, pv, wanted, 50.0 + stem)
    record = Record("known", 5.0, ("V1",), ("PV1",), *(column[:, None] for column in columns))
    return Known(record, truth(record, kind))


def truth(record: Record, kind: Kind) -> Identification:
    """Return what a perfect identification finds."""
    f_s, f_d = kind.friction
    valve = ValveEstimate(
        name="V1",
        verdict=VerdictKind.STICKY if f_s > 0.0 else VerdictKind.HEALTHY,
        law=kind.law,
        static_friction=f_s,
        static_interval=(0.95 * f_s, 1.05 * f_s),
        dynamic_friction=f_d,
        dynamic_interval=(0.95 * f_d, 1.05 * f_d),
        jump=f_s - f_d,
        stem_start=50.0,
        moves=100,
        evidence={"delta_bic": 500.0 if f_s > 0.0 else -10.0},
    )
    bias = 20.0 * (1.0 + sum(A)) - 50.0 * sum(B)
    output = OutputModel(
        "PV1",
        A,
        {"V1": B},
        {"V1": DELAY},
        bias,
        noise_std=kind.noise,
        fit_one_step=0.0,
        fit_free_run=0.0,
    )
    assert record.stem is not None
    return Identification(
        status=FitStatus.OK,
        reason="",
        method="exact",
        samples=len(record),
        sample_time=record.sample_time,
        seconds=0.0,
        valves=(valve,),
        outputs=(output,),
        stem=record.stem,
    )


def changed(one: Known, op: tuple[float, float], pv: tuple[float, float], time: float) -> Known:
    """Return the loop with OP, PV and time in other units: factor and offset of each."""
    record, found = one.record, one.found
    assert record.sp is not None
    assert record.stem is not None
    other = dataclasses.replace(
        record,
        sample_time=record.sample_time * time,
        op=record.op * op[0] + op[1],
        stem=record.stem * op[0] + op[1],
        pv=record.pv * pv[0] + pv[1],
        sp=record.sp * pv[0] + pv[1],
    )
    size, valve, output = abs(op[0]), found.valves[0], found.outputs[0]
    b = tuple(value * pv[0] / op[0] for value in output.b["V1"])
    bias = output.bias * pv[0] + pv[1] * (1.0 + sum(output.a)) - sum(b) * op[1]
    return Known(
        other,
        dataclasses.replace(
            found,
            sample_time=other.sample_time,
            stem=other.stem,
            valves=(
                dataclasses.replace(
                    valve,
                    static_friction=valve.static_friction * size,
                    static_interval=tuple(value * size for value in valve.static_interval),
                    dynamic_friction=valve.dynamic_friction * size,
                    dynamic_interval=tuple(value * size for value in valve.dynamic_interval),
                    jump=valve.jump * size,
                ),
            ),
            outputs=(
                dataclasses.replace(
                    output, b={"V1": b}, bias=bias, noise_std=output.noise_std * abs(pv[0])
                ),
            ),
        ),
    )
