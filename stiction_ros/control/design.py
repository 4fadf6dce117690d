"""What a controller is built from, the past that it can take over, the formulation of its mode."""

import dataclasses
import math
from collections.abc import Callable, Sequence

import numpy as np

from stiction_ros.control.belief import ValveBeliefs
from stiction_ros.control.embedding import EmbeddingMpc, EmbeddingTuning
from stiction_ros.control.formulation import Formulation
from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.control.observer import ObserverTuning
from stiction_ros.control.result import ControlMode
from stiction_ros.control.strategies import FallbackRule
from stiction_ros.control.unaware import InversionMpc, UnawareMpc
from stiction_ros.effects.behaviour import Behaviour, FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

OtherFormulation = Callable[[ControlMode, UnawareMpc, Sequence[Behaviour | None]], Formulation]
ROUNDING = 1e-9  # of a rate limit, by which a kick may exceed it


@dataclasses.dataclass(frozen=True)
class ControlDesign:
    """Everything a controller is built from, apart from the friction."""

    model: LinearModel  # the process
    limits: HorizonLimits  # bounds; outputs are soft
    unaware: HorizonWeights  # unaware, embedding: weights of (19a) for either formulation
    embedding: HorizonWeights
    target_weights: FloatArray  # Q_ss, shape (p,)
    observer: ObserverTuning  # observer tuning
    jumps: EmbeddingTuning = EmbeddingTuning()  # how sticky valves are moved
    hand_over_samples: int = 200  # past samples replayed into the observer of a new controller
    fallback: FallbackRule = FallbackRule()  # how long a strategy other than the first may stand in
    slip_check: bool = True  # whether jumps are watched by a second observer
    longest_wait: int = 0  # samples for which a jump waits for a resting disturbance estimate
    gap_samples: int = 0  # free samples of the optimality gap of each step; 0 leaves it out
    valve_names: tuple[str, ...] = ()  # valve_names, output_names: for messages; or numbers
    output_names: tuple[str, ...] = ()
    # makes embedding or inversion in place of the exact ones, of its mode, of the unaware
    # formulation and of the friction of each valve, None for a healthy one; None for these
    others: OtherFormulation | None = None

    def without_rates(self) -> "ControlDesign":
        """Return the design without rate limits, for a controller that moves nothing."""
        free = np.full_like(self.limits.move, np.inf)
        return dataclasses.replace(self, limits=dataclasses.replace(self.limits, move=free))


@dataclasses.dataclass(frozen=True)
class History:
    """Past samples in order: OP (K, m), PV (K, p), NaN where missing, disturbances (K, d)."""

    op: FloatArray
    pv: FloatArray
    dv: FloatArray


def formulation_of(
    mode: ControlMode, design: ControlDesign, unaware: UnawareMpc, valves: ValveBeliefs
) -> Formulation | None:
    """Return the formulation of ``mode``; None for ``hold``, which plans nothing.

    Raises:
        InputError: the formulation cannot be set up for these valves, or the rate limit of an OP
            is below what the smallest jump of its valve takes.
    """
    known, others = valves.frictions, design.others
    if mode is ControlMode.HOLD:
        return None
    if mode not in (ControlMode.EMBEDDING, ControlMode.INVERSION):
        return unaware
    if others is not None:
        return others(mode, unaware, known)
    made: EmbeddingMpc | InversionMpc = InversionMpc(unaware, known)
    if mode is ControlMode.EMBEDDING:
        weights, spreads = design.embedding, valves.spreads
        made = EmbeddingMpc(design.model, weights, design.limits, known, design.jumps, spreads)
    _check_rates(design, made.least_kicks)
    return made


def _check_rates(design: ControlDesign, kicks: Sequence[float]) -> None:
    """Raise InputError where OP may not move by the ``kicks`` (m,), %, that its valve needs."""
    for j, (kick, limit) in enumerate(zip(kicks, design.limits.move, strict=True)):
        if kick > limit * (1.0 + ROUNDING):
            name = design.valve_names[j] if design.valve_names else f"valve {j + 1}"
            enough = math.ceil(100.0 * kick) / 100.0
            way_out = "leave the controller unaware (mode: unaware)"
            raise InputError(
                f"{limit:g} % per sample is less than the kick that moves {name}, {kick:.3g} %",
                where="op_rate_limits",
                fix=f"raise it to at least {enough:g}, or {way_out}",
            )
