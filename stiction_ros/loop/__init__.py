"""The loop: what is known of it, and how it moves."""

from stiction_ros.loop.closed_loop import ClosedLoopRun as ClosedLoopRun
from stiction_ros.loop.closed_loop import PiController as PiController
from stiction_ros.loop.closed_loop import simulate as simulate
from stiction_ros.loop.closed_loop import simulate_closed_loop as simulate_closed_loop
from stiction_ros.loop.excitation import prbs_experiment as prbs_experiment
from stiction_ros.loop.excitation import random_binary as random_binary
from stiction_ros.loop.excitation import simulate_open_loop as simulate_open_loop
from stiction_ros.loop.model import LoopModel as LoopModel
from stiction_ros.loop.model import PiTuning as PiTuning
from stiction_ros.loop.plant import Measurement as Measurement
from stiction_ros.loop.plant import Plant as Plant
from stiction_ros.loop.set_points import SetPoints as SetPoints
from stiction_ros.loop.valve_changes import ValveChange as ValveChange
from stiction_ros.loop.valve_changes import read_valve_changes as read_valve_changes
from stiction_ros.loop.yaml_process import Instrument as Instrument
