"""From the final model to a verdict and a result in engineering units.

Friction is held against no friction, each with its own best linear part.

Evidence, all under the noise model:

- ``delta_bic``: BIC of the best friction-free rival (orders n_a, n_a + 1, n_a + 2, own delays)
  minus BIC of the model with friction.
- ``half_1``, ``half_2``: −2 log likelihood gained by friction in either half of the record.
- ``share``: f_S over the OP span; ``moves``: number of stem moves.
- ``deadband_loss``: −2 log likelihood lost by J = 0.
- ``patterns``, ``patterns_closed``: switching patterns enumerated round the best, and whether
  all at the edge were rejected.
- ``stem_error``: mean squared error of the stem, %², where the record holds the true one (the
  paper's Remark 2).
"""

from collections.abc import Iterable

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.linear.data import nrmse_fit
from stiction_ros.identification.problem.models import FEWEST_MOVES, Data, Model
from stiction_ros.identification.problem.output_error import OutputFit
from stiction_ros.identification.result import (
    FitStatus,
    Identification,
    Interval,
    OrderRow,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.records.record import Record

BELIEVED = 20.0  # BIC by which friction must beat the friction-free rival
NEGLIGIBLE, NEGLIGIBLE_SHARE = 0.3, 0.03  # f_S up to which a valve is healthy, %, and of OP's span
DEADBAND = 4.0
"""−2 log likelihood below which a deadband (J = 0) is not rejected: two standard deviations of the
one parameter that it has less."""
SMALL_JUMP = 0.25
"""Jump, as a share of f_S + f_D, up to which friction is a deadband: a stem that is moved by the
controller's own kicks tells f_S + f_D alone, and any jump may go with it."""


def conclude(
    record: Record,
    data: Data,
    model: Model,
    valves: tuple[ValveEstimate, ...],
    orders: tuple[OrderRow, ...],
    remarks: tuple[str, ...] = (),
) -> Identification:
    """Return the result in engineering units, seconds still to be told.

    Args:
        record, data: as measured, and made ready.
        model: the final one.
        valves: the estimates.
        orders: all that were compared.
        remarks: sentences for people on ambiguities and on what is exact.
    """
    stem = model.stems.T + record.op.mean(axis=0)
    stem.flags.writeable = False
    outputs = tuple(output_model(record, i, fit, data) for i, fit in enumerate(model.fits))
    notes = [*record.notes, *remarks]
    for j, tag in enumerate(record.valves):
        if record.op[:, j].min() < 0.0 or record.op[:, j].max() > 100.0:
            notes.append(f"op of {tag} lies outside 0 to 100 %; friction is in the op's own units")
    notes += [
        f"the delay from valve {valve} to {output.name} is the longest tried; widen --delay"
        for output in outputs
        for valve, delay in output.delay.items()
        if delay == data.delay[1] > data.delay[0]
    ]
    usable = all(np.isfinite(fit.loss) for fit in model.fits)
    return Identification(
        status=FitStatus.OK if usable else FitStatus.NO_MODEL,
        reason="" if usable else "no output could be fitted",
        method="exact",
        samples=len(record),
        sample_time=record.sample_time,
        seconds=0.0,
        valves=tuple(valve.with_own_jump() for valve in valves),
        outputs=outputs,
        stem=stem,
        notes=tuple(notes),
        orders=orders,
    )


def output_model(record: Record, i: int, fit: OutputFit, data: Data) -> OutputModel:
    """Return one output's model in engineering units, equation (9) with a constant."""
    mean, scale = float(record.pv[:, i].mean()), float(record.pv[:, i].std())
    b = fit.b * scale
    bias = fit.constant * scale + float(fit.a.sum()) * mean
    bias -= float(b.sum(axis=1) @ record.op.mean(axis=0))
    y = data.y[i]
    tail = y[len(y) - fit.count :]
    return OutputModel(
        name=record.outputs[i],
        a=tuple(float(value) for value in fit.a[1:]),
        b={tag: tuple(map(float, row)) for tag, row in zip(record.valves, b, strict=True)},
        delay=dict(zip(record.valves, fit.delays, strict=True)),
        bias=bias,
        noise_std=float(np.sqrt(fit.energy / max(fit.count - fit.parameters, 1))) * scale,
        fit_one_step=nrmse_fit(tail, tail - fit.innovations),
        fit_free_run=nrmse_fit(y[len(y) - len(fit.free_run) :], fit.free_run),
    )


def evidence(sticky: Model, rivals: list[Model], valve: int, span: float) -> dict[str, float]:
    """Return the named figures for one valve.

    Args:
        sticky: the model with friction.
        rivals: the same without this valve's friction, of several orders.
        span: OP span of the valve, %.
    """
    rival = min(rivals, key=lambda model: model.bic)
    count = sum(fit.count for fit in sticky.fits)
    friction_parameters = 2.0 * np.log(count)
    pairs = zip(sticky.fits, rival.fits, strict=True)
    halves = half_gains((one.innovations, other.innovations) for one, other in pairs)
    return {
        "delta_bic": float(rival.bic - sticky.bic - friction_parameters),
        "half_1": halves[0],
        "half_2": halves[1],
        "share": float(sticky.friction[valve, 0] / span),
        "moves": float(np.count_nonzero(np.diff(sticky.stems[valve]))),
    }


def half_gains(innovations: Iterable[tuple[FloatArray, FloatArray]]) -> tuple[float, float]:
    """Return −2 log likelihood gained by friction in both halves, variances from the whole.

    Args:
        innovations: with friction and without, of each output, shape (n,) each.
    """
    gains = np.zeros(2)
    for with_friction, without in innovations:
        scale, rival_scale = _mean_square(with_friction), _mean_square(without)
        gain: FloatArray = (
            without**2 / rival_scale
            + np.log(rival_scale)
            - with_friction**2 / scale
            - np.log(scale)
        )
        middle = len(gain) // 2
        gains += [gain[:middle].sum(), gain[middle:].sum()]
    return float(gains[0]), float(gains[1])


def _mean_square(values: FloatArray) -> float:
    return max(float(values @ values), 1e-300) / len(values)


def judge(
    figures: dict[str, float], static: Interval, dynamic: Interval, span: float
) -> VerdictKind:
    """Return the verdict of one valve from its evidence and its interval of f_S.

    Args:
        figures: the evidence, see the head of this module.
        static: interval of f_S, %.
        dynamic: interval of f_D, %.
        span: OP span of the valve, %.
    """
    negligible = max(NEGLIGIBLE_SHARE * span, min(NEGLIGIBLE, 0.1 * span))
    halves = min(figures["half_1"], figures["half_2"])
    believed = figures["delta_bic"] > BELIEVED and halves > 0.0
    if believed and static[0] > NEGLIGIBLE_SHARE * span:
        if figures["moves"] < FEWEST_MOVES:
            return VerdictKind.UNDECIDED
        deadband = is_deadband(figures["deadband_loss"], static, dynamic)
        return VerdictKind.BACKLASH if deadband else VerdictKind.STICKY
    if static[1] <= negligible and figures["moves"] >= FEWEST_MOVES:
        return VerdictKind.HEALTHY
    return VerdictKind.UNDECIDED


def is_deadband(deadband_loss: float, static: Interval, dynamic: Interval) -> bool:
    """Return whether a deadband explains the record, and no larger jump does as well.

    Args:
        deadband_loss: −2 log likelihood lost by J = 0.
        static: interval of f_S, %.
        dynamic: interval of f_D, %.
    """
    jump, band = static[1] - dynamic[0], static[1] + dynamic[0]
    return deadband_loss < DEADBAND and jump <= SMALL_JUMP * band
