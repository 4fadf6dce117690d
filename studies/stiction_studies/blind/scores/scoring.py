"""The score of one answer: what was hidden against what was said."""

import dataclasses
import enum
import math
from collections.abc import Mapping
from typing import Any

from stiction_ros.loop import LoopModel
from stiction_studies.blind.loops.truth import Truth
from stiction_studies.blind.scores.families import SHOWN_BY_DATA, Name, family_of

_TURN = 2.0 * math.pi


class Score(enum.StrEnum):
    """How an answer compares with the truth.

    ``RIGHT``: every hidden effect is named, or is left in doubt with exactly its inseparable
    family, and nothing else is claimed. ``PART``: some of two are. ``DOUBT``: ambiguous with
    another set that holds the truth. ``LOST``: ambiguous without the truth. ``WRONG``:
    something is named that is not there. ``UNKNOWN``: the verdict is unknown, whatever was
    added to the model. ``MISSED``: nothing was found. ``QUIET``: nothing was hidden, nothing
    was found. ``ALARM``: nothing of the catalogue was hidden, and an ambiguous set was claimed.
    """

    RIGHT = "right"
    PART = "part"
    DOUBT = "doubt"
    LOST = "lost"
    WRONG = "wrong"
    UNKNOWN = "unknown"
    MISSED = "missed"
    QUIET = "quiet"
    ALARM = "alarm"


@dataclasses.dataclass(frozen=True)
class Claim:
    """One effect that is claimed."""

    named: bool  # whether it is the only one; otherwise one of ``names``
    names: frozenset[Name]  # places and effects that it may be
    first: Name
    intervals: Mapping[str, tuple[float, float]]  # by effect, low and high end of its parameters


class Row:
    """A score that a log keeps."""

    closed: float

    def to_mapping(self) -> dict[str, Any]:
        """Return the JSON mapping; a missing ``closed`` is null."""
        values: dict[str, Any] = dataclasses.asdict(self)  # type: ignore[call-overload]
        return values | {"closed": None if math.isnan(self.closed) else self.closed}


@dataclasses.dataclass(frozen=True)
class Scored(Row):
    """One loop, judged.

    Attributes:
        family, seed, cause: of the loop.
        regime: its circumstances, as a mapping.
        testable: whether every hidden effect beats no effect by the margin.
        score: see :class:`Score`.
        said: for the matrix: an effect with its kind of place, or the verdict.
        closed: share of the held-out excess that is gone; NaN where no effect was fitted.
        covered: per parameter of a hidden effect that was found, whether its interval holds it.
        seconds: of the workflow.
    """

    family: str
    seed: int
    cause: str
    regime: Mapping[str, Any]
    testable: bool
    score: Score
    said: str
    closed: float
    covered: Mapping[str, bool]
    seconds: float

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> "Scored":
        """Read what :meth:`to_mapping` wrote."""
        closed = math.nan if values["closed"] is None else float(values["closed"])
        return cls(**{**values, "score": Score(values["score"]), "closed": closed})


def claims_of(answer: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Return what ``gap --json`` claims, one entry per effect.

    Alternatives that no effect bears belong to a further effect that was not added.
    """
    claims = []
    for entry in answer["effects"]:
        first = (entry["place"], entry["effect"])
        others = [(a["place"], a["effect"]) for a in entry.get("alternatives", [])]
        intervals = {
            key: (float(low), float(high)) for key, (low, high) in entry["intervals"].items()
        }
        claims.append(Claim(not others, frozenset({first, *others}), first, intervals))
    known = frozenset().union(*(claim.names for claim in claims)) if claims else frozenset()
    loose = [(a["place"], a["effect"]) for a in answer["alternatives"]]
    if answer["verdict"] == "ambiguous" and set(loose) - known:
        claims.append(Claim(False, frozenset(loose), loose[0], {}))
    return tuple(claims)


def score(
    truth: Truth, model: LoopModel, answer: Mapping[str, Any], gains: Mapping[Name, float]
) -> Scored:
    """Judge one answer.

    Args:
        truth: what was hidden.
        model: what the workflow was given.
        answer: the mapping of ``gap --json``.
        gains: BIC by which each hidden effect, fitted by the workflow, beats no effect, less
            the margin that it has to.
    """
    claims = claims_of(answer)
    families = {name: family_of(name, model) for name in truth.names}
    fitted = any(effect not in SHOWN_BY_DATA for claim in claims for _, effect in claim.names)
    return Scored(
        truth.family,
        truth.seed,
        truth.cause,
        dataclasses.asdict(truth.regime),
        bool(truth.hidden) and all(gains.get(name, -math.inf) >= 0.0 for name in truth.names),
        _score(claims, families, str(answer["verdict"])),
        _said(claims, families, str(answer["verdict"])),
        float(answer["gap"]["closed"]) if fitted else math.nan,
        _covered(truth, claims),
        float(answer["seconds"]),
    )


def _score(
    claims: tuple[Claim, ...], families: Mapping[Name, frozenset[Name]], verdict: str
) -> Score:
    if verdict == "unknown":
        return Score.UNKNOWN
    right = [name for name in families if any(_is_right(c, name, families[name]) for c in claims)]
    if any(c.named and c.first not in families for c in claims):
        return Score.WRONG
    if not claims:
        return Score.MISSED if families else Score.QUIET
    if not families:
        return Score.ALARM
    if len(right) == len(families) == len(claims):
        return Score.RIGHT
    if any(not (c.names & families.keys()) for c in claims):
        return Score.LOST
    return Score.PART if right else Score.DOUBT


def _is_right(claim: Claim, name: Name, family: frozenset[Name]) -> bool:
    return claim.first == name if claim.named else name in claim.names and claim.names == family


def _said(claims: tuple[Claim, ...], families: Mapping[Name, frozenset[Name]], verdict: str) -> str:
    """Return the words of the matrix, such as ``valve stiction`` or ``set with the truth``."""
    if not claims or verdict == "unknown":
        return verdict
    words = []
    for claim in claims:
        if claim.named:
            words.append(_plain(claim.first))
        elif any(_is_right(claim, name, family) for name, family in families.items()):
            words.append("its family")
        elif claim.names & families.keys():
            words.append("set with the truth")
        else:
            words.append("set without it")
    return " + ".join(sorted(words))


def _plain(name: Name) -> str:
    return f"{name[0].partition(':')[0]} {name[1]}"


def _covered(truth: Truth, claims: tuple[Claim, ...]) -> dict[str, bool]:
    found = {}
    for entry in truth.hidden:
        values = {p.key: p for p in entry.behaviour.parameters()}
        for claim in claims:
            if claim.first != entry.name:
                continue
            for key, (low, high) in claim.intervals.items():
                if key in values:
                    true = float(getattr(entry.behaviour, values[key].attribute))
                    if values[key].unit == "rad":
                        true += _TURN * round(((low + high) / 2.0 - true) / _TURN)
                    found[f"{entry.behaviour.effect}.{key}"] = low <= true <= high
    return found
