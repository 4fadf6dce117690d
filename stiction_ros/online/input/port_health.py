"""What the state of an input port means for the health of its node."""

from collections import Counter

from stiction_ros.online.health import Notice, stopped_after
from stiction_ros.online.input.samples import PortState

WAITING = 3  # PVs after which a run should have begun
LOCKSTEP = 5.0  # s: a plant in lockstep shows its sample again every second

# What is counted -> how it is said; the others are the usual course of a run.
SAID = {
    "wrong tags": "messages without the tags of this loop",
    "bad values": "values that are no numbers",
    "out of range": "PV out of its range or too fast",
    "refused sp": "set-points out of range",
    "refused dv": "disturbances that are no numbers",
    "refused op_applied": "op_applied that is no number",
    "refused sp_preview": "previews that do not fit",
    "stale": "PV with stamps of the past",
    "ahead": "PV with stamps of the future",
    "late": "PV that came after their sample",
    "missing": "samples without a PV",
    "blind": "samples stepped without a PV",
    "passed over": "samples passed over for newer ones",
    "late op": "OP that went out too late",
    "overflow": "messages for which there was no room",
    "new runs": "runs that began anew",
}


class PortHealth:
    """Says at each look what is wrong now, or has happened since the last look."""

    def __init__(self, lockstep: bool) -> None:
        """Begin to count; ``lockstep`` knows no period."""
        self._lockstep = lockstep
        self._before: Counter[str] = Counter()

    def look(self, state: PortState, running: float) -> list[Notice]:
        """Return what to notice; what never came is as old as the node, ``running`` s."""
        found = []
        longest = LOCKSTEP if self._lockstep else stopped_after(state.period)
        age = min(state.ages.get("pv", running), running)
        if age > longest:
            found.append(Notice("pv", "error", f"no pv for {age:.1f} s"))
        elif state.lacks and state.waiting >= WAITING:
            found.append(Notice("start", "error", f"nothing is stepped, {state.lacks} lacks"))
        told = state.ages.get("op_applied")
        if told is not None and told > longest >= age:
            found.append(Notice("op_applied", "warn", f"no op_applied for {told:.1f} s"))
        if state.behind:
            found.append(Notice("behind", "warn", f"{state.behind} samples behind"))
        grown = Counter(state.counts) - self._before
        self._before = Counter(state.counts)
        found += [
            Notice(reason, "warn", f"{SAID[reason]}: {state.counts[reason]}")
            for reason in SAID
            if grown[reason]
        ]
        return found


def keys(state: PortState) -> list[tuple[str, object]]:
    """Return ages and counts as the keys and values of a status."""
    ages: list[tuple[str, object]] = []
    for topic in ("pv", "sp", "op_applied"):
        age = state.ages.get(topic)
        ages.append((f"{topic}_age", "" if age is None else f"{age:.3f}"))
        if state.period:
            samples = "" if age is None else f"{age / state.period:.1f}"
            ages.append((f"{topic}_age_samples", samples))
    counts = [(reason.replace(" ", "_"), state.counts.get(reason, 0)) for reason in SAID]
    return [*ages, ("samples_behind", state.behind), *counts]
