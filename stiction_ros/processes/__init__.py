"""Processes behind the valves: ARX equations, state space, the stirred tank."""

from stiction_ros.processes.altered import AlteredProcess
from stiction_ros.processes.linear_process import ArxOutput, ArxProcess, StateSpaceProcess
from stiction_ros.processes.process import LinearModel, Noise, NoiseEntry, Process
from stiction_ros.processes.stirred_tank import StirredTank, TankParameters

__all__ = [
    "AlteredProcess",
    "ArxOutput",
    "ArxProcess",
    "LinearModel",
    "Noise",
    "NoiseEntry",
    "Process",
    "StateSpaceProcess",
    "StirredTank",
    "TankParameters",
]
