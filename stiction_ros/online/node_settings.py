"""The parameters of controller and estimator, as parameter files and ``ros2 param`` know them."""

import dataclasses

from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.estimator.live import EstimatorSettings
from stiction_ros.online.monitor.gap_monitor import MonitorRule
from stiction_ros.online.pairing import BRIDGED, Pairing
from stiction_ros.online.plain_settings import PacedSettings
from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class ControllerNodeSettings(LiveControllerSettings, PacedSettings):
    """The live controller's settings and what belongs to the node."""

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


@dataclasses.dataclass(frozen=True)
class EstimatorNodeSettings(EstimatorSettings, MonitorRule, PacedSettings):
    """The live estimator's settings, those of the monitor, and what belongs to the node."""

    loop: str = setting("loop", "name of the loop, for the models it publishes", fixed=True)
    sample_time: float = setting(1.0, "seconds between two samples", low=1e-6, fixed=True)
    monitor_model: str = setting(
        "",
        "loop model file the monitor compares with; empty for the loop as it is identified",
        fixed=True,
    )

    def pairing(self) -> Pairing:
        """Return what pairs PV and OP; no bridge is longer than what a fit can wait for."""
        return Pairing(self.sample_time, *self.bridges())

    def bridges(self) -> tuple[int, int]:
        """Return window and longest bridge of the pairing, samples."""
        return self.window, min(BRIDGED, self.fit_latency - 1)
