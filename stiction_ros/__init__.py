"""Valve stiction in model predictive control: simulate, identify, compensate, record.

What :data:`__all__` lists is the public face; it is loaded when it is used, so that importing the
package costs nothing. Everything else in the sub-packages may change from one version to the
next.

Floors, lowest first; each imports only what stands below it, and nothing below
:mod:`stiction_ros.nodes` imports rclpy::

    effects  processes  records  intake  loop  identification  discrepancy, control  paper
    control_settings  online  opcua  gain  survey  report  cli  nodes

Examples:
    >>> from stiction_ros import LoopModel, find_config, identify, simulate
    >>> record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=600)
    >>> print(identify(record).valves[0].verdict)
    sticky
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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
    from stiction_ros.identification.linear.result import (
        LinearIdentification as LinearIdentification,
    )
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

    find_gap = find_discrepancy

__version__ = "0.1.0"

# Name: the module that has it, and its name there where that is another one.
_HOMES = {
    "Behaviour": "effects.behaviour",
    "ControlMode": "control.result",
    "ControlSettings": "control_settings",
    "CsvColumns": "intake.intake_options",
    "Discrepancy": "discrepancy.answer.results",
    "GapOptions": "discrepancy.gap_options",
    "GapVerdict": "discrepancy.decision.decide",
    "HeStiction": "effects.friction.he",
    "Identification": "identification.result",
    "IdentificationOptions": "identification.identification_options",
    "InputError": "errors",
    "LinearIdentification": "identification.linear.result",
    "LinearOptions": "identification.linear.fit",
    "LiveRun": "online.session",
    "LoopModel": "loop.model",
    "MpcController": "control.controller",
    "Plant": "loop.plant",
    "Record": "records.record",
    "Scenario": "online.session",
    "SetPoints": "loop.set_points",
    "StepResult": "control.result",
    "VerdictKind": "identification.result",
    "find_config": "config_files",
    "find_gap": "discrepancy.workflow:find_discrepancy",
    "fit_linear": "identification.linear.fit",
    "identify": "identification.methods",
    "plot": "pages.signals",
    "prbs_experiment": "loop.excitation",
    "read": "intake.intake",
    "report_record": "report.record_page",
    "run_live": "online.session",
    "simulate": "loop.closed_loop",
    "simulate_closed_loop": "loop.closed_loop",
    "write_bag": "records.run.record_to_bag",
    "write_csv": "records.csv_writer",
}

__all__ = sorted((*_HOMES, "__version__", "effects"))


def __getattr__(name: str) -> Any:
    """Load a public name at its first use (PEP 562)."""
    if name == "effects":
        return importlib.import_module("stiction_ros.effects")
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, there = _HOMES[name].partition(":")
    value = getattr(importlib.import_module(f"{__name__}.{module}"), there or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names beside what is loaded."""
    return sorted({*globals(), *__all__})
