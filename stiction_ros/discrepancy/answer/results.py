"""What the workflow hands over, and which behaviours it did not consider, and why."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from stiction_ros.discrepancy.answer.found_effects import FoundEffect, listed_names
from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.data.controller_check import ControllerCheck, ControllerStatus
from stiction_ros.discrepancy.data.gate import SHOWN, Gate
from stiction_ros.discrepancy.decision.decide import Decision, GapVerdict
from stiction_ros.discrepancy.decision.explanation import ProcessChange
from stiction_ros.discrepancy.decision.probability import Name, Standing
from stiction_ros.discrepancy.decision.scores import Scores, Testable
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.measure import OutputGap, OutputNoise
from stiction_ros.discrepancy.gap.where import Where
from stiction_ros.discrepancy.simulation.free_run import Runs
from stiction_ros.effects import Behaviour, Offset, Stiction, TimeShift, Tuning, behaviours
from stiction_ros.loop import LoopModel

ALONE = (
    "samples of {name} that stand alone, {count} of them, were left out before the search: what "
    "shows only there is not searched"
)
ABSORBED = "the process was fitted to these records, which does as well"
OTHER_LAWS = "stiction is searched by the laws he and xch"
NO_ROOM = (
    "these records cannot show it: no signal moves where it acts, or no size of it is possible"
)


@dataclasses.dataclass(frozen=True)
class NotConsidered:
    """A behaviour that was no candidate."""

    place: str  # kind of place, such as ``sensor``
    effect: str  # effect, law: as loop models name them; no law where the effect has one only
    law: str | None
    reason: str  # one clause

    @property
    def name(self) -> str:
        """Name for people, such as ``valve stiction (kano)``."""
        return f"{self.place} {self.effect}" + (f" ({self.law})" if self.law else "")

    def to_dict(self) -> dict[str, str]:
        """Return the entry of ``not_considered`` in ``gap --json``."""
        law = {} if self.law is None else {"law": self.law}
        return {"place": self.place, "effect": self.effect, **law, "reason": self.reason}


def not_considered(
    candidates: Sequence[Candidate], controller: ControllerCheck
) -> tuple[NotConsidered, ...]:
    """Return every behaviour, place by place, that was neither searched nor looked for otherwise.

    Args:
        candidates: of the first look.
        controller: whether OP could be recomputed, which shows what is wrong with the data.
    """
    keys = {(place.partition(":")[0], name) for c in candidates for place, name in c.keys}
    searched = {getattr(c, "kind", c.about) for c in candidates if c.inside}
    told, found = controller.status is not ControllerStatus.NOT_ASKED, []
    for kind in behaviours():
        for place in kind.places:
            # the gate, the check of the controller or the list of the untestable has it
            if kind in SHOWN or kind is Offset or (told and kind in (Tuning, TimeShift)):
                continue
            if (place, kind.effect) in keys and (kind.law is None or kind in searched):
                continue
            found.append(NotConsidered(place, kind.effect, kind.law, _reason(kind, candidates)))
    return tuple(found)


def _reason(kind: type[Behaviour], candidates: Sequence[Candidate]) -> str:
    if kind.absorbed and not any(c.absorbed for c in candidates):
        return ABSORBED
    if kind.not_searched != Behaviour.not_searched:
        return kind.not_searched
    names_axes = kind.axes.__func__ is not Behaviour.axes.__func__  # type: ignore[attr-defined]
    home = kind.__module__
    shipped = home.startswith("stiction_ros.effects.") and ".effects.own." not in home
    if shipped and issubclass(kind, Stiction):
        return OTHER_LAWS
    return NO_ROOM if names_axes or shipped else kind.not_searched


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
        in_doubt: how far a set is ahead that no effect stands for; None where there is none.
        experiment: what would tell them apart, or make the effects testable.
        where: sentences that say where the gap is.
        untestable: effects that these records could not show.
        noise: per output the declared and the found noise.
        process_changes: what of the given process had to be changed, as far as it matters.
        corrections: the changes of the given process that are too small to matter.
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
    in_doubt: Standing | None
    experiment: str
    where: tuple[str, ...]
    untestable: tuple[Testable, ...]
    noise: tuple[OutputNoise, ...]
    process_changes: tuple[ProcessChange, ...]
    corrections: tuple[ProcessChange, ...]
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
    def probabilities(self) -> Mapping[Name, float]:
        """How probable each effect is that is named or possible."""
        told = dict(self.in_doubt.probabilities()) if self.in_doubt else {}
        for effect in reversed(self.effects):
            told |= effect.standing.probabilities()
        return told

    @property
    def not_considered(self) -> tuple[NotConsidered, ...]:
        """Every behaviour that was no candidate and is not named, with the reason.

        Also ``spikes``, single samples that were left out before the search.
        """
        tried = self.looks[0].scores.candidates if self.looks else ()
        named = {(e.place.partition(":")[0], e.effect) for e in self.effects}
        listed = (
            entry
            for entry in not_considered(tried, self.controller)
            if (entry.place, entry.effect) not in named or entry.law is not None
        )
        alone = zip(self.model_before.outputs, self.runs.alone, strict=True)
        said = [ALONE.format(name=name, count=count) for name, count in alone if count]
        return (*listed, *(NotConsidered("sensor", "spikes", None, each) for each in said))

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``gap --json``."""
        return {
            "verdict": self.verdict.value,
            "effects": [effect.to_dict() for effect in self.effects],
            "alternatives": listed_names(self.alternatives, self.probabilities),
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
