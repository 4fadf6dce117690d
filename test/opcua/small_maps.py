"""A tag map of one loop with one valve, and readings for it."""

from stiction_ros.opcua.sampling import TagQuality, TagReading
from stiction_ros.opcua.tag_map import GrantTags, LoopTags, OutputTags, ValveTags

SECOND = 1_000_000_000
START = 1_000 * SECOND
PV, SP, OP, MODE, ROUT = "s=PV", "s=SP", "s=OP", "s=MODE", "s=ROUT"
REQUEST, BEAT, ALIVE = "s=REQUEST", "s=BEAT", "s=ALIVE"


def loop_tags(**changes: object) -> LoopTags:
    told: dict[str, object] = {
        "loop": "unit",
        "namespace": "unit",
        "sample_time": 1.0,
        "outputs": (OutputTags("PV1", PV, SP),),
        "valves": (ValveTags("V1", OP, ROUT, MODE, rate=2.0),),
        "grant": GrantTags(REQUEST, ("ROUT",), BEAT, ALIVE, 5.0),
    }
    return LoopTags(**{**told, **changes})  # type: ignore[arg-type]


def at(seconds: float) -> int:
    return START + round(seconds * SECOND)


def good(value: float | str, seconds: float, first: bool = False) -> TagReading:
    return TagReading(value, TagQuality.GOOD, at(seconds), first)


def bad(seconds: float, quality: TagQuality = TagQuality.BAD) -> TagReading:
    return TagReading(7.0, quality, at(seconds))
