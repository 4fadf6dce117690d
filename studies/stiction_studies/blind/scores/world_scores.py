"""The score of one answer about a loop of the field in which something is hidden."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

from stiction_ros.discrepancy import Discrepancy
from stiction_studies.blind.scores.scoring import Claim, Row, claims_of
from stiction_studies.field.hidden import Effect, HiddenLoop, Name
from stiction_studies.field.hidden.effect import PROCESS, SENSOR, VALVE
from stiction_studies.field.hidden.oracle import Gain, family

_TURN = 2.0 * math.pi
FRICTION = frozenset({(VALVE, "stiction"), (VALVE, "backlash")})
LAGS = frozenset({(VALVE, "lag"), (PROCESS, "pole"), (SENSOR, "lag")})
KEPT = ("verdict", "effects", "alternatives", "process_changes", "noise", "untestable", "notes")


@dataclasses.dataclass(frozen=True)
class WorldScore(Row):
    """One loop, judged."""

    family: str
    given: str
    seed: int
    cause: str  # what was hidden, for tables
    plant: str
    circumstances: tuple[str, ...]
    # gains in ln L of each hidden effect, over no effect and the best rival outside its family
    oracle: tuple[Mapping[str, Any], ...]
    wrong: tuple[str, ...]  # names of what was named and is not there
    right: bool  # all that is hidden is named, or in doubt with its family, and nothing else
    silent: bool  # nothing was found but what the record holds besides
    sets: int  # that were left in doubt
    held: int  # of those, how many hold a truth
    said: str  # in words
    closed: float  # share of the held-out excess that is gone; NaN where nothing was found
    covered: Mapping[str, bool]  # per figure that was found, whether its interval holds the truth
    seconds: float  # processor time of the workflow
    answer: Mapping[str, Any]  # what the workflow said, abridged
    # per effect or set: the evidence that it is ahead; of each member, whether it is there
    claims: Sequence[tuple[float, Sequence[bool]]] = ()

    @property
    def healthy(self) -> bool:
        """Whether nothing was hidden."""
        return self.cause == "none"

    @property
    def alarm(self) -> bool:
        """Whether something was claimed that is not there: named, or a set without a truth."""
        return bool(self.wrong) or self.held < self.sets

    def gain(self) -> float:
        """Return what the oracle gains by the least of the hidden effects, over all rivals."""
        gains = [min(entry["none"], entry["rival"]) for entry in self.oracle]
        return min(gains, default=math.nan)

    def gain_over_none(self) -> float:
        """Return what it gains by the largest of them over no effect."""
        gains = [entry["none"] for entry in self.oracle]
        return max(gains, default=math.nan)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "WorldScore":
        """Read what :meth:`to_mapping` wrote."""
        closed = math.nan if values["closed"] is None else float(values["closed"])
        lists = {key: tuple(values[key]) for key in ("circumstances", "wrong", "oracle")}
        return cls(**{**values, **lists, "closed": closed})


def score(
    loop: HiddenLoop,
    given: str,
    answer: Mapping[str, Any],
    oracle: tuple[Gain, ...],
    seconds: float,
) -> WorldScore:
    """Judge one answer.

    Args:
        loop: with the answer.
        given: ``exact`` or ``off``.
        answer: the mapping of ``gap --json``.
        oracle: of the loop.
        seconds: processor time of the workflow.
    """
    claims = claims_of(answer)
    families = [family(loop, effect) for effect in loop.hidden]
    names = [_names(effect) for effect in loop.hidden]
    may, there, in_doubt = there_of(loop, answer)
    wrong = tuple(_word(c.first) for c in claims if c.named and c.first not in there)
    if loop.known == loop.base.plant:
        wrong += tuple(f"process {change['what']}" for change in answer.get("process_changes", ()))
    sets = [c for c in claims if not c.named]
    held = sum(bool(c.names & in_doubt) for c in sets)
    found = [
        any(_is_right(c, own, alike | may) for c in claims) or _changed(loop, effect, answer)
        for own, alike, effect in zip(names, families, loop.hidden, strict=True)
    ]
    unknown = answer["verdict"] == "unknown"
    closed = float(answer["gap"]["closed"]) if claims else math.nan
    return WorldScore(
        family=loop.family,
        given=given,
        seed=loop.seed,
        cause=loop.cause,
        plant=loop.surroundings.plant,
        circumstances=loop.surroundings.names,
        oracle=tuple(gain.to_mapping() for gain in oracle),
        wrong=wrong,
        right=not wrong and held == len(sets) and all(found) and not unknown,
        silent=all(c.names <= loop.also for c in claims) and not unknown,
        sets=len(sets),
        held=held,
        said=_said(claims, str(answer["verdict"])),
        closed=closed,
        covered=_covered(loop.hidden, claims),
        seconds=seconds,
        answer={key: answer[key] for key in KEPT if key in answer},
    )


def claimed(loop: HiddenLoop, found: Discrepancy) -> list[tuple[float, list[bool]]]:
    """Return what is claimed, each member with the truth, as :attr:`WorldScore.claims` has it."""
    _, there, in_doubt = there_of(loop, found.to_dict())
    told = []
    for each in (*(effect.standing for effect in found.effects), found.in_doubt):
        if each is not None:
            true = in_doubt if len(each.names) > 1 else there
            told.append((each.ahead, [name in true for name in each.names]))
    return told


def there_of(
    loop: HiddenLoop, answer: Mapping[str, Any]
) -> tuple[frozenset[Name], frozenset[Name], frozenset[Name]]:
    """Return what may be named besides what is hidden, all, and all that a set may hold."""
    may = loop.also | _changes(loop, answer)
    if any(effect.mechanical for effect in loop.hidden):
        may |= {(VALVE, "lag")}  # of the stem's actuator
    gain_is_off = abs(loop.known.gain) != abs(loop.base.plant.gain)
    there = may.union(*map(_names, loop.hidden))
    gain = {(PROCESS, "gain")} if gain_is_off else set()  # a set says no direction
    return may, there, there | gain


def _names(effect: Effect) -> frozenset[Name]:
    """Return the names under which an effect is right by itself."""
    return FRICTION if effect.mechanical else frozenset({effect.key})


def _changes(loop: HiddenLoop, answer: Mapping[str, Any]) -> frozenset[Name]:
    """Return what is claimed of the process and mends an error of the model's process."""
    true, known = loop.base.plant, loop.known
    if true == known:
        return frozenset()
    later = true.slow + true.dead_time > known.slow + known.dead_time
    found: set[Name] = set()
    if later or true.slow > known.slow:
        found |= LAGS
    if later or true.dead_time > known.dead_time:
        found |= {(PROCESS, "delay"), ("data", "time_shift")}
    for entry in answer["effects"]:
        if entry["effect"] == "gain":
            larger = float(entry["parameters"]["factor"]) > 1.0
            if larger is (abs(true.gain) > abs(known.gain)):
                found.add((PROCESS, "gain"))
    return frozenset(found)


