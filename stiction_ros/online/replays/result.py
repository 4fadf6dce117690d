"""What a replay says: fits, ``op`` and changes of mode, each held against the recorded ones."""

import dataclasses
import enum
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from stiction_ros.online.loop_estimator import SECOND, Fit
from stiction_ros.online.replays.bag import ReplayBag
from stiction_ros.records.run.events import ModeChange, swap_of
from stiction_ros.texts import finite


class Match(enum.StrEnum):
    """How something replayed compares with what was recorded."""

    EQUAL = "equal"
    DIFFERENT = "different"
    NOT_COMPARED = "not_compared"


@dataclasses.dataclass(frozen=True)
class Comparison:
    """How many recorded things were compared, and how many came again, equal in every bit."""

    compared: int = 0
    equal: int = 0
    difference: str = ""  # the first difference, or why nothing is compared; empty when equal

    @classmethod
    def whole(cls, recorded: Any, replayed: Any) -> "Comparison":
        difference = first_difference(recorded, replayed)
        return cls(1, int(not difference), difference)

    @classmethod
    def each(
        cls, called: Callable[[int], str], recorded: Mapping[int, Any], replayed: Mapping[int, Any]
    ) -> "Comparison":
        """Compare all that was recorded, by stamp in ns; ``called`` names the one of a stamp."""
        found = []
        for stamp, was in recorded.items():
            difference = "recorded, not replayed"
            if stamp in replayed:
                difference = first_difference(was, replayed[stamp])
            if difference:
                found.append(f"{called(stamp)}: {difference}")
        return cls(len(recorded), len(recorded) - len(found), found[0] if found else "")

    @property
    def match(self) -> Match:
        """How the two compare."""
        if not self.compared:
            return Match.NOT_COMPARED
        return Match.EQUAL if self.equal == self.compared else Match.DIFFERENT


@dataclasses.dataclass(frozen=True)
class FitMatch:
    """One fit of the replay, whether the bag holds its whole window, and how it compares."""

    fit: Fit
    whole: bool
    comparison: Comparison


@dataclasses.dataclass(frozen=True)
class Replay:
    """A replay and its comparison with what was recorded."""

    bag: ReplayBag  # the recorded run
    origin: int  # stamp of sample 0 of the run, ns
    from_first_sample: bool  # whether the bag holds the run from its first sample
    samples: int  # of the run up to the end of the bag
    fits: tuple[FitMatch, ...]  # every fit that was due within the bag
    changes: tuple[ModeChange, ...]  # changes of mode in the replay
    # modes, op: None without a configuration of a controller, and for a bag that begins late;
    # modes are equal when stamps, modes, models, reasons and frictions are
    modes: Comparison | None
    op: Comparison | None
    # measurements of the gap and windows looked into; None when the estimator ran without monitor
    monitor: tuple[Comparison, Comparison] | None
    notes: tuple[str, ...]  # what stands in the way of equality, one sentence each

    @property
    def _compared(self) -> Iterator[tuple[Match, str]]:
        """What came of each comparison, with its difference: fits, ``op``, modes, monitor."""
        for fit in self.fits:
            said = f"fit at {self.seconds(fit.fit.stamp):.9g} s: {fit.comparison.difference}"
            yield fit.comparison.match, said
        for one in (self.op, self.modes, *(self.monitor or ())):
            if one is not None:
                yield one.match, one.difference

    @property
    def match(self) -> Match:
        """``different`` when anything compared differs, ``equal`` when anything is compared."""
        return _altogether(match for match, _ in self._compared)

    @property
    def first_difference(self) -> str:
        """The first difference: of fits, ``op``, modes, then the monitor; empty for none."""
        return next((said for match, said in self._compared if match is Match.DIFFERENT), "")

    @property
    def swaps(self) -> tuple[ModeChange | None, ModeChange | None]:
        """The swap that was recorded and the replayed one."""
        return swap_of(self.bag.modes), swap_of(self.changes)

    def seconds(self, stamp: int) -> float:
        """Return the time of a stamp in s since the first sample of the run."""
        return (stamp - self.origin) / SECOND

    def to_dict(self) -> dict[str, Any]:
        """Return the mapping of ``replay --json``; times in s since the run's first sample."""
        document = {
            "bag": self.bag.name,
            "match": self.match.value,
            "first_difference": self.first_difference,
            "from_first_sample": self.from_first_sample,
            "samples": self.samples,
            "fits": [self._fit(match) for match in self.fits],
            "op": None if self.op is None else self._op(self.op),
            "modes": None if self.modes is None else self._modes(self.modes),
            "swap": None if self.modes is None else self._swap(),
            "monitor": None if self.monitor is None else self._monitor(*self.monitor),
            "notes": list(self.notes),
        }
        return dict(finite(document))

    def _fit(self, match: FitMatch) -> dict[str, Any]:
        update = match.fit.update
        valves = () if update is None else update.identification.valves
        return {
            "sample": match.fit.end,
            "time": self.seconds(match.fit.stamp),
            "match": match.comparison.match.value,
            "difference": match.comparison.difference,
            "whole_window": match.whole,
            "failure": match.fit.failure,
            "loop_model": bool(match.fit.model_text),
            "valves": [valve.to_dict() for valve in valves],
        }

    def _op(self, op: Comparison) -> dict[str, Any]:
        return {"compared": op.compared, "equal": op.equal, "first_difference": op.difference}

    def _modes(self, modes: Comparison) -> dict[str, Any]:
        return {
            "match": modes.match.value,
            "difference": modes.difference,
            "recorded": [self._change(change) for change in self.bag.modes],
            "replayed": [self._change(change) for change in self.changes],
        }

    def _swap(self) -> dict[str, float | None]:
        times = [None if swap is None else self.seconds(swap.stamp) for swap in self.swaps]
        return dict(zip(("recorded", "replayed"), times, strict=True))

    def _monitor(self, looks: Comparison, findings: Comparison) -> dict[str, Any]:
        return {
            "looks": looks.compared,
            "equal_looks": looks.equal,
            "findings": findings.compared,
            "equal_findings": findings.equal,
            "match": _altogether((looks.match, findings.match)).value,
            "difference": looks.difference or findings.difference,
        }

    def _change(self, change: ModeChange) -> dict[str, Any]:
        return {
            "time": self.seconds(change.stamp),
            "mode": change.mode,
            "model": change.model,
            "reason": change.reason,
            "friction": dict(change.frictions),
        }


def _altogether(found: Iterable[Match]) -> Match:
    """Return ``different`` when anything compared differs, ``equal`` when anything is compared."""
    matches = set(found)
    order = (Match.DIFFERENT, Match.EQUAL)
    return next((match for match in order if match in matches), Match.NOT_COMPARED)


def first_difference(recorded: Any, found: Any, place: str = "") -> str:
    """Return where two JSON documents differ first and how; empty when they are equal.

    What the version that recorded did not know is no difference.
    """
    if isinstance(recorded, Mapping) and isinstance(found, Mapping):
        pairs = [(str(key), was, found.get(key)) for key, was in recorded.items()]
    elif isinstance(recorded, list) and isinstance(found, list) and len(recorded) == len(found):
        pairs = [(str(k), *pair) for k, pair in enumerate(zip(recorded, found, strict=True))]
    else:
        said = "" if recorded == found else f"recorded {recorded!r}, replayed {found!r}"
        return (f"{place}: {said}" if place and said else said)[:300]
    for key, was, now in pairs:
        difference = first_difference(was, now, f"{place}.{key}" if place else key)
        if difference:
            return difference
    return ""
