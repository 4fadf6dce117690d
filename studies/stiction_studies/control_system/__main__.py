"""Run the simulated plant as a process: ``python -m stiction_studies.control_system FILE``."""

import asyncio
import dataclasses
import os
import signal
import sys
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, PiTuning, SetPoints
from stiction_ros.loop.yaml_reading import Section, load_yaml
from stiction_ros.opcua import require_asyncua
from stiction_ros.opcua.security import check_secret_file
from stiction_ros.orphans import DIE_WITH_PARENT, die_with_parent
from stiction_studies.control_system.control_system import ControlSystem, Tunings


def main() -> int:
    """Serve until SIGINT or SIGTERM; return 2 for a file that cannot be used."""
    try:
        require_asyncua()
        if len(sys.argv) != 2:
            raise InputError("one file is needed", fix="name the plant's *.yaml")
        asyncio.run(_serve(Path(sys.argv[1])))
    except InputError as error:
        print(f"plant: {error}", file=sys.stderr)
        return 2
    return 0


async def _serve(path: Path) -> None:
    from stiction_studies.control_system.server import Account, PlantServer, ServerSettings

    check_secret_file(path)  # it holds the passwords
    top = Section(load_yaml(path), str(path))
    model = LoopModel.load(top.text("model"))
    if "out" in top:  # the OPs that were in force when the controllers stopped
        start = np.array(top.numbers("out", [], count=len(model.valves)))
        model = dataclasses.replace(model, stem_start=start)
    schedule = None
    if "set_points" in top:
        schedule = SetPoints.load(top.text("set_points"), model.outputs)
    pi = [
        PiTuning(one.number("gain"), one.number("integral_time", above=0.0))
        for one in top.sections("pi")
    ]
    if len(pi) != len(model.valves) or len(pi) != len(model.outputs):
        raise InputError("one PI for each valve and output is needed", where=f"{path}: pi")
    tunings = Tunings(tuple(pi), top.number("watchdog", above=0.0))
    accounts = {}
    for one in top.sections("accounts"):
        writes = frozenset(str(right) for right in one.raw("writes"))
        accounts[one.text("name")] = Account(one.text("password"), writes)
    settings = ServerSettings(
        top.integer("port", low=1),
        Path(top.text("certificate")),
        Path(top.text("private_key")),
        Path(top.text("trusted")),
        accounts,
        top.number("speed", above=0.0),
        top.integer("start"),
        Path(top.text("journal")) if "journal" in top else None,
        top.raw("history", False),
    )
    seed = top.integer("seed")
    top.finish()
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    if os.environ.get(DIE_WITH_PARENT):
        die_with_parent(signal.SIGTERM, int(os.environ[DIE_WITH_PARENT]))
    await PlantServer(ControlSystem(model, schedule, tunings, seed), settings).run(stop)


if __name__ == "__main__":
    sys.exit(main())