def _changed(loop: HiddenLoop, effect: Effect, answer: Mapping[str, Any]) -> bool:
    """Whether a gain or dead time is told as a change of the process, within a factor of two."""
    plant, known = loop.base.plant, loop.known  # what the model is off by counts as well
    told = {change["what"]: float(change["value"]) for change in answer.get("process_changes", ())}
    if effect.key == (PROCESS, "delay"):
        late = effect.figures["extra"] * loop.record.sample_time + plant.dead_time - known.dead_time
        return 0.5 < told.get("delay", 0.0) / late < 2.0
    if effect.key == (PROCESS, "gain"):
        other = math.log(effect.figures["factor"] * plant.gain / known.gain)
        return 0.5 < math.log(told.get("gain", 1.0)) / other < 2.0
    return False


def _is_right(claim: Claim, own: frozenset[Name], alike: frozenset[Name]) -> bool:
    if claim.named:
        return claim.first in own
    return bool(claim.names & own) and claim.names <= own | alike


def _said(claims: tuple[Claim, ...], verdict: str) -> str:
    words = [
        _word(c.first) if c.named else "{" + ", ".join(sorted(map(_word, c.names))) + "}"
        for c in claims
    ]
    if not words or verdict == "unknown":
        words.append(verdict)
    return " + ".join(words)


def _word(name: Name) -> str:
    return f"{name[0].partition(':')[0]} {name[1]}"


def _covered(hidden: tuple[Effect, ...], claims: tuple[Claim, ...]) -> dict[str, bool]:
    found = {}
    for effect in hidden:
        if effect.mechanical:
            continue  # the mechanics of a stem have no figures of a loop model
        for claim in claims:
            if claim.first != effect.key:
                continue
            for key, (low, high) in claim.intervals.items():
                if key not in effect.figures or key in effect.untold:
                    continue
                true, slack = effect.figures[key], effect.slack.get(key, 0.0)
                if key == "phase":
                    true += _TURN * round(((low + high) / 2.0 - true) / _TURN)
                found[f"{effect.name}.{key}"] = low - slack <= true <= high + slack
    return found
