"""Parameters that change in mid-run, clocks, orders of starting, and storage."""

import math
import resource
import shutil
import subprocess
import sys
from collections.abc import Mapping
from typing import Any

from stiction_studies.faults.fault import Fault, nothing
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.terms import Bag, Notice, Pace, Phase

REALTIME = (Pace.REALTIME,)
FULL = 4.0  # s
BUSY = 6.0  # s
TUNINGS: tuple[Mapping[str, Any], ...] = (
    {"move_weights": [0.2], "move_worth": [0.003]},
    {"horizon": 50},
    {"jump_margin": 0.4},
    {"outlier_gate": 15.0},
    {"horizon": 60},
    {"move_weights": [0.1], "move_worth": [0.0025]},
    {"jump_margin": 0.3},
    {"outlier_gate": 20.0},
)
REFUSED: tuple[Mapping[str, Any], ...] = (
    {"horizon": 1},
    {"horizon": 10**6},
    {"horizon": 3},
    {"output_weights": [1.0, 2.0, 3.0]},
    {"op_low": [120.0]},  # above op_high; of two at once the first alone might be possible
    {"move_weights": [-1.0]},
    {"move_weights": [math.nan]},
    {"mode": "asleep"},
    {"model": "other.loop.yaml"},
    {"pace": "soon"},
    {"horizon": "sixty"},
)


def tune(loop: RunningLoop) -> None:
    """Change tunings and change them back."""
    for _ in range(2):
        for values in TUNINGS:
            taken = loop.probe.set_parameters("controller", values)
            if not taken or not all(taken):
                loop.remark(f"the controller did not take {dict(values)}")
            loop.wait(0.1)


def refused(loop: RunningLoop) -> None:
    """Ask for what cannot be."""
    for values in REFUSED:
        taken = loop.probe.set_parameters("controller", values)
        if all(taken):  # none: it has not answered
            loop.remark(f"the controller {'took' if taken else 'did not answer'} {dict(values)}")


def flip_modes(loop: RunningLoop) -> None:
    """Go through all modes and back."""
    for mode in ("unaware", "hold", "auto", "hold", "unaware", "auto"):
        if loop.probe.set_parameters("controller", {"mode": mode}) != [True]:
            loop.remark(f"the controller did not take mode {mode}")
        loop.wait(0.5)


def simulated_time(loop: RunningLoop) -> None:
    """Switch every node to simulated time and back."""
    for value in (True, False):
        for name in ("controller", "estimator", "plant", "recorder"):
            if loop.probe.set_parameters(name, {"use_sim_time": value}) != [True]:
                loop.remark(f"{name} did not take use_sim_time")
        loop.wait(2.0)


def busy_machine(loop: RunningLoop) -> None:
    """Keep one core busy."""
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        loop.wait(BUSY)
    finally:
        process.kill()
        process.wait()


def disk_full(loop: RunningLoop) -> None:
    """Let no file of the recorder grow any more, for a while, as a full disk does."""
    recorder = loop.nodes["recorder"].pid
    soft, hard = resource.prlimit(recorder, resource.RLIMIT_FSIZE)
    resource.prlimit(recorder, resource.RLIMIT_FSIZE, (1, hard))
    loop.wait(FULL)
    resource.prlimit(recorder, resource.RLIMIT_FSIZE, (soft, hard))


def bag_deleted(loop: RunningLoop) -> None:
    """Delete the bag while it is written."""
    shutil.rmtree(loop.bag)
    loop.wait(FULL)


SIMULATED = {"use_sim_time": True}
ALONE: Mapping[str, Any] = {"wait_for": []}
NODES = ("plant", "controller", "estimator", "recorder")

FAULTS = (
    Fault(
        "parameters-changed",
        "weights, horizon, margin and gate change from one sample to the next without a jump",
        tune,
        forgets=False,
    ),
    Fault(
        "parameters-refused",
        "an impossible value is refused; the old value stays in force",
        refused,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "modes-flipped",
        "every change of mode is bumpless; auto goes back to what was known",
        flip_modes,
    ),
    Fault(
        "simulated-time-on-the-controller",
        "use_sim_time on the controller alone changes nothing",
        nothing,
        phases=(Phase.BEFORE,),
        from_start=True,
        silence=math.inf,
        parameters={"controller": SIMULATED},
    ),
    Fault(
        "simulated-time-on-all",
        "use_sim_time on every node changes nothing",
        nothing,
        phases=(Phase.AFTER,),
        from_start=True,
        silence=math.inf,
        parameters=dict.fromkeys(NODES, SIMULATED),
    ),
    Fault(
        "simulated-time-switched",
        "use_sim_time that is switched on and off in mid-run changes nothing",
        simulated_time,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "nobody-waits",
        "nodes that start without wait_for, in any order, find each other",
        nothing,
        from_start=True,
        silence=math.inf,
        parameters=dict.fromkeys(NODES, ALONE),
        bag=Bag.READABLE,
    ),
    Fault(
        "busy-machine",
        "another process keeps one core busy: the control goes on",
        busy_machine,
        REALTIME,
    ),
    Fault(
        "disk-full",
        "the control goes on; the recorder says so and records again when there is room",
        disk_full,
        phases=(Phase.AFTER,),
        notices=(Notice("recorder", "error"),),
        bag=Bag.READABLE,
    ),
    Fault(
        "bag-deleted",
        "the control goes on; the recorder says so",
        bag_deleted,
        phases=(Phase.AFTER,),
        notices=(Notice("recorder", "error", stays=True),),
        bag=Bag.LOST,
    ),
)
