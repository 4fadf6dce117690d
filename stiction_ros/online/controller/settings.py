"""The settings of the controller of a running loop."""

from __future__ import annotations

import dataclasses

from stiction_ros.control import ControlMode
from stiction_ros.control_settings import ControlSettings
from stiction_ros.online.handover.offers import OfferRule
from stiction_ros.online.handover.watch import WatchRule
from stiction_ros.online.schedule import FitSchedule
from stiction_ros.settings import setting

AUTO = "auto"


@dataclasses.dataclass(frozen=True)
class LiveControllerSettings(ControlSettings, FitSchedule, WatchRule, OfferRule):
    """Everything that can be set on the controller of a running loop."""

    mode: str = setting(
        AUTO,
        "auto: the estimator swaps it; otherwise fixed",
        choices=(AUTO, *(mode.value for mode in ControlMode)),
    )
    adopt_process: bool = setting(False, "also take the process from the estimator's loop model")
    approach_samples: int = setting(
        20,
        "samples in which the set-point goes from PV to its value after a start or a hold",
        low=0,
    )
