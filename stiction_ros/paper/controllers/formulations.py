"""The paper's embedding and inversion in place of the exact ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from stiction_ros.control.aware import AwareFormulations
from stiction_ros.control.horizon import HorizonLimits
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.paper.controllers.embedding import PrintedEmbeddingMpc
from stiction_ros.paper.controllers.inversion import PrintedInversionMpc
from stiction_ros.paper.controllers.weights import PaperTuning
from stiction_ros.processes import LinearModel


@dataclasses.dataclass(frozen=True)
class PrintedFormulations(AwareFormulations):
    """The formulations of Section 4.2 to the letter; ``tuning`` is that of the embedding."""

    tuning: PaperTuning

    def embedding(
        self, model: LinearModel, limits: HorizonLimits, frictions: Sequence[Behaviour | None]
    ) -> PrintedEmbeddingMpc:
        return PrintedEmbeddingMpc(model, self.tuning, limits, frictions)

    def inversion(
        self, unaware: UnawareMpc, frictions: Sequence[Behaviour | None]
    ) -> PrintedInversionMpc:
        return PrintedInversionMpc(unaware, frictions)
