"""The paper's embedding and inversion in place of the exact ones."""

from __future__ import annotations

from collections.abc import Sequence

from stiction_ros.control.formulation import Formulation
from stiction_ros.control.result import ControlMode
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.paper.controllers.embedding import PrintedEmbeddingMpc
from stiction_ros.paper.controllers.inversion import PrintedInversionMpc
from stiction_ros.paper.controllers.weights import PaperTuning


def as_printed(
    tuning: PaperTuning,
    mode: ControlMode,
    unaware: UnawareMpc,
    frictions: Sequence[Behaviour | None],
) -> Formulation:
    """Return the formulation of Section 4.2 to the letter; ``tuning`` is that of the embedding.

    The others are as :attr:`~stiction_ros.control.design.ControlDesign.others` is called.
    """
    if mode is ControlMode.EMBEDDING:
        return PrintedEmbeddingMpc(unaware.cost.model, tuning, unaware.limits, frictions)
    return PrintedInversionMpc(unaware, frictions)
