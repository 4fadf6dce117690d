"""Is there friction? Friction against no friction, each with its own best linear part.

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
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.problem.models import Model
from stiction_ros.identification.result.identification import VerdictKind
from stiction_ros.identification.result.stability import Interval

DEADBAND = 4.0
"""−2 log likelihood below which a deadband (J = 0) is not rejected: two standard deviations of the
one parameter that it has less."""
SMALL_JUMP = 0.25
"""Jump, as a share of f_S + f_D, up to which friction is a deadband: a stem that is moved by the
controller's own kicks tells f_S + f_D alone, and any jump may go with it."""


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
    figures: dict[str, float],
    static: Interval,
    dynamic: Interval,
    span: float,
    options: IdentificationOptions,
) -> VerdictKind:
    """Return the verdict of one valve from its evidence and its interval of f_S.

    Args:
        figures: the evidence, see the head of this module.
        static: interval of f_S, %.
        dynamic: interval of f_D, %.
        span: OP span of the valve, %.
        options: the limits.
    """
    negligible = max(options.negligible_share * span, min(options.negligible_friction, 0.1 * span))
    believed = (
        figures["delta_bic"] > options.bic_margin
        and min(figures["half_1"], figures["half_2"]) > 0.0
    )
    if believed and static[0] > options.negligible_share * span:
        if figures["moves"] < options.min_moves:
            return VerdictKind.UNDECIDED
        deadband = is_deadband(figures["deadband_loss"], static, dynamic)
        return VerdictKind.BACKLASH if deadband else VerdictKind.STICKY
    if static[1] <= negligible and figures["moves"] >= options.min_moves:
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
