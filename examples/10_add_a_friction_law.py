"""A friction law of your own: a stem that is harder to close than to open.

For researchers. This file *is* the law. Lay it into a folder that the environment variable
STICTION_EFFECTS names, or into a package with an entry point of ``stiction_ros.effects``, and
every command and node knows it: ``stiction identify record.csv --law lopsided``. A script, as
here, calls ``effects.register``. Parameters and ``step`` are all that it needs. What is left
out is said, never guessed:

- ``simulate_grid``: whole grids at once. Without it every row is stepped, slowly.
- ``switching``: its patterns. Without it the method ``exact`` refuses the law.
- ``jump_form``: its moves between rests. Without it no controller plans for it, and says why.
- ``axes``: on what ``stiction gap`` searches it. Without it gap lists it as not considered.
"""

import dataclasses
from typing import ClassVar

import numpy as np

import stiction_ros as sr
from stiction_ros import effects


@dataclasses.dataclass(frozen=True)
class LopsidedStiction(effects.FrictionPair):
    """He's law with another static friction, ``closing`` times as large, where OP falls."""

    law: ClassVar[str | None] = "lopsided"
    closing: float = effects.parameter("closing", "1", "f_S closing / opening", low=0.5, high=3.0)

    def step(self, memory, value, time=0.0):  # type: ignore[no-untyped-def]
        """Return the stem position twice, as memory and as output."""
        if value - memory > self.static_friction:
            memory = value - self.dynamic_friction
        elif value - memory < -self.closing * self.static_friction:
            memory = value + self.dynamic_friction
        return memory, memory

    @classmethod
    def simulate_grid(cls, grid, values, start, sample_time=1.0):  # type: ignore[no-untyped-def]
        """Return stems, shape (N, G), for rows (f_S, f_D, closing)."""
        static, dynamic, closing = grid.T
        stem, out = np.full(len(grid), 1.0) * start, np.empty((len(values), len(grid)))
        for k, value in enumerate(values):
            error = value - stem
            np.copyto(stem, value - dynamic, where=error > static)
            np.copyto(stem, value + dynamic, where=error < -closing * static)
            out[k] = stem
        return out


def main(samples: int = 2000) -> None:
    """Simulate a loop that has the law, identify all three parameters, and ask for control."""
    effects.register(LopsidedStiction)
    model = sr.LoopModel.load(sr.find_config("flow.loop.yaml"))
    sticky = model.with_valve_effects({"V1": (LopsidedStiction(4.0, 1.5, 1.4),)})
    moves = sr.SetPoints.load(sr.find_config("flow.set_points.yaml"), model.outputs)
    record = sr.simulate(sticky, moves, samples=samples)
    found = sr.identify(record, sr.IdentificationOptions(law="lopsided"))
    law, design = found.valves[0].behaviour(), sr.ControlSettings().design(model)
    print(found.valves[0].verdict, law, *found.notes, sep="\n")
    try:
        sr.MpcController(design, sr.ControlMode.EMBEDDING, [law])
    except sr.InputError as error:
        print(error)


if __name__ == "__main__":
    main()
