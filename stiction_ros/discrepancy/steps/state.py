"""What a gap run is given, and what it believes between two of its steps."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.answer.results import Look
from stiction_ros.discrepancy.data.controller_check import ControllerCheck
from stiction_ros.discrepancy.data.gate import DataFinding, Gate
from stiction_ros.discrepancy.decision.explanation import AddedEffect, Explanation
from stiction_ros.discrepancy.decision.scores import Progress
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap_options import GapOptions
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.loop import LoopModel


@dataclasses.dataclass(frozen=True)
class Task:
    """What all steps of a run are given."""

    model: LoopModel  # as it was given
    options: GapOptions  # of the run
    gate: Gate  # gate, controller, data: what the data themselves show
    controller: ControllerCheck
    data: tuple[DataFinding, ...]
    runs: Runs  # the records end to end
    random: np.random.Generator  # source of the bootstraps, drawn from in the order of the steps
    report: Progress  # called with the share done
    begun: float  # of the clock, s


@dataclasses.dataclass(frozen=True)
class State:
    """What is believed of a loop."""

    given: LoopModel  # the model without any effect that was added, its process as it was given
    before: Baseline  # of the free run without what was added
    now: Explanation  # what is in the model
    looks: tuple[Look, ...] = ()  # the rounds so far
    # what is believed without the first effect that was added in doubt; None where none was
    doubted: "State | None" = None

    def holding(self, effects: Sequence[AddedEffect]) -> "State":
        """Return the same process with these effects in place of its own."""
        return dataclasses.replace(self, now=self.now.holding(effects))
