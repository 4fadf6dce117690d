"""What ``identify`` says of one valve, as far as it is judged."""

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.records.parts import longest_part
from stiction_ros.records.record import Record

METHOD = "evidence"  # search when none is given
FOUND = ("sticky", "backlash")  # verdicts that find friction
REFUSED = "refused"  # what stands for a verdict where identification refuses the record
VERDICTS = ("sticky", "backlash", "healthy", "undecided", REFUSED)

Interval = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Answer:
    """What ``identify`` says of one valve, as its JSON says it.

    Attributes:
        verdict: one of :data:`VERDICTS`.
        f_s, f_d, band: intervals, in the record's unit of OP; None where it refuses. The band's
            is the sum of the other two where none is given.
        cause: of the oscillation; None where none is given.
        seconds: processor time.
        reason: of a refusal.
    """

    verdict: str
    f_s: Interval | None
    f_d: Interval | None
    band: Interval | None
    cause: str | None
    seconds: float
    reason: str = ""


def answer_of(record: Record, find: Callable[[Record], Mapping[str, Any]]) -> Answer:
    """Return what is said of the first valve of a record.

    Args:
        record: its longest good part is looked at, as ``stiction identify`` does.
        find: record to the mapping of ``identify --json``.
    """
    begun = time.process_time()
    try:
        document = find(longest_part([record]))
    except InputError as error:
        return Answer(REFUSED, None, None, None, None, time.process_time() - begun, str(error))
    valve, output = document["valves"][0], document["outputs"][0]
    f_s, f_d = _interval(valve["f_s_interval"]), _interval(valve["f_d_interval"])
    band = _interval(valve.get("band_interval", [f_s[0] + f_d[0], f_s[1] + f_d[1]]))
    cause = output.get("cause") or {}
    seconds = time.process_time() - begun
    return Answer(valve["verdict"], f_s, f_d, band, cause.get("kind"), seconds)


def _interval(values: Sequence[float]) -> Interval:
    low, high = values
    return float(low), float(high)
