"""The ways of data: which packages three fixed calls enter, in order, and by which doors.

Run from anywhere: ``python tools/ways.py``. A package is entered where a function of another
package calls one of its own. What is counted are doors, as a loop over samples may enter one
function a thousand times: a door is a name, so a method that several classes override is one
door, named after the base that they share.

No package should have more than ``MOST`` doors in one call. Those that have more stand in
``REASONS``, are printed with their doors, and the script fails where a reason is missing, empty
or no longer needed.
"""

import argparse
import os
import sys
import textwrap
import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import stiction_ros as st

PACKAGE = Path(st.__file__).resolve().parent
BASE = "base"  # modules that stand beside the packages
WIDTH = 98  # of the lines that are printed
MOST = 2  # doors of a package in one call
IDENTIFY, STEP, GAP = "identify(record)", "LiveController.step(pv, sp)", "find_gap(model, [record])"
REASONS: dict[str, dict[str, str]] = {
    IDENTIFY: {
        "records": "a record tells of itself: how long it is, what it is good for, its parts",
        "effects": "which laws there are, their parameters, and grids of frictions at once",
        "signals": "what is computed of one signal is a function each: noise, lines, cycles, runs",
        "base": "what SciPy has in packages that load slowly is called where it is loaded late; "
        "what an argument may be is checked in one place; how many threads there are is nobody's "
        "floor",
    },
    GAP: {
        "records": "a record tells of itself: how long it is, which of its samples were measured",
        "loop": "a loop model tells its tags and limits, and takes in the effect that is named",
        "processes": "the process as a linear model, and made anew with each effect taken in",
        "signals": "what is computed of one signal is a function each: noise, stretches",
        "effects": "what a search asks of an effect is said in the file of the effect alone: axes, "
        "sizes, waves, whole grids, YAML",
        "base": "what SciPy has in packages that load slowly is called where it is loaded late; "
        "what an argument may be is checked in one place; how many threads there are is nobody's "
        "floor",
    },
}


class Ways:
    """Packages entered while it is switched on.

    Attributes:
        doors: package to the names by which it was entered, both in the order of entry.
    """

    def __init__(self) -> None:
        self.doors: dict[str, list[str]] = {}
        self._packages: dict[str, str] = {}
        self._names: dict[CodeType, str] = {}

    def __enter__(self) -> "Ways":
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
        if not package or frame.f_code.co_qualname == "<module>":
            return
        caller = frame.f_back
        while caller is not None and not self._package(caller.f_code.co_filename):
            caller = caller.f_back
        if caller is None:  # the call itself, a thread of its own, or compiled code
            if self.doors:
                return
        elif self._package(caller.f_code.co_filename) == package:
            return
        doors, name = self.doors.setdefault(package, []), self._name(frame)
        if name not in doors:
            doors.append(name)

    def _name(self, frame: FrameType) -> str:
        """Return the name of a function, that of a method by the first base that has it."""
        code = frame.f_code
        if code not in self._names:
            owner, _, name = code.co_qualname.partition(".")
            kind = frame.f_globals.get(owner)
            bases = kind.__mro__ if isinstance(kind, type) else ()
            having = [base for base in bases if name in vars(base) and _is_ours(base)]
            self._names[code] = f"{having[-1].__name__}.{name}" if having else code.co_qualname
        return self._names[code]

    def _package(self, file: str) -> str:
        """Return the package of a file, empty for what is not of this package."""
        if file not in self._packages:
            path = Path(file)
            inside = path.is_relative_to(PACKAGE)
            parts = path.relative_to(PACKAGE).parts if inside else ()
            self._packages[file] = parts[0] if len(parts) > 1 else BASE if parts else ""
        return self._packages[file]


def _is_ours(kind: type) -> bool:
    return kind.__module__.partition(".")[0] == st.__name__


def calls(samples: int) -> dict[str, Callable[[], object]]:
    """Return the three calls by name, everything they need made beforehand."""
    from stiction_ros.online.controller.live import LiveController

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
        IDENTIFY: lambda: st.identify(record, options),
        STEP: lambda: controller.step(pv, pv + 1.0, dv),
        GAP: lambda: st.find_gap(ideal, [record], quick),
    }


def ways_of(call: Callable[[], object]) -> dict[str, list[str]]:
    """Return what a call enters; it is run once before, so that nothing is left to load."""
    call()
    with Ways() as ways:
        call()
    return ways.doors


def complaints(
    call: str, doors: Mapping[str, Sequence[str]], reasons: Mapping[str, str]
) -> list[str]:
    """Return what is wrong: too many doors without a reason, and reasons that nothing needs.

    Args:
        call: its name.
        doors: of each package that it enters.
        reasons: why a package has more than ``MOST`` of them.
    """
    many = {package: len(found) for package, found in doors.items() if len(found) > MOST}
    said = [
        f"{call} enters {package} by {count} doors, and no reason is given"
        for package, count in many.items()
        if not reasons.get(package, "").strip()
    ]
    stale = [package for package in reasons if package not in many]
    return said + [f"{call} enters {package} by no more than {MOST} doors" for package in stale]


def main(given: list[str] | None = None) -> int:
    """Print the three ways; see the module.

    Returns:
        0, or 1 where a package has too many doors without a reason, or a reason without need.
    """
    parser = argparse.ArgumentParser(description="Which packages three calls enter.")
    parser.add_argument("--samples", type=int, default=400, metavar="N", help="of the record (400)")
    parser.add_argument(
        "--doors", action="store_true", help="name all doors, not only those of the exceptions"
    )
    options = parser.parse_args(given)
    wrong: list[str] = []
    for name, call in calls(options.samples).items():
        doors, reasons = ways_of(call), REASONS.get(name, {})
        print(f"{name}\n    " + ", ".join(f"{p} {len(found)}" for p, found in doors.items()))
        for package, found in doors.items():
            if options.doors or package in reasons:
                _print_wrapped(f"{package}: {', '.join(found)}", 6)
            if package in reasons:
                _print_wrapped(f"because {reasons[package]}", 8)
        wrong += complaints(name, doors, reasons)
    for said in wrong:
        print(said, file=sys.stderr)
    return 1 if wrong else 0


def _print_wrapped(said: str, indent: int) -> None:
    first, later = " " * indent, " " * (indent + 4)
    print(textwrap.fill(said, WIDTH, initial_indent=first, subsequent_indent=later))


if __name__ == "__main__":
    sys.exit(main())
