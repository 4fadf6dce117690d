"""Is it the valve? A loop cycles, and the historian has its OP and PV.

For control engineers. Run it on your own file: python examples/01_is_it_the_valve.py loop.csv
"""

import sys
from pathlib import Path

from stiction_ros import LoopModel, find_config, identify, read, simulate, write_csv


def main(path: Path | None = None, samples: int = 2000) -> None:
    """Identify the record ``path``; without one, a simulated flow loop whose valve sticks."""
    if path is None:
        path = Path("flow.csv")
        write_csv(simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=samples), path)
    found = identify(read(path))  # columns t, OP, PV[, SP]; gaps: the longest good part
    for valve in found.valves:
        low, high = valve.static_interval
        print(f"{valve.name}: {valve.verdict}, law {valve.law}")
        print(f"  static friction f_S {valve.static_friction:.2f} % ({low:.2f} to {high:.2f})")
        print(f"  dynamic friction f_D {valve.dynamic_friction:.2f} %")
    for output in found.outputs:
        print(f"{output.name}: {output.fit_free_run:.0f} % of its movement is explained")
        if output.cause is not None:
            print(f"  {output.cause.sentence}")
    for note in found.notes:
        print(f"note: {note}")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
