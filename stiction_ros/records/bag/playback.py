"""Which messages of a bag are due: rate, start, loop, pause and step, on a clock given to it."""

import dataclasses
import itertools
import re
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import yaml

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.storage.bag_metadata import QOS_WORDS, BagTopic, Qos
from stiction_ros.records.storage.mcap_scan import RawMessage

SECOND = 10**9
KEPT = ("history", "reliability", "durability")  # of a recorded profile, beside its depth


@dataclasses.dataclass(frozen=True)
class BagContent:
    """What there is to play in a bag."""

    messages: Sequence[RawMessage]  # in the order of the bag
    topics: Mapping[str, BagTopic]  # by name
    first: int  # first, last: least and largest log time, ns
    last: int
    notes: tuple[str, ...]  # what was left out while reading, one sentence each

    @property
    def seconds(self) -> float:
        """Length in seconds of recorded time."""
        return (self.last - self.first) / SECOND


def bag_content(path: str | Path, wanted: str = ".*") -> BagContent:
    """Read the messages of a bag whose full topic names the regular expression ``wanted`` matches.

    Raises:
        InputError: no such bag, damaged, no regular expression, or no message to play.
    """
    try:
        pattern = re.compile(wanted)
    except re.error as error:
        raise InputError(f"no regular expression ({error})", where="topics") from None
    notes: list[str] = []
    messages = [raw for raw in read_raw(path, notes) if pattern.fullmatch(raw.topic.name)]
    if not messages:
        raise InputError(
            "holds no message to play", where=str(path), fix=f"its topics must match {wanted!r}"
        )
    topics = {topic.name: topic for topic in dict.fromkeys(raw.topic for raw in messages)}
    times = [raw.log_time for raw in messages]
    return BagContent(messages, topics, min(times), max(times), tuple(notes))


def offered_qos(topic: BagTopic) -> Qos:
    """Return a profile that suits every reader which the recorded publishers suited.

    Where several publishers offered different profiles it is reliable, or transient local, as
    soon as one of them was, with the largest depth. Without a recorded profile it is reliable
    and volatile. Deadlines and lifespans are not offered: a replay does not keep them.
    """
    try:
        profiles = [
            {
                # bags before version 9 write the numbers of rmw
                key: value.lower() if isinstance(value, str) else QOS_WORDS[key][int(str(value))]
                for key in KEPT
                for value in (profile.get(key, 0),)
            }
            | {"depth": int(profile.get("depth", 0))}
            for profile in yaml.safe_load(topic.qos_yaml or "[]") or []
        ]
    except (yaml.YAMLError, AttributeError, TypeError, ValueError, IndexError):
        raise InputError(
            f"the quality of service of {topic.name} cannot be read", where="offered_qos_profiles"
        ) from None
    said = {key: {str(profile[key]) for profile in profiles} for key in KEPT}
    best_effort = bool(profiles) and said["reliability"] == {"best_effort"}
    latched = "transient_local" in said["durability"]
    keep_all = "keep_all" in said["history"]
    depth = max((int(profile["depth"]) for profile in profiles), default=0)
    return Qos(
        history="keep_all" if keep_all else "keep_last",
        depth=depth if depth > 0 else (1 if latched else 100),
        reliability="best_effort" if best_effort else "reliable",
        durability="transient_local" if latched else "volatile",
    )


class Playback:
    """Plays the messages of a bag in their order, each when its log time has come.

    It is paused until :meth:`resume`. What was latched (transient local) before the start is
    given out first, so that late topics such as a loop model are there from the beginning.

    Args:
        content: of the bag.
        clock: a steady clock, ns.
        rate: recorded seconds per second of the clock, above 0.
        start: seconds of recorded time that are passed over at the beginning, within the bag.
        loop: whether to begin again at the end.
    """

    def __init__(
        self,
        content: BagContent,
        clock: Callable[[], int],
        rate: float = 1.0,
        start: float = 0.0,
        loop: bool = False,
    ) -> None:
        if not 0.0 < rate < float("inf"):
            raise InputError(f"{rate:g} is no rate", where="rate", fix="use one above 0")
        if not 0.0 <= start <= content.seconds:
            raise InputError(
                f"{start:g} s is not within the bag, which lasts {content.seconds:g} s",
                where="start",
            )
        self._clock = clock
        self._begin = content.first + round(start * SECOND)
        self._messages = _from(content, self._begin)
        self._rate, self._loop = rate, loop
        self.paused = True
        self.finished = False
        self.rounds = self.played = self._place = 0
        self._bag_time, self._since = self._begin, clock()

    @property
    def time(self) -> int:
        """Recorded time that is being played, ns."""
        if self.paused or self.finished:
            return self._bag_time
        return self._bag_time + round((self._clock() - self._since) * self._rate)

    @property
    def rate(self) -> float:
        """Recorded seconds per second of the clock; may be set at any time."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._anchor()
        self._rate = rate

    def pause(self) -> None:
        """Stop the recorded time."""
        self._anchor()
        self.paused = True

    def resume(self) -> None:
        """Let the recorded time go on from where it stopped."""
        self._anchor()
        self.paused = False

    def next_messages(self) -> list[RawMessage]:
        """Return every message of the next log time; a running playback gives none."""
        if not self.paused or self.finished:
            return []
        time = self._messages[self._place].log_time
        self._bag_time = max(self._bag_time, time)
        return self._taken(lambda message: message.log_time == time)

    def due(self, most: int) -> list[RawMessage]:
        """Return up to ``most`` messages whose time has come, in the order of the bag."""
        now = self.time
        return [] if self.paused else self._taken(lambda message: message.log_time <= now, most)

    def _taken(
        self, wanted: Callable[[RawMessage], bool], most: float = float("inf")
    ) -> list[RawMessage]:
        """Return the next messages of this round as long as they are ``wanted``."""
        found: list[RawMessage] = []
        round_before = self.rounds
        while not self.finished and self.rounds == round_before and len(found) < most:
            if not wanted(self._messages[self._place]):
                break
            found.append(self._take())
        return found

    def _take(self) -> RawMessage:
        message = self._messages[self._place]
        self._place += 1
        self.played += 1
        if self._place == len(self._messages):
            if self._loop:
                self.rounds += 1
                self._bag_time, self._since, self._place = self._begin, self._clock(), 0
            else:
                self._bag_time, self.finished = max(self.time, message.log_time), True
        return message

    def _anchor(self) -> None:
        self._bag_time, self._since = self.time, self._clock()


def _from(content: BagContent, begin: int) -> list[RawMessage]:
    """Return the messages from a log time on, after those that are latched before it."""
    held: dict[str, deque[RawMessage]] = {}
    for name, topic in content.topics.items():
        qos = offered_qos(topic)
        if qos.durability == "transient_local":
            held[name] = deque(maxlen=qos.depth)
    place = 0
    while place < len(content.messages) and content.messages[place].log_time < begin:
        message = content.messages[place]
        if message.topic.name in held:
            held[message.topic.name].append(message)
        place += 1
    latched = itertools.chain(*held.values())
    return [*sorted(latched, key=lambda message: message.log_time), *content.messages[place:]]
