"""From the final model to a result in engineering units."""

import dataclasses

import numpy as np

from stiction_ros.identification.linear.data import nrmse_fit
from stiction_ros.identification.problem.models import Data, Model
from stiction_ros.identification.problem.output_error import OutputFit
from stiction_ros.identification.result.identification import (
    FitStatus,
    Identification,
    OrderRow,
    OutputModel,
    ValveEstimate,
)
from stiction_ros.records.record import Record


@dataclasses.dataclass(frozen=True)
class Findings:
    """What the search leaves to be told."""

    model: Model  # the final model
    valves: tuple[ValveEstimate, ...]  # the estimates
    orders: tuple[OrderRow, ...]  # all orders that were compared
    remarks: tuple[str, ...]  # sentences for people on ambiguities and on what is exact


def conclude(record: Record, data: Data, found: Findings, seconds: float) -> Identification:
    """Return the result in engineering units."""
    model = found.model
    stem = model.stems.T + record.op.mean(axis=0)
    stem.flags.writeable = False
    outputs = tuple(output_model(record, i, fit, data) for i, fit in enumerate(model.fits))
    notes = [*record.notes, *found.remarks]
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
        seconds=seconds,
        valves=tuple(valve.with_own_jump() for valve in found.valves),
        outputs=outputs,
        stem=stem,
        notes=tuple(notes),
        orders=found.orders,
    )


def output_model(record: Record, i: int, fit: OutputFit, data: Data) -> OutputModel:
    """Return one output's model in engineering units, equation (9) with a constant."""
    mean, scale = float(record.pv[:, i].mean()), float(record.pv[:, i].std())
    b = fit.b * scale
    bias = fit.constant * scale + float(fit.a.sum()) * mean
    bias -= float(b.sum(axis=1) @ record.op.mean(axis=0))
    y = data.y[i]
    free = nrmse_fit(y[len(y) - len(fit.free_run) :], fit.free_run)
    tail = y[len(y) - fit.count :]
    return OutputModel(
        name=record.outputs[i],
        a=tuple(float(value) for value in fit.a[1:]),
        b={tag: tuple(map(float, row)) for tag, row in zip(record.valves, b, strict=True)},
        delay=dict(zip(record.valves, fit.delays, strict=True)),
        bias=bias,
        noise_std=float(np.sqrt(fit.energy / max(fit.count - fit.parameters, 1))) * scale,
        fit_one_step=nrmse_fit(tail, tail - fit.innovations),
        fit_free_run=free,
    )
