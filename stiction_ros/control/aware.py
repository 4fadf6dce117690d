"""How formulations that know the friction are made where they are not those of this package."""

from __future__ import annotations

import abc
from collections.abc import Sequence

from stiction_ros.control.formulation import Formulation
from stiction_ros.control.horizon import HorizonLimits
from stiction_ros.control.unaware import UnawareMpc
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.processes import LinearModel


class AwareFormulations(abc.ABC):
    """Makes an embedding and an inversion that stand in place of the exact ones."""

    @abc.abstractmethod
    def embedding(
        self, model: LinearModel, limits: HorizonLimits, frictions: Sequence[Behaviour | None]
    ) -> Formulation:
        """Return what embeds the friction.

        Args:
            model: the process.
            limits: bounds; outputs are soft.
            frictions: of the m valves, None for a healthy one.

        Raises:
            InputError: it cannot be set up for these valves.
        """

    @abc.abstractmethod
    def inversion(self, unaware: UnawareMpc, frictions: Sequence[Behaviour | None]) -> Formulation:
        """Return what inverts the friction.

        Args:
            unaware: the formulation without friction, which it is built upon.
            frictions: of the m valves, None for a healthy one.

        Raises:
            InputError: it cannot be set up for these valves.
        """
