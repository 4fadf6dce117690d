"""What the workflow says of one window: a plain function that a worker process can run."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from stiction_ros import discrepancy
from stiction_ros.discrepancy.answer.say import called
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record


@dataclasses.dataclass(frozen=True)
class GapFinding:
    """What was found in one window."""

    begin: int  # begin, end: first and last sample of the window, counted from the first of the run
    end: int
    verdict: discrepancy.GapVerdict | None  # None when the window could not be used
    text: str  # one sentence
    effects: tuple[str, ...]  # each in a few words
    # the mapping of ``gap --json`` without ``model_before`` and ``seconds``; its times are seconds
    # since ``begin``
    document: Mapping[str, Any]

    @property
    def word(self) -> str:
        """The verdict, or ``unusable``."""
        return "unusable" if self.verdict is None else self.verdict.value

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping that diagnostics carry."""
        return {
            "begin": self.begin,
            "end": self.end,
            "verdict": self.word,
            "text": self.text,
            "effects": list(self.effects),
            "gap": dict(self.document),
        }


def find_in_window(model: LoopModel, record: Record) -> GapFinding:
    """Run the workflow, without bootstraps, on a window; its ``start`` counts from sample 0."""
    found = discrepancy.find_discrepancy(model, [record], discrepancy.GapOptions(quick=True))
    effects = tuple(_effect(effect, record.start) for effect in found.effects)
    begin = round(record.start / record.sample_time)
    document = found.to_dict()
    del document["model_before"]  # known to whoever asked
    del document["seconds"]  # another each time
    return GapFinding(
        begin, begin + len(record) - 1, found.verdict, _sentence(found, effects), effects, document
    )


def standing(old: GapFinding | None, new: GapFinding) -> GapFinding:
    """Return the finding that stands after one more window of the same growth.

    An effect may have left the later window: one that shows nothing takes nothing back.
    """
    silent = new.verdict in (None, discrepancy.GapVerdict.NONE, discrepancy.GapVerdict.UNTESTABLE)
    return old if old is not None and silent else new


def _sentence(found: discrepancy.Discrepancy, effects: Sequence[str]) -> str:
    if found.verdict is discrepancy.GapVerdict.NONE:
        return "no effect of the catalogue is found"
    if found.verdict is discrepancy.GapVerdict.UNTESTABLE:
        return "no effect is found, and the window could not show any of valve or process"
    if found.verdict is discrepancy.GapVerdict.UNKNOWN:
        rest = "the gap is there, but no effect of the catalogue explains it"
        return "; ".join((*effects, rest))
    if effects:
        return "; ".join(effects)
    if found.process_changes and not found.alternatives:
        said = (f"process to {each.output}: {each.sentence}" for each in found.process_changes)
        return "; ".join(said)
    return "one of " + ", ".join(called(place, effect) for place, effect in found.alternatives)


def _effect(effect: discrepancy.FoundEffect, start: float) -> str:
    """Return an effect such as ``stiction of valve V1: f_s 4.9 (4.6 to 5.2) %``."""
    parts = []
    for key, value in effect.parameters.items():
        shift = start if key == "time" else 0.0
        text = f"{key} {value + shift:.4g}"
        if key in effect.intervals:
            low, high = effect.intervals[key]
            text += f" ({low + shift:.4g} to {high + shift:.4g})"
        parts.append(f"{text} {effect.units.get(key, '')}".removesuffix(" 1").rstrip())
    said = ": ".join(filter(None, (called(effect.place, effect.effect), ", ".join(parts))))
    others = " or ".join(called(place, name) for place, name in effect.alternatives)
    return f"{said}, or {others}" if others else said
