"""How the switching patterns of a friction law are listed, so that a search can be exact.

The exact search refuses a law that says nothing of them; the default search takes any law.
"""

from __future__ import annotations

import dataclasses

from stiction_ros.effects.friction.moving_rules import MovingRules


@dataclasses.dataclass(frozen=True)
class SlipCells:
    """He's law: a rectangle of the plane of J and S for each pattern of slips."""


@dataclasses.dataclass(frozen=True)
class MovingCells:
    """A law with a moving state: rectangles as well, by rules of its own.

    Attributes:
        rules: when the valve moves, stops and slips.
    """

    rules: type[MovingRules]


Switching = SlipCells | MovingCells
