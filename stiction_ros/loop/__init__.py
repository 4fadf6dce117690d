"""The loop: what is known of it, and how it moves."""

from stiction_ros.loop.closed_loop import (
    ClosedLoopRun,
    PiController,
    PiControllers,
    simulate,
    simulate_closed_loop,
)
from stiction_ros.loop.excitation import prbs_experiment, random_binary, simulate_open_loop
from stiction_ros.loop.model import LoopModel, PiTuning
from stiction_ros.loop.plant import Measurement, Plant
from stiction_ros.loop.set_points import SetPoints
from stiction_ros.loop.valve_changes import ValveChange, read_valve_changes
from stiction_ros.loop.yaml_process import Instrument

__all__ = [
    "ClosedLoopRun",
    "Instrument",
    "LoopModel",
    "Measurement",
    "PiController",
    "PiControllers",
    "PiTuning",
    "Plant",
    "SetPoints",
    "ValveChange",
    "prbs_experiment",
    "random_binary",
    "read_valve_changes",
    "simulate",
    "simulate_closed_loop",
    "simulate_open_loop",
]
