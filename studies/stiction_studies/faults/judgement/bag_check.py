"""Whether the bag of a case holds what was seen, and can be read."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_messages, stamp_ns
from stiction_ros.records.run.loop_runs import read_bag_parts
from stiction_studies.faults.observation import BagFound, Sampled

COMPARED = ("pv", "op_applied")


def check_bag(path: Path, heard: Mapping[str, Sequence[Sampled]]) -> BagFound:
    """Compare a bag with what was heard of :data:`COMPARED`.

    Args:
        path: the bag.
        heard: messages by topic.
    """
    wanted = {topic: {one.stamp for one in heard.get(topic, ())} for topic in COMPARED}
    expected = sum(len(stamps) for stamps in wanted.values())
    try:
        topics = {f"/{topic}": topic for topic in COMPARED}
        for one in read_messages(path, wanted=lambda topic: topic.name in topics):
            wanted[topics[one.topic]].discard(stamp_ns(one.message))
        missing = sum(len(stamps) for stamps in wanted.values())
        read_bag_parts(path, namespace="/")
    except InputError as error:
        return BagFound(expected, expected, str(error))
    return BagFound(expected, missing)
