"""What a controller asks of a formulation, whichever it is."""

import abc

from stiction_ros.control.belief import ValveBeliefs
from stiction_ros.control.result import ControlMode, Plan
from stiction_ros.control.target import Target
from stiction_ros.effects.behaviour import FloatArray


class Formulation(abc.ABC):
    """One way to turn an estimate and a target into a plan.

    In every sample :meth:`learn` comes first, then :meth:`plan` is asked. One that has nothing to
    learn or to prepare has a plan only.
    """

    mode: ControlMode  # what it does about the friction
    # valves that it cannot move, by their numbers: their targets are where they are
    immobile: tuple[int, ...] = ()
    # whether stems at rest are to stay in this sample where that is feasible; who plans no jumps
    # takes no notice of it
    waits: bool = False

    def learn(self, valves: ValveBeliefs, stem: FloatArray) -> None:  # noqa: B027
        """Take over what is believed of the m valves, and their stems, (m,), %, for later."""

    @abc.abstractmethod
    def plan(self, state: FloatArray, target: Target, last: FloatArray) -> Plan | None:
        """Return a plan from ξ̂, (n,), and the last stems, (m,), %, to ``target``, or None."""

    def optimality_gap(
        self, state: FloatArray, target: Target, last: FloatArray, plan: Plan, samples: int
    ) -> float | None:
        """Return the cost of ``plan`` above the optimum as a share of it, None where unknown.

        The optimum is free in the first ``samples`` of the horizon.
        """
        return None
