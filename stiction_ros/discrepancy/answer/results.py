"""What the workflow hands over."""

import dataclasses
from typing import Any

from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.answer.not_considered import NotConsidered, left_out, not_considered
from stiction_ros.discrepancy.data.controller_check import ControllerCheck
from stiction_ros.discrepancy.data.gate import Gate
from stiction_ros.discrepancy.decision.decide import Decision, GapVerdict
from stiction_ros.discrepancy.decision.scores import Scores, Testable
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.measure import OutputGap
from stiction_ros.discrepancy.gap.noise_check import OutputNoise
from stiction_ros.discrepancy.gap.where import Where
from stiction_ros.discrepancy.process.change import ProcessChange
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.loop import LoopModel


@dataclasses.dataclass(frozen=True)
class Look:
    """One round: scores of all candidates and what they allowed to say."""

    scores: Scores  # of every candidate
    decision: Decision  # what they say
    where: Where  # where the gap of this round is
    kept: bool  # whether the chosen effect stayed in the model
    reason: str  # why it did not


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
        noise: per output the declared and the found noise.
        process_changes: what of the given process had to be changed.
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
    noise: tuple[OutputNoise, ...]
    process_changes: tuple[ProcessChange, ...]
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

    def __repr__(self) -> str:
        named = ", ".join(f"{found.effect} at {found.place}" for found in self.effects)
        return f"<Discrepancy {self.verdict}{f': {named}' if named else ''}>"

    @property
    def not_considered(self) -> tuple[NotConsidered, ...]:
        """Every behaviour that was no candidate and is not named, with the reason.

        Also ``spikes``, single samples that the gate left out before the search.
        """
        tried = self.looks[0].scores.candidates if self.looks else ()
        named = {(e.place.partition(":")[0], e.effect) for e in self.effects}
        listed = (
            entry
            for entry in not_considered(tried, self.controller)
            if (entry.place, entry.effect) not in named or entry.law is not None
        )
        return (*listed, *left_out(self.model_before.outputs, self.gate.alone))

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``gap --json``."""
        return {
            "verdict": self.verdict.value,
            "effects": [effect.to_dict() for effect in self.effects],
            "alternatives": [{"place": p, "effect": e} for p, e in self.alternatives],
            "experiment": self.experiment,
            "where": list(self.where),
            "untestable": [
                {"place": t.place, "effect": t.effect, "experiment": t.experiment}
                for t in self.untestable
            ],
            "not_considered": [entry.to_dict() for entry in self.not_considered],
            "noise": {each.name: each.to_dict() for each in self.noise},
            "process_changes": [each.to_dict() for each in self.process_changes],
            "gap": {
                "before": {gap.name: gap.to_dict() for gap in self.before},
                "after": {gap.name: gap.to_dict() for gap in self.after},
                "closed": self.closed,
            },
            "model_before": self.model_before.to_mapping(),
            "model_after": self.model_after.to_mapping(),
            "seconds": self.seconds,
            "notes": list(self.notes),
        }
