"""A record prepared for linear identification, and the words its results share."""

import dataclasses
import enum

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification.problem.input_checks import (
    require_motion,
    require_samples,
    require_tags,
)
from stiction_ros.records.record import Record

MIN_SAMPLES = 40


class LinearStatus(enum.StrEnum):
    """How a linear fit ended; everything but ``OK`` asks for a look at ``reason``.

    ``CONSTRAINED``: an unstable order does clearly better one step ahead than the stable one that
    is given. ``UNSTABLE``: the model given has a pole on or outside the unit circle.
    """

    OK = "ok"
    CONSTRAINED = "constrained"
    UNSTABLE = "unstable"


class OrderCriterion(enum.StrEnum):
    """Price of a coefficient in the choice of orders: 2 (AIC) or log n (BIC)."""

    AIC = "aic"
    BIC = "bic"


@dataclasses.dataclass(frozen=True)
class LinearData:
    """Inputs and outputs about their means, in units of their standard deviations."""

    name: str  # of the record
    valves: tuple[str, ...]  # valves, outputs: tags
    outputs: tuple[str, ...]
    sample_time: float  # seconds
    u: FloatArray  # inputs, shape (m, N)
    y: FloatArray  # outputs, shape (p, N)
    u_mean: FloatArray  # u_mean, u_scale: shape (m,), %
    u_scale: FloatArray
    y_mean: FloatArray  # y_mean, y_scale: shape (p,), engineering units
    y_scale: FloatArray

    @property
    def samples(self) -> int:
        """Number N of samples."""
        return int(self.u.shape[1])


def prepare_linear(record: Record, stem: FloatArray | None = None) -> LinearData:
    """Return centred and scaled data.

    Args:
        record: what was measured.
        stem: stem positions to take as inputs, shape (N, m), %; None takes OP, which is the
            stem of a valve without friction.

    Raises:
        InputError: no valve or output, a constant signal, fewer than ``MIN_SAMPLES`` samples,
            stems of another shape or not finite.
    """
    require_tags(record)
    require_samples(record, MIN_SAMPLES, "take a longer record")
    inputs = record.op if stem is None else np.asarray(stem, dtype=float)
    if inputs.shape != record.op.shape:
        raise InputError(f"stem has shape {inputs.shape}, not {record.op.shape}", where=record.name)
    if not np.isfinite(inputs).all():
        raise InputError("a stem position is not finite", where=record.name)
    key = "op" if stem is None else "stem"
    require_motion(record, key, inputs, record.valves)
    require_motion(record, "pv", record.pv, record.outputs)
    u_mean, u_scale = inputs.mean(axis=0), inputs.std(axis=0)
    y_mean, y_scale = record.pv.mean(axis=0), record.pv.std(axis=0)
    return LinearData(
        record.name,
        record.valves,
        record.outputs,
        record.sample_time,
        np.ascontiguousarray(((inputs - u_mean) / u_scale).T),
        np.ascontiguousarray(((record.pv - y_mean) / y_scale).T),
        u_mean,
        u_scale,
        y_mean,
        y_scale,
    )


def nrmse_fit(y: FloatArray, predicted: FloatArray) -> float:
    """Return the fit 100 (1 − ‖y − ŷ‖ / ‖y − mean y‖), %; −inf where ŷ is not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        error = float(np.linalg.norm(y - predicted))
    if not np.isfinite(error):
        return float("-inf")
    return 100.0 * (1.0 - error / max(float(np.linalg.norm(y - y.mean())), 1e-300))
