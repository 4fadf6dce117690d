"""The weights of Section 4.2 by name: as they are printed, and with the misprints mended."""

import dataclasses
import enum

import numpy as np

from stiction_ros.control.horizon import HorizonWeights
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel


class WeightPreset(enum.StrEnum):
    """Where the weights of a controller come from.

    ``own`` are those of its settings. ``printed`` takes every figure as it stands: max c²_ij is
    the largest square, and Q_z has six entries, so that the last of the seven states has none.
    ``corrected`` takes max c²_ij as the square of the largest signed entry, "the maximum
    element of matrix C", and gives every state its entry in Q_z.
    """

    OWN = "own"
    CORRECTED = "corrected"
    PRINTED = "printed"


class WarmStart(enum.StrEnum):
    """Where the nonlinear programme starts."""

    COMPENSATION = "compensation"  # the sequence (21)
    SEARCH = "search"  # a small dynamic optimisation
    NONE = "none"  # OP rests where it is: what the paper's solver would do without help


class ProgrammeCost(enum.StrEnum):
    """What the nonlinear programme minimises."""

    REVISED = "revised"  # (22)
    PLAIN = "plain"  # (19a) with the weights of the unaware controller, Δu penalised


@dataclasses.dataclass(frozen=True, kw_only=True)
class AugmentedWeights(HorizonWeights):
    """Penalties of (22): those of (19a), with Δχ in place of Δu, and on stems and OP."""

    stem: FloatArray  # block of Q_z on χ_{i−1} − χ_ss, shape (m, m); that on ξ_i − ξ_ss is state
    op: FloatArray  # R on u_i − u_s, shape (m, m)
    op_move: FloatArray | None = None  # S on Δu, (m, m), which (22) has not; None for none


@dataclasses.dataclass(frozen=True)
class PaperTuning:
    """The paper's own stiction-embedding controller."""

    weights: AugmentedWeights  # of (22)
    warm_start: WarmStart = WarmStart.COMPENSATION  # where the programme starts
    first_move: float = 2.1  # a of (21); the paper asks for a > 2
    smoothing: float = 1e4  # τ of (6), 1/%
    iterations: int = 100  # limit of IPOPT


STATE_WEIGHT = 0.01
TERMINAL_WEIGHT = 1e3
MOVE_WEIGHTS = (10.0, 100.0)
STEM_WEIGHT = 1e3
PRINTED_ENTRIES = 6  # of Q_z
STEM_MOVE_WEIGHT = 1.0
OP_WEIGHT = 10.0


def unaware_weights(preset: WeightPreset, model: LinearModel, horizon: int) -> HorizonWeights:
    r"""Return Q, S and V_F of stiction-unaware and stiction-inverting MPC.

    .. math::
        Q = \frac{C^T C}{\max c_{ij}^2} + 0.01 I, \quad S = \text{diag}(10, 100), \quad
        V_F = 10^3 I.

    The preset, printed or corrected, says what max c²_ij means. S is printed for two valves.
    """
    count = model.b.shape[1]
    if count != len(MOVE_WEIGHTS):
        raise InputError(
            f"the paper gives S for {len(MOVE_WEIGHTS)} valves, the loop has {count}",
            where="preset",
            fix="use preset: own",
        )
    n = model.order
    largest = (model.c**2).max() if preset is WeightPreset.PRINTED else model.c.max() ** 2
    stage = model.c.T @ model.c / largest + STATE_WEIGHT * np.eye(n)
    return HorizonWeights(horizon, stage, np.diag(MOVE_WEIGHTS), TERMINAL_WEIGHT * np.eye(n))


def augmented_weights(preset: WeightPreset, model: LinearModel, horizon: int) -> AugmentedWeights:
    r"""Return Q_z, Q_s, R and V_F of stiction-embedding MPC for any number m of valves.

    .. math::
        Q_z = \text{diag}(10^3 I_m, I_n), \quad Q_s = I_m, \quad R = 10 I_m, \quad V_F = 10^3 I_n.

    ``printed`` leaves entries of Q_z after the sixth at zero.
    """
    m, n = model.b.shape[1], model.order
    diagonal = np.concatenate([np.full(m, STEM_WEIGHT), np.ones(n)])
    if preset is WeightPreset.PRINTED:
        diagonal[PRINTED_ENTRIES:] = 0.0
    return AugmentedWeights(
        horizon,
        np.diag(diagonal[m:]),
        STEM_MOVE_WEIGHT * np.eye(m),
        TERMINAL_WEIGHT * np.eye(n),
        stem=np.diag(diagonal[:m]),
        op=OP_WEIGHT * np.eye(m),
    )


def plain_weights(unaware: HorizonWeights) -> AugmentedWeights:
    """Return (19a) as the cost of the augmented model: no Q_z on stems, no Q_s, no R."""
    none = np.zeros_like(unaware.move)
    told = unaware.horizon, unaware.state, none, unaware.terminal
    return AugmentedWeights(*told, stem=none, op=none, op_move=unaware.move)
