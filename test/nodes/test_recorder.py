"""The recorder among publishers: which topics it takes, how, and what it tells of the rest."""

from pathlib import Path
from typing import Any

import pytest

from stiction_ros.errors import InputError
from stiction_ros.nodes.recorder import topic_choice

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")


from as_given import run_metadata
from graph import Graph
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String

from stiction_ros.nodes import recorder
from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS
from stiction_ros.records.bag.messages import read_messages, read_raw
from stiction_ros.records.storage.mcap_scan import McapScan

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class Desk:
    """A recorder and a node whose publishers the test uses."""

    def __init__(self, graph: Graph, directory: Path, **values: Any) -> None:
        self.graph = graph
        self.bag = directory / "bag"
        self.node = graph.plain("desk")
        self.recorder = graph.add("recorder", {"directory": str(self.bag)} | values)
        self.recorder.start()
        assert self.recorder.failure == ""

    def publisher(self, topic: str, qos: QoSProfile = SIGNAL_QOS) -> Any:
        return self.node.create_publisher(String, topic, qos)

    def heard(self, *topics: str) -> None:
        """Spin until the recorder writes these topics."""
        self.graph.spin_until(
            lambda: all(self.node.count_subscribers(t) for t in topics), f"{topics} to be heard"
        )

    def count(self, topic: str, number: int) -> None:
        self.graph.spin_until(
            lambda: self.recorder.writer.counts.get(topic) == number, f"{number} on {topic}"
        )

    def own_counts(self) -> list[int]:
        """Return what each status of the recorder in the bag says of how many there were."""
        key = "published:/diagnostics"
        return [
            int(value.value)
            for message in read_messages(self.bag, wanted=lambda t: t.name == "/diagnostics")
            for value in message.message.status[0].values
            if value.key == key
        ]

    def close(self) -> dict[str, list[str]]:
        """Finish the bag; return the texts in it by topic."""
        self.recorder.finish()
        found: dict[str, list[str]] = {}
        for message in read_messages(self.bag, wanted=lambda t: t.type.endswith("/String")):
            found.setdefault(message.topic, []).append(message.message.data)
        return found

    def health(self) -> tuple[str, dict[str, str]]:
        level, _, values = self.recorder.health()
        if self.recorder.noticed.level == "error":
            level = "error"
        return level, {key: str(value) for key, value in values}


def test_a_late_topic_and_one_that_was_latched_before(graph: Graph, tmp_path: Path) -> None:
    early = graph.plain("early").create_publisher(String, "/early", LATCHED_QOS)
    early.publish(String(data="before the recorder"))
    desk = Desk(graph, tmp_path)
    late = desk.publisher("/late")
    desk.heard("/early", "/late")
    late.publish(String(data="after it"))
    desk.count("/late", 1)
    desk.count("/early", 1)
    texts = desk.close()
    assert texts["/early"] == ["before the recorder"]
    assert texts["/late"] == ["after it"]


@pytest.mark.parametrize(
    ("values", "recorded"),
    [
        ({"topics": ["/b", "/a"], "regex": ""}, {"/a", "/b"}),
        ({"topics": ["a"], "regex": "/c.*"}, {"/a", "/cc"}),
        ({"exclude_regex": "/(?!a|b).*"}, {"/a", "/b"}),
    ],
)
def test_only_chosen_topics_are_recorded(
    values: dict[str, Any], recorded: set[str], graph: Graph, tmp_path: Path
) -> None:
    desk = Desk(graph, tmp_path, **values)
    for topic in ("/a", "/b", "/cc"):
        desk.publisher(topic)
    desk.heard(*recorded)
    graph.spin_some()
    assert set(desk.recorder.writer.counts) == recorded


def test_offered_qos_is_in_the_bag(graph: Graph, tmp_path: Path) -> None:
    desk = Desk(graph, tmp_path, regex="/(kept|loose)")
    desk.publisher("/kept", LATCHED_QOS)
    desk.publisher("/loose", BEST_EFFORT)
    desk.heard("/kept", "/loose")
    desk.close()
    scan = McapScan(desk.bag / "bag_0.mcap")
    assert list(scan.messages()) == []
    offered = {topic.name: topic.qos_yaml for topic in scan.topics.values()}
    assert "durability: transient_local" in offered["/kept"]
    assert "reliability: best_effort" in offered["/loose"]
    assert "sec: 9223372036" in offered["/loose"]  # no deadline


def test_a_best_effort_publisher_is_heard(graph: Graph, tmp_path: Path) -> None:
    desk = Desk(graph, tmp_path, regex="/loose")
    publisher = desk.publisher("/loose", BEST_EFFORT)
    desk.heard("/loose")
    graph.spin_until(lambda: publisher.get_subscription_count() == 1, "the match")
    publisher.publish(String(data="x"))
    desk.count("/loose", 1)


def test_a_publisher_that_offers_too_little_later_is_told(graph: Graph, tmp_path: Path) -> None:
    desk = Desk(graph, tmp_path, regex="/pv")
    desk.publisher("/pv")
    desk.heard("/pv")
    volatile = QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, durability=DurabilityPolicy.VOLATILE
    )
    graph.plain("sloppy").create_publisher(String, "/pv", volatile)
    graph.spin_until(lambda: desk.health()[0] == "warn", "the warning")
    assert desk.health()[1]["unheard:/pv"].startswith("sloppy: ")


