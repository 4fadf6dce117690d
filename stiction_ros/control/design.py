"""What a controller is built from, and the past that it can take over."""

from __future__ import annotations

import dataclasses

from stiction_ros.control.embedding import EmbeddingTuning
from stiction_ros.control.horizon import HorizonLimits, HorizonWeights
from stiction_ros.control.observer import ObserverTuning
from stiction_ros.control.paper_weights import PaperTuning
from stiction_ros.control.strategies import FallbackRule
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.processes import LinearModel


@dataclasses.dataclass(frozen=True)
class ControlDesign:
    """Everything a controller is built from, apart from the friction.

    Attributes:
        model: the process.
        limits: bounds; outputs are soft.
        unaware, embedding: weights of (19a) for either formulation.
        target_weights: Q_ss, shape (p,).
        observer: observer tuning.
        jumps: how sticky valves are moved.
        hand_over_samples: past samples replayed into the observer of a new controller.
        fallback: how long a strategy other than the first may stand in.
        slip_check: whether jumps are watched by a second observer.
        gap_samples: free samples of the optimality gap of each step; 0 leaves it out.
        valve_names, output_names: for messages; numbers stand in where empty.
        paper: the paper's own embedding and inversion; None for those of this package.
    """

    model: LinearModel
    limits: HorizonLimits
    unaware: HorizonWeights
    embedding: HorizonWeights
    target_weights: FloatArray
    observer: ObserverTuning
    jumps: EmbeddingTuning = EmbeddingTuning()
    hand_over_samples: int = 200
    fallback: FallbackRule = FallbackRule()
    slip_check: bool = True
    gap_samples: int = 0
    valve_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()
    paper: PaperTuning | None = None


@dataclasses.dataclass(frozen=True)
class History:
    """Past samples in order: OP (K, m), PV (K, p), NaN where missing, disturbances (K, d)."""

    op: FloatArray
    pv: FloatArray
    dv: FloatArray
