"""Which behaviours the workflow did not consider, and why: nothing is left out silently."""

import dataclasses
from collections.abc import Sequence

from stiction_ros.discrepancy.candidate.base import Candidate
from stiction_ros.discrepancy.data.controller_check import ControllerCheck, ControllerStatus
from stiction_ros.discrepancy.data.gate import SHOWN
from stiction_ros.effects import Behaviour, Offset, TimeShift, Tuning, behaviours

ALONE = (
    "samples of {name} that stand alone, {count} of them, were left out before the search: what "
    "shows only there is not searched"
)
ABSORBED = "the process was fitted to these records, which does as well"
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
    found = []
    for kind in behaviours():
        for place in kind.places:
            if _by_other_means(kind, controller):
                continue
            if (place, kind.effect) in keys and (kind.law is None or kind in searched):
                continue
            found.append(NotConsidered(place, kind.effect, kind.law, _reason(kind, candidates)))
    return tuple(found)


def left_out(outputs: Sequence[str], alone: Sequence[int]) -> tuple[NotConsidered, ...]:
    """Return what the gate took from the records before any effect was searched in them.

    Args:
        outputs: tags.
        alone: per output the single samples far off both neighbours.
    """
    return tuple(
        NotConsidered("sensor", "spikes", None, ALONE.format(name=name, count=count))
        for name, count in zip(outputs, alone, strict=False)
        if count
    )


def _by_other_means(kind: type[Behaviour], controller: ControllerCheck) -> bool:
    """Tell whether the gate, the check of the controller or the list of the untestable has it."""
    if kind in (Tuning, TimeShift):
        return controller.status is not ControllerStatus.NOT_ASKED
    return kind in SHOWN or kind is Offset


def _reason(kind: type[Behaviour], candidates: Sequence[Candidate]) -> str:
    if kind.absorbed and not any(c.absorbed for c in candidates):
        return ABSORBED
    said = kind.not_searched
    plain = said == Behaviour.not_searched
    return NO_ROOM if plain and _has_candidate(kind) else said


def _of_ones_own(kind: type[Behaviour]) -> bool:
    shipped = kind.__module__.startswith("stiction_ros.effects.")
    return not shipped or kind.__module__.startswith("stiction_ros.effects.own.")


def _has_candidate(kind: type[Behaviour]) -> bool:
    """Tell whether there is a candidate for it where the records call for one."""
    names_axes = kind.axes.__func__ is not Behaviour.axes.__func__  # type: ignore[attr-defined]
    return names_axes or not _of_ones_own(kind)
