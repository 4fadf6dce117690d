"""The settings of the controller of a running loop."""

import dataclasses

from stiction_ros.control import ControlMode
from stiction_ros.control_settings import ControlSettings
from stiction_ros.online.handover.offers import OfferRule
from stiction_ros.online.handover.watch import WatchRule
from stiction_ros.online.plain_settings import FitSchedule, PacedSettings
from stiction_ros.settings import setting

AUTO = "auto"


@dataclasses.dataclass(frozen=True)
class ValveTestRule:
    """When a valve test begins in a running loop, and how far it may go."""

    valve_test_at: int = setting(
        0, "sample from which a valve test runs in mode valve_test, once", low=0
    )
    valve_test_valve: str = setting("", "tag of the valve that is tested; empty: the first")
    valve_test_output: str = setting("", "tag of the PV that shows it; empty: the clearest")
    valve_test_op: float = setting(10.0, "how far OP may go in a valve test, %", low=0.1)
    valve_test_pv: float = setting(
        0.0,
        "how far PV may go from its set-point in a valve test, its unit; 0: as OP brings it",
        low=0.0,
    )


@dataclasses.dataclass(frozen=True)
class LiveControllerSettings(
    ControlSettings, FitSchedule, WatchRule, OfferRule, ValveTestRule, PacedSettings
):
    """Everything that can be set on the controller of a running loop, as its parameters."""

    mode: str = setting(
        AUTO,
        "auto: the estimator swaps it; valve_test: the same with one test in manual; else fixed",
        choices=(AUTO, *(mode.value for mode in ControlMode)),
    )
    adopt_process: bool = setting(False, "also take the process from the estimator's loop model")
    approach_samples: int = setting(
        20,
        "samples in which the set-point goes from PV to its value after a start or a hold",
        low=0,
    )
    model: str = setting("", "loop model file the controller is built from", fixed=True)
    sp_source: str = setting(
        "schedule",
        "schedule: in lockstep each pv has its own sp; external: the last (transient local) holds",
        choices=("schedule", "external"),
        fixed=True,
    )
    fit_timeout: float = setting(
        120.0, "s to wait for an awaited fit", low=0.1, high=1e5, beside=("pace", "lockstep")
    )
    prediction_points: int = setting(11, "points of the published plan", low=1, high=1001)
