"""What the state of an input port means for the health of its node."""

from collections import Counter

from stiction_ros.online.health import Notice, stopped_after
from stiction_ros.online.input.port import InputPort

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

    def __init__(self, port: InputPort) -> None:
        """Begin to count; in lockstep no period is known."""
        self._port = port
        self._before: Counter[str] = Counter()

    def look(self, now: float, running: float) -> list[Notice]:
        """Return what to notice; what never came is as old as the node, ``running`` s."""
        found, port, ages = list[Notice](), self._port, self._port.ages(now)
        longest = stopped_after(port.period) if port.period else LOCKSTEP
        age = min(ages.get("pv", running), running)
        if age > longest:
            found.append(Notice("pv", "error", f"no pv for {age:.1f} s"))
        elif port.lacks and port.waiting >= WAITING:
            found.append(Notice("start", "error", f"nothing is stepped, {port.lacks} lacks"))
        told = ages.get("op_applied")
        if told is not None and told > longest >= age:
            found.append(Notice("op_applied", "warn", f"no op_applied for {told:.1f} s"))
        if port.behind:
            found.append(Notice("behind", "warn", f"{port.behind} samples behind"))
        grown = port.counts - self._before
        self._before = Counter(port.counts)
        found += [
            Notice(reason, "warn", f"{SAID[reason]}: {port.counts[reason]}")
            for reason in SAID
            if grown[reason]
        ]
        return found


def keys(port: InputPort, now: float) -> list[tuple[str, object]]:
    """Return ages and counts of a port as the keys and values of a status."""
    ages, seen = list[tuple[str, object]](), port.ages(now)
    for topic in ("pv", "sp", "op_applied"):
        age = seen.get(topic)
        ages.append((f"{topic}_age", "" if age is None else f"{age:.3f}"))
        if port.period:
            samples = "" if age is None else f"{age / port.period:.1f}"
            ages.append((f"{topic}_age_samples", samples))
    counts = [(reason.replace(" ", "_"), port.counts[reason]) for reason in SAID]
    return [*ages, ("samples_behind", port.behind), *counts]
