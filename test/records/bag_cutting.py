"""Parts and spoilt copies of a bag."""

from collections.abc import Callable
from pathlib import Path

from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.playback import offered_qos
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.bag_metadata import Qos
from stiction_ros.records.storage.mcap_scan import RawMessage

SECOND = 10**9
Change = Callable[[RawMessage], RawMessage | None]


def copy_bag(source: Path, target: Path, change: Change) -> Path:
    """Copy what ``change`` gives back of every message."""
    profiles: dict[str, Qos] = {}
    with BagWriter(target) as writer:
        for raw in read_raw(source):
            kept = change(raw)
            if kept is None:
                continue
            topic = kept.topic
            if topic.name not in profiles:
                profiles[topic.name] = qos = offered_qos(topic)
                writer.add_topic(topic.name, topic.type, topic.definition, topic.type_hash, qos)
            writer.write(topic.name, kept.data, kept.log_time, kept.publish_time)
    return target


def cut_bag(source: Path, target: Path, first: float = 0.0, last: float = 1e9) -> Path:
    """Copy what lies between two times in s, with what is latched at the first."""

    def between(raw: RawMessage) -> RawMessage | None:
        if raw.log_time >= last * SECOND:
            return None
        if raw.log_time >= first * SECOND:
            return raw
        if "transient_local" not in raw.topic.qos_yaml:
            return None
        return raw._replace(log_time=round(first * SECOND))

    return copy_bag(source, target, between)
