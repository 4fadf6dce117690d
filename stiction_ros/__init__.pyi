"""The public names and their homes: what type checkers read, and what is loaded at first use."""

from stiction_ros import effects as effects
from stiction_ros.config_files import find_config as find_config
from stiction_ros.control.controller import MpcController as MpcController
from stiction_ros.control.result import ControlMode as ControlMode
from stiction_ros.control.result import StepResult as StepResult
from stiction_ros.control_settings import ControlSettings as ControlSettings
from stiction_ros.discrepancy.answer.results import Discrepancy as Discrepancy
from stiction_ros.discrepancy.decision.decide import GapVerdict as GapVerdict
from stiction_ros.discrepancy.gap_options import GapOptions as GapOptions
from stiction_ros.discrepancy.workflow import find_discrepancy
from stiction_ros.effects.behaviour import Behaviour as Behaviour
from stiction_ros.effects.friction.he import HeStiction as HeStiction
from stiction_ros.errors import InputError as InputError
from stiction_ros.identification.identification_options import (
    IdentificationOptions as IdentificationOptions,
)
from stiction_ros.identification.linear.fit import LinearOptions as LinearOptions
from stiction_ros.identification.linear.fit import fit_linear as fit_linear
from stiction_ros.identification.linear.result import LinearIdentification as LinearIdentification
from stiction_ros.identification.methods import identify as identify
from stiction_ros.identification.result import Identification as Identification
from stiction_ros.identification.result import VerdictKind as VerdictKind
from stiction_ros.intake.intake import read as read
from stiction_ros.intake.intake_options import CsvColumns as CsvColumns
from stiction_ros.loop.closed_loop import simulate as simulate
from stiction_ros.loop.closed_loop import simulate_closed_loop as simulate_closed_loop
from stiction_ros.loop.excitation import prbs_experiment as prbs_experiment
from stiction_ros.loop.model import LoopModel as LoopModel
from stiction_ros.loop.plant import Plant as Plant
from stiction_ros.loop.set_points import SetPoints as SetPoints
from stiction_ros.online.session import LiveRun as LiveRun
from stiction_ros.online.session import Scenario as Scenario
from stiction_ros.online.session import run_live as run_live
from stiction_ros.pages.signals import plot as plot
from stiction_ros.records.csv_writer import write_csv as write_csv
from stiction_ros.records.record import Record as Record
from stiction_ros.records.run.record_to_bag import write_bag as write_bag
from stiction_ros.report.record_page import report_record as report_record

__version__: str
find_gap = find_discrepancy
