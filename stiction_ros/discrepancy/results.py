"""What the workflow hands over."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from stiction_ros.discrepancy.catalogue_scores import Scores
from stiction_ros.discrepancy.controller_check import ControllerCheck
from stiction_ros.discrepancy.decide import Decision, GapVerdict
from stiction_ros.discrepancy.free_run import Runs
from stiction_ros.discrepancy.gate import Gate
from stiction_ros.discrepancy.measure import OutputGap
from stiction_ros.discrepancy.search import Baseline
from stiction_ros.discrepancy.testable import Testable
from stiction_ros.discrepancy.where import Where
from stiction_ros.loop import LoopModel


@dataclasses.dataclass(frozen=True)
class FoundEffect:
    """One effect that the simulation lacked.

    Attributes:
        place, effect: as loop models name them.
        parameters: in engineering units, times in seconds since the first sample.
        intervals: 95 % of each parameter that has one.
        delta_bic: BIC by which it beats the model without it.
        verdict: named or ambiguous.
        alternatives: places and effects that the record does not tell from it.
    """

    place: str
    effect: str
    parameters: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]
    delta_bic: float
    verdict: GapVerdict
    alternatives: tuple[tuple[str, str], ...] = ()

    def to_json(self) -> dict[str, Any]:
        """Return the entry of ``effects`` in ``gap --json``."""
        return {
            "place": self.place,
            "effect": self.effect,
            "parameters": dict(self.parameters),
            "intervals": {key: list(ends) for key, ends in self.intervals.items()},
            "delta_bic": self.delta_bic,
            "verdict": self.verdict.value,
            "alternatives": [{"place": p, "effect": e} for p, e in self.alternatives],
        }


@dataclasses.dataclass(frozen=True)
class Look:
    """One round: scores of all candidates and what they allowed to say.

    Attributes:
        scores: of every candidate.
        decision: what they say.
        where: where the gap of this round is.
        kept: whether the chosen effect stayed in the model.
        reason: why it did not.
    """

    scores: Scores
    decision: Decision
    where: Where
    kept: bool
    reason: str


@dataclasses.dataclass(frozen=True)
class Discrepancy:
    """What a simulation misses, judged from records of the loop.

    Attributes:
        verdict: of all looks together.
        effects: what was found, the largest first.
        alternatives: places and effects that stay possible beside ``effects``.
        experiment: what would tell them apart, or make the effects testable.
        where: sentences that say where the gap is.
        untestable: effects that these records could not show.
        before, after: gap per output on held-out rows.
        closed: share of the free-run excess over the noise floor that is gone.
        model_before, model_after: the loop models.
        looks: the rounds, at least one unless the data forbid it.
        gate, controller: what the data themselves show.
        runs: the records end to end.
        base_before, base_after: free runs of both models.
        seconds: wall time spent.
        notes: remarks for people.

    Examples:
        >>> from stiction_ros import GapOptions, LoopModel, SetPoints
        >>> from stiction_ros import find_config, find_gap, simulate
        >>> truth = LoopModel.load(find_config("flow.loop.yaml"))
        >>> schedule = SetPoints.load(find_config("flow.set_points.yaml"), truth.outputs)
        >>> record = simulate(truth, schedule, samples=800)
        >>> found = find_gap(truth, [record], GapOptions(quick=True))  # nothing is missing
        >>> print(found.verdict, len(found.effects))
        none 0
    """

    verdict: GapVerdict
    effects: tuple[FoundEffect, ...]
    alternatives: tuple[tuple[str, str], ...]
    experiment: str
    where: tuple[str, ...]
    untestable: tuple[Testable, ...]
    before: tuple[OutputGap, ...]
    after: tuple[OutputGap, ...]
    closed: float
    model_before: LoopModel
    model_after: LoopModel
    looks: tuple[Look, ...]
    gate: Gate
    controller: ControllerCheck
    runs: Runs
    base_before: Baseline
    base_after: Baseline
    seconds: float
    notes: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """Return the mapping of ``gap --json``."""
        return {
            "verdict": self.verdict.value,
            "effects": [effect.to_json() for effect in self.effects],
            "alternatives": [{"place": p, "effect": e} for p, e in self.alternatives],
            "experiment": self.experiment,
            "where": list(self.where),
            "untestable": [
                {"place": t.place, "effect": t.effect, "experiment": t.experiment}
                for t in self.untestable
            ],
            "gap": {
                "before": {gap.name: gap.to_json() for gap in self.before},
                "after": {gap.name: gap.to_json() for gap in self.after},
                "closed": self.closed,
            },
            "model_before": self.model_before.to_mapping(),
            "model_after": self.model_after.to_mapping(),
            "seconds": self.seconds,
            "notes": list(self.notes),
        }
