"""The ways of data: which packages three fixed calls enter, in order, and by which functions.

Run from anywhere: ``python tools/ways.py``. A package is entered where a function of another
package calls one of its own; what is counted are the different functions through which that
happens, as a loop over samples may enter one function a thousand times.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import stiction_ros as st

PACKAGE = Path(st.__file__).resolve().parent
BASE = "base"  # modules that stand beside the packages


class Ways:
    """Packages entered while it is switched on.

    Attributes:
        doors: package to the functions by which it was entered, both in the order of entry.
    """

    def __init__(self) -> None:
        self.doors: dict[str, list[str]] = {}
        self._packages: dict[str, str] = {}

    def __enter__(self) -> Ways:
        threading.setprofile(self._look)
        sys.setprofile(self._look)
        return self

    def __exit__(self, *_: object) -> None:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]

    def _look(self, frame: FrameType, event: str, _argument: Any) -> None:
        if event != "call":
            return
        package = self._package(frame.f_code.co_filename)
        name = frame.f_code.co_qualname
        if not package or name == "<module>":
            return
        caller = frame.f_back
        while caller is not None and not self._package(caller.f_code.co_filename):
            caller = caller.f_back
        if caller is None:  # the call itself, a thread of its own, or compiled code
            if self.doors:
                return
        elif self._package(caller.f_code.co_filename) == package:
            return
        doors = self.doors.setdefault(package, [])
        if name not in doors:
            doors.append(name)

    def _package(self, file: str) -> str:
        """Return the package of a file, empty for what is not of this package."""
        if file not in self._packages:
            path = Path(file)
            inside = path.is_relative_to(PACKAGE)
            parts = path.relative_to(PACKAGE).parts if inside else ()
            self._packages[file] = parts[0] if len(parts) > 1 else BASE if parts else ""
        return self._packages[file]


def calls(samples: int) -> dict[str, Callable[[], object]]:
    """Return the three calls by name, everything they need made beforehand."""
    from stiction_ros.online.live_controller import LiveController

    model = st.LoopModel.load(st.find_config("flow.loop.yaml"))
    moves = st.SetPoints.load(st.find_config("flow.set_points.yaml"), model.outputs)
    record = st.simulate(model, moves, samples)
    options = st.IdentificationOptions(output_order=1, delay=(2, 2))
    ideal, quick = model.with_ideal_valves(), st.GapOptions(quick=True)
    scenario = st.Scenario.load(st.find_config("siso.scenario.yaml"))
    controller = LiveController(scenario.controller, scenario.process)
    pv, dv = scenario.process.pv_start, record.pv[0, :0]
    controller.step(pv, pv, dv)  # the first of a run does more than the others
    return {
        "identify(record)": lambda: st.identify(record, options),
        "LiveController.step(pv, sp)": lambda: controller.step(pv, pv + 1.0, dv),
        "find_gap(model, [record])": lambda: st.find_gap(ideal, [record], quick),
    }


def ways_of(call: Callable[[], object]) -> dict[str, list[str]]:
    """Return what a call enters; it is run once before, so that nothing is left to load."""
    call()
    with Ways() as ways:
        call()
    return ways.doors


def main(given: list[str] | None = None) -> int:
    """Print the three ways; see the module."""
    parser = argparse.ArgumentParser(description="Which packages three calls enter.")
    parser.add_argument("--samples", type=int, default=400, metavar="N", help="of the record (400)")
    parser.add_argument("--doors", action="store_true", help="name the functions, too")
    options = parser.parse_args(given)
    for name, call in calls(options.samples).items():
        doors = ways_of(call)
        print(f"{name}\n    " + ", ".join(f"{p} {len(found)}" for p, found in doors.items()))
        for package, found in doors.items() if options.doors else ():
            print(f"      {package}: {', '.join(found)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
