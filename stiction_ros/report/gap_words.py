"""The words of the gap page: places, effects, figures and states for people."""

import math
import re
from collections.abc import Mapping, Sequence

from stiction_ros.discrepancy import FoundEffect
from stiction_ros.discrepancy.answer.say import PLACES
from stiction_ros.discrepancy.data.controller_check import ControllerStatus
from stiction_ros.discrepancy.decision.probability import Name
from stiction_ros.discrepancy.fit.search import CandidateFit
from stiction_ros.effects import behaviours
from stiction_ros.report.page import number
from stiction_ros.texts import HOUR, spoken, symbol

DIGITS = 3  # of a figure without an interval
CONTROLLER = {
    ControllerStatus.SAME: "OP recomputed from PV and SP is the recorded one",
    ControllerStatus.OTHER: "OP recomputed from PV and SP is another than the recorded one",
    ControllerStatus.UNEXPLAINED: "no PI controller gives the recorded OP from PV and SP",
    ControllerStatus.NOT_ASKED: "OP was not recomputed: that takes one valve, one output and SP",
}
_SHORT = PLACES | {"disturbance": "the output {tag}"}
_PLACES = {kind: f"in {place}" for kind, place in PLACES.items()} | {
    "load": "load that enters at valve {tag}",
    "disturbance": "disturbance on {tag}",
    "data": "in the record",
}
_PLACE = re.compile(rf"\b({'|'.join(_SHORT)}):(\w+)")
_FRICTION = re.compile(r"\bf_[sd]\b")
_WORDS = {
    "pole": "higher order",
    "bias_step": "step of the calibration",
    "random_walk": "random walk",
    "quantisation": "rounding",
    "time_shift": "shifted clock",
    "coloured": "slow noise",
    "delay": "longer dead time",
    "gain": "other gain",
    "tuning": "other tuning",
}


def place_of(place: str) -> str:
    """Return where an effect acts, such as ``in valve V1``."""
    kind, _, tag = place.partition(":")
    return _PLACES.get(kind, kind).format(tag=tag)


def word_of(effect: str) -> str:
    """Return an effect for people."""
    return _WORDS.get(effect, effect.replace("_", " "))


def plain(sentence: str) -> str:
    """Return a sentence with the places of loop models, such as ``valve:V1``, in words."""
    said = _PLACE.sub(lambda found: _SHORT[found[1]].format(tag=found[2]), sentence)
    return _FRICTION.sub(lambda found: symbol(found[0]), said)


def called(place: str, effect: str) -> str:
    """Return an effect and its place, such as ``stiction in valve V1``."""
    return f"{word_of(effect)} {place_of(place)}"


def titled(effect: FoundEffect, name: str) -> str:
    """Return a name with law and probability: ``stiction (law he), probability 97 %``."""
    law = "" if effect.law is None else f" (law {effect.law})"
    likely = effect.standing.probabilities()[effect.place, effect.effect]
    return f"{name}{law}, probability {chance(likely)}"


def one_of(names: Sequence[Name], probabilities: Mapping[Name, float]) -> str:
    """Return the members of a set, such as ``lag in valve V1 (40 %) or …``."""
    return " or ".join(f"{called(*name)} ({chance(probabilities[name])})" for name in names)


def chance(probability: float) -> str:
    """Return a probability for people, neither 0 nor 1."""
    return f"{min(max(100.0 * probability, 1.0), 99.0):.0f} %"


def figures_with_units(effect: FoundEffect) -> list[str]:
    """Return one line per figure: name, value, unit, interval and what it means."""
    meanings = {
        p.key: p.description
        for kind in behaviours()
        if (kind.effect, kind.law) == (effect.effect, effect.law)
        for p in kind.parameters()
    }
    lines = []
    for key, value in effect.parameters.items():
        unit = effect.units.get(key, "")
        shown = "" if unit in ("", "1") else f" {unit}"
        ends = effect.intervals.get(key)
        between, digits = "", DIGITS
        if ends is not None:
            digits = _digits(value, ends)
            between = f", 95 % between {number(ends[0], digits)} and {number(ends[1], digits)}"
        if unit == "s" and value >= HOUR:
            shown += f" ({spoken(value)})"
        said = f"{symbol(key)} = {number(value, digits)}{shown}{between}"
        meaning = meanings.get(key, "")
        lines.append(said + (f": {meaning}" * bool(meaning)))
    return lines


def lines_of(effect: FoundEffect) -> list[str]:
    """Return what is said of an effect, one line each: figures, others like it, why it."""
    lines = figures_with_units(effect)
    if effect.alternatives:
        others = one_of(effect.alternatives, effect.standing.probabilities())
        lines.append(f"or {others}: these records do not tell them apart")
    if math.isfinite(effect.closed):
        lines.append(f"closes {100.0 * effect.closed:.0f} % of the gap by itself")
    return lines + ([f"{effect.sentence}."] if effect.sentence else [])


def _digits(value: float, ends: tuple[float, float]) -> int:
    """Return how many digits of a figure show two of the width of its interval."""
    width = ends[1] - ends[0]
    if not (math.isfinite(width) and width > 0.0) or value == 0.0:
        return DIGITS
    return max(DIGITS, math.floor(math.log10(abs(value))) - math.floor(math.log10(width)) + 2)


def candidate_of(fit: CandidateFit) -> str:
    """Return a candidate for a table, its law where an effect has several."""
    law = fit.candidate.law
    return called(*fit.candidate.key) + (f", law {law}" if law is not None else "")


def named_figures(fit: CandidateFit) -> str:
    """Return a candidate's figures by their names; nothing outside the catalogue."""
    if fit.behaviour is None:
        return ""
    parts = []
    for entry in fit.behaviour.parameters():
        unit = "" if entry.unit == "1" or "signal" in entry.unit else f" {entry.unit}"
        parts.append(
            f"{symbol(entry.key)} {number(float(getattr(fit.behaviour, entry.attribute)))}{unit}"
        )
    return ", ".join(parts)