def test_a_bag_goes_on_in_the_next_file(graph: Graph, tmp_path: Path) -> None:
    desk = Desk(graph, tmp_path, regex="/text", max_bag_size=4000)
    publisher = desk.publisher("/text")
    desk.heard("/text")
    for number in range(60):
        publisher.publish(String(data=f"{number:200d}"))
    desk.count("/text", 60)
    assert [int(text) for text in desk.close()["/text"]] == list(range(60))
    assert len(list(desk.bag.glob("*.mcap"))) > 3


def test_what_nodes_say_of_the_run_is_kept_beside_the_messages(
    graph: Graph, tmp_path: Path
) -> None:
    desk = Desk(graph, tmp_path)
    config = desk.publisher("/plant/config", LATCHED_QOS)
    model = desk.publisher("/loop_model", LATCHED_QOS)
    config.publish(String(data="seed: 9\nversion: '0.1'"))
    model.publish(String(data="loop: tank"))
    desk.count("/plant/config", 1)
    desk.count("/loop_model", 1)
    assert run_metadata(desk.bag)["loop_model:/loop_model"] == "loop: tank"  # before any close
    desk.close()
    assert run_metadata(desk.bag)["seed"] == "9"


def test_its_own_first_and_last_status_are_in_the_bag(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "DISCOVERY_PERIOD", 3600.0)  # it begins before it looks again
    desk = Desk(graph, tmp_path)
    graph.spin_until(lambda: desk.recorder.running, "the recorder to begin")
    desk.close()
    assert desk.own_counts() == [1, 2]
    assert desk.recorder.outlets["/diagnostics"].count == 2


@pytest.mark.parametrize("end", ["finish", "trigger_cleanup"])
def test_what_has_arrived_at_the_end_is_in_the_bag(end: str, graph: Graph, tmp_path: Path) -> None:
    desk = Desk(graph, tmp_path, regex="/(text|word)")
    publishers = [desk.publisher(topic) for topic in ("/text", "/word")]
    desk.heard("/text", "/word")
    for number in range(20):
        for publisher in publishers:
            publisher.publish(String(data=str(number)))
    assert all(publisher.wait_for_all_acked() for publisher in publishers)
    if end == "trigger_cleanup":
        desk.recorder.trigger_deactivate()
    getattr(desk.recorder, end)()
    told = [str(number) for number in range(20)]
    assert desk.close() == {"/text": told, "/word": told}


def test_a_storage_that_refuses_is_told_and_recording_goes_on(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk = Desk(graph, tmp_path, regex="/text")
    publisher = desk.publisher("/text")
    desk.heard("/text")
    whole = desk.recorder.writer.write

    def refuse(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(desk.recorder.writer, "write", refuse)
    publisher.publish(String(data="lost"))
    graph.spin_until(lambda: desk.health()[0] == "error", "the error")
    assert desk.health()[1]["lost"] == "1"
    monkeypatch.setattr(desk.recorder.writer, "write", whole)
    publisher.publish(String(data="kept"))
    desk.count("/text", 1)
    assert desk.close()["/text"] == ["kept"]


def test_a_bag_that_cannot_be_finished_is_a_failure_and_can_be_read(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk = Desk(graph, tmp_path, regex="/text")
    publisher = desk.publisher("/text")
    desk.heard("/text")
    publisher.publish(String(data="kept"))
    desk.count("/text", 1)

    def refuse(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("stiction_ros.records.bag.finish.os.fsync", refuse)
    desk.recorder.finish()
    assert "not finished (No space left on device)" in desk.recorder.failure
    assert len(list(read_raw(desk.bag))) == 1


@pytest.mark.parametrize(
    ("names", "regex", "exclude", "chosen"),
    [
        ([], ".*", "", ["/pv", "/op", "/a/pv"]),
        (["/pv"], "", "", ["/pv"]),
        (["/op"], ".*/pv", "", ["/pv", "/op", "/a/pv"]),
        ([], "/pv", "", ["/pv"]),
        (["/pv", "/op"], "", "/p.*", ["/op"]),
        ([], ".*", "/a/.*", ["/pv", "/op"]),
    ],
)
def test_names_and_expressions(
    names: list[str], regex: str, exclude: str, chosen: list[str]
) -> None:
    choice = topic_choice(names, regex, exclude)
    assert [topic for topic in ("/pv", "/op", "/a/pv") if choice(topic)] == chosen


@pytest.mark.parametrize(
    ("names", "regex", "exclude", "said"),
    [
        ([], "", "", "no topic is chosen; set topics or regex"),
        ([], "(", "", "recorder: regex: no regular expression"),
        (["/pv"], "", "[", "recorder: exclude_regex: no regular expression"),
    ],
)
def test_errors(names: list[str], regex: str, exclude: str, said: str) -> None:
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        topic_choice(names, regex, exclude)
