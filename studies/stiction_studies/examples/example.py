"""One record whose truth is known."""

import dataclasses

from stiction_ros.effects import HeStiction
from stiction_ros.identification import IdentificationOptions
from stiction_ros.loop import LoopModel
from stiction_ros.processes import ArxProcess
from stiction_ros.records import Record


@dataclasses.dataclass(frozen=True)
class Example:
    """A simulated record, the loop behind it, and how it is to be identified.

    Attributes:
        name: ``example1``, ``example2``, ``coupled`` or ``healthy``.
        variant: where the noise enters, which plant, how many valves, or which family.
        seed: of the noise, and of the whole loop in a family.
        record: OP, PV, SP and the true stem positions.
        truth: the simulated loop; all its frictions follow He's law.
        options: orders and delays to identify with.
    """

    name: str
    variant: str
    seed: int
    record: Record
    truth: LoopModel
    options: IdentificationOptions

    def friction(self, valve: str) -> tuple[float, float]:
        """Return the true (f_S, f_D) of a valve, %; (0, 0) for an ideal one."""
        effects = self.truth.valves[self.truth.valve_names.index(valve)].effects
        for effect in effects:
            if isinstance(effect, HeStiction):
                return effect.static_friction, effect.dynamic_friction
        return 0.0, 0.0

    def delay(self, output: str, valve: str) -> int:
        """Return the true t_d of a channel, samples; 0 for a process without delays."""
        process = self.truth.process
        if not isinstance(process, ArxProcess):
            return 0
        equation = process.equations[process.outputs.index(output)]
        return equation.delay.get(valve, 0)
