"""The loop that the faults are put into, and the parameters of its nodes."""

import functools
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from stiction_ros.cli.shared.scenarios import find, node_parameters
from stiction_ros.loop import LoopModel
from stiction_ros.settings import settings_of
from stiction_studies.faults.terms import Pace

if TYPE_CHECKING:
    from stiction_ros.online.session import Scenario

SCENARIO = "siso"
NAMES = ("plant", "controller", "estimator", "recorder")
NEVER = 10**7  # samples before the first fit: a prepared model stands in for it
HAND_OVER = 100  # samples of the past that a new controller needs
WARM_UP = 40  # samples before anything is done
SETTLING = 40  # samples after the swap


@functools.cache
def scenario() -> "Scenario":
    """Return the scenario of the suite."""
    from stiction_ros.online.session import Scenario

    return Scenario.load(find(SCENARIO))


def plant_model() -> LoopModel:
    """Return the loop model that the plant simulates: also the prepared one."""
    return scenario().plant


class Asked(Protocol):
    """What a fault asks of the loop before the nodes start."""

    @property
    def parameters(self) -> Mapping[str, Mapping[str, Any]]:
        """Parameters of nodes, in place of the usual ones."""
        ...

    @property
    def relayed(self) -> tuple[str, ...]:
        """Topics that go through the suite."""
        ...


def case_parameters(
    fault: Asked, pace: Pace, seed: int, speed: float, bag: Path
) -> dict[str, dict[str, Any]]:
    """Return the parameters of the four nodes for one case.

    Args:
        fault: which may change some of them.
        pace: of the loop.
        seed: of the plant's noise.
        speed: simulated seconds per second of realtime pace.
        bag: directory of the bag.
    """
    from stiction_ros.online.session import NODE_SETTINGS

    nodes = node_parameters(find(SCENARIO), bag.parent)
    nodes["plant"].update(seed=seed, samples=0)
    nodes["controller"].update(hand_over_samples=HAND_OVER, fit_first=NEVER)
    nodes["estimator"].update(fit_first=NEVER)
    nodes["recorder"]["directory"] = str(bag.resolve())
    for name, values in nodes.items():
        known = {entry.name for entry in settings_of(NODE_SETTINGS[name])}
        shared = {"pace": pace.value, "speed": speed if pace is Pace.REALTIME else 1.0}
        values.update({key: value for key, value in shared.items() if key in known})
        if fault.relayed:
            values["wait_for"] = []  # the suite stands between them
        values.update(fault.parameters.get(name, {}))
    return nodes
