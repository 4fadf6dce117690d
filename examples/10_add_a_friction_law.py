"""A friction law of your own: a stem that creeps on before it rests.

For researchers. What it takes today, and what does not work from outside yet:

- to simulate: the class below, named in ``effects.BEHAVIOURS``. Loop models, plants, the nodes
  and ``stiction simulate`` then know it by its name in YAML.
- to be found: nothing. ``identify`` fits the laws it knows; He's is the nearest here, and its
  figures are those of an equivalent valve, not the parameters of this law.
- to identify its own parameters: the package has to be changed. The law must simulate whole
  grids and stand in ``LAWS`` of identification, which searches two parameters, no third; the
  certificate of the search holds for laws whose switching patterns it knows, no others.
- to control with it: the package has to be changed, embedding needs the law's smallest jump.
"""

from __future__ import annotations

import dataclasses
from typing import ClassVar

from stiction_ros import Behaviour, LoopModel, effects, find_config, identify, simulate
from stiction_ros.effects.behaviour import Memory, parameter


@dataclasses.dataclass(frozen=True)
class CreepingStiction(Behaviour):
    """Sticks within f_S of OP; once it slips it goes the share ``creep`` of the way a sample."""

    effect: ClassVar[str] = "stiction"
    law: ClassVar[str | None] = "creeping"
    places: ClassVar[tuple[str, ...]] = ("valve",)

    static_friction: float = parameter("f_s", "%", "static friction band f_S", low=0.0)
    dynamic_friction: float = parameter("f_d", "%", "dynamic friction f_D", low=0.0)
    creep: float = parameter("creep", "1", "share of the way done a sample", low=0.01, high=1.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        """Return the stem, and as memory the stem and where it is going, %."""
        stem, goal = memory if isinstance(memory, tuple) else (memory, memory)
        error = value - stem
        if abs(error) > self.static_friction:
            goal = value - self.dynamic_friction * (1.0 if error > 0.0 else -1.0)
        stem += self.creep * (goal - stem)
        return (stem, goal), stem


def main(samples: int = 2000) -> None:
    """Register the law, simulate a loop that has it, and see what He's law makes of it."""
    effects.BEHAVIOURS = (*effects.BEHAVIOURS, CreepingStiction)
    model = LoopModel.load(find_config("flow.loop.yaml"))
    sticky = model.with_valve_effects({"V1": (CreepingStiction(4.0, 1.5, 0.7),)})
    print(sticky.to_mapping()["valves"][0]["effects"])
    valve = identify(simulate(sticky, samples=samples)).valves[0]
    print(f"{valve.verdict}: as law {valve.law} f_S {valve.static_friction:.2f} %", end=", ")
    print(f"f_D {valve.dynamic_friction:.2f} % (true of this law: 4 and 1.5, creep 0.7)")


if __name__ == "__main__":
    main()
