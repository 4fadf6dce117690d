"""What a gap run is given, and what it believes between two of its steps."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.discrepancy.answer.results import Look
from stiction_ros.discrepancy.data.controller_check import ControllerCheck
from stiction_ros.discrepancy.data.gate import DataFinding, Gate
from stiction_ros.discrepancy.decision.extend import AddedEffect, base_beside, base_with
from stiction_ros.discrepancy.decision.scores import Progress, Testable
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap_options import GapOptions
from stiction_ros.discrepancy.process.change import ProcessChange
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import FloatArray
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
    bare: LoopModel  # the same, its process as it is taken now
    before: Baseline  # before, base: free runs without and with what was added
    base: Baseline
    changes: tuple[ProcessChange, ...] = ()  # what of the process is another than given
    # per output what a unit of each figure that was changed moves, shape (N, q)
    slopes: tuple[FloatArray, ...] = ()
    # effects that are in the model, in the order in which they were found
    added: tuple[AddedEffect, ...] = ()
    # ``bare`` before each of them came, as long as they may be taken back
    earlier: tuple[LoopModel, ...] = ()
    looks: tuple[Look, ...] = ()  # the rounds so far
    opened: int = 0  # the first look at the process as it is now
    testable: tuple[Testable, ...] = ()  # what the last look could have seen
    # what is believed without the first effect that was added in doubt; None where none was
    doubted: "State | None" = None

    def others(self, k: int) -> tuple[AddedEffect, ...]:
        """Return all added effects but one."""
        return (*self.added[:k], *self.added[k + 1 :])

    def beside(self, runs: Runs, k: int) -> Baseline:
        """Return the baseline with all added effects but one, their linear figures left open."""
        return base_beside(self.bare, runs, self.others(k))

    def with_added(self, runs: Runs, added: Sequence[AddedEffect]) -> "State":
        """Return the same process with these effects in place of those that were added."""
        base = base_with(self.bare, runs, added)
        return dataclasses.replace(self, added=tuple(added), base=base)
