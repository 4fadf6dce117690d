"""The recorder of one loop among several, its log time, and its bag when somebody removes it."""

import functools
import shutil
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from graph import Graph
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.nodes import recorder as recorder_module
from stiction_ros.nodes.recorder import RecorderNode, free_directory
from stiction_ros.nodes.shared import managed as managed_module
from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import SECOND, joint_state, to_stamp
from stiction_ros.online.health import Noticed
from stiction_ros.records.bag.messages import read_messages, read_raw
from stiction_ros.records.run.loop_runs import read_bag_parts


@pytest.fixture(autouse=True)
def _quick_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five looks at the bag a second, and errors that are shown for a second."""
    monkeypatch.setattr(recorder_module, "BAG_PERIOD", 0.2)
    monkeypatch.setattr(managed_module, "Noticed", functools.partial(Noticed, shown=1.0))


class Site:
    """A recorder in a namespace, and a node that speaks for the loops around it."""

    def __init__(self, graph: Graph, bag: Path, namespace: str = "/unit1", **values: Any) -> None:
        self.graph, self.bag = graph, bag
        self.node = graph.plain("site")
        self._publishers: dict[str, Any] = {}
        overrides = [Parameter(k, value=v) for k, v in ({"directory": str(bag)} | values).items()]
        self.recorder = graph.adopt(
            RecorderNode(context=graph.context, namespace=namespace, parameter_overrides=overrides)
        )
        self.recorder.start()
        assert self.recorder.failure == ""

    def offer(self, **kinds: Any) -> None:
        """Create publishers, ``unit1__pv`` for ``/unit1/pv``, and wait until they are heard."""
        for name, kind in kinds.items():
            topic = "/" + name.replace("__", "/")
            self._publishers[topic] = self.node.create_publisher(kind, topic, SIGNAL_QOS)

    def heard(self, *topics: str) -> None:
        self.graph.spin_until(
            lambda: all(self.node.count_subscribers(topic) for topic in topics), f"{topics}"
        )

    def say(self, topic: str, message: Any) -> None:
        """Publish, and wait until it is in the bag."""
        count = self.recorder.writer.counts.get(topic, 0)
        self._publishers[topic].publish(message)
        self.graph.spin_until(
            lambda: self.recorder.writer.counts.get(topic, 0) > count, f"{topic} in the bag"
        )

    def send(self, topic: str, message: Any) -> None:
        self._publishers[topic].publish(message)

    def clock(self, seconds: int) -> None:
        self.say("/clock", Clock(clock=to_stamp(seconds * SECOND)))

    def sample(self, seconds: int) -> None:
        self.say("/unit1/pv", joint_state(seconds * SECOND, ["P"], [1.0 + seconds]))
        self.say("/unit1/op", joint_state(seconds * SECOND, ["V"], [2.0 * seconds]))

    def health(self) -> tuple[str, str, dict[str, str]]:
        level, said, values = self.recorder.health()
        if self.recorder.noticed.level == "error":
            level, said = "error", self.recorder.noticed.text
        return level, said, {key: str(value) for key, value in values}


def test_a_recorder_in_a_namespace_records_its_own_loop(graph: Graph, tmp_path: Path) -> None:
    site = Site(graph, tmp_path / "bag")
    names = ("unit1__pv", "unit1__a__b", "unit10__pv", "unit2__pv", "pv")
    site.offer(**dict.fromkeys(names, String), clock=Clock)
    own = ("/unit1/pv", "/unit1/a/b", "/diagnostics", "/clock")  # its own diagnostics
    site.heard(*own)
    graph.spin_some()
    recorded = set(site.recorder.writer.counts)
    assert set(own) <= recorded
    assert not recorded & {"/unit10/pv", "/unit2/pv", "/pv"}


@pytest.mark.parametrize(
    ("values", "wanted", "other"),
    [
        ({"regex": "/unit2/.*"}, "/unit2/pv", "/unit1/pv"),
        ({"topics": ["/unit2/pv"], "regex": ""}, "/unit2/pv", "/unit1/pv"),
        ({"topics": ["/unit2/pv"]}, "/unit2/pv", "/unit3/pv"),
    ],
)
def test_what_is_asked_for_wins(
    values: dict[str, Any], wanted: str, other: str, graph: Graph, tmp_path: Path
) -> None:
    site = Site(graph, tmp_path / "bag", **values)
    site.offer(unit1__pv=String, unit2__pv=String, unit3__pv=String)
    site.heard(wanted)
    graph.spin_some()
    assert wanted in site.recorder.writer.counts
    assert other not in site.recorder.writer.counts


def log_times(bag: Path) -> list[int]:
    return [raw.log_time for raw in read_raw(bag)]


def test_log_time_goes_by_the_loops_own_samples_where_two_clocks_run(
    graph: Graph, tmp_path: Path
) -> None:
    site = Site(graph, tmp_path / "bag")
    site.offer(unit1__pv=JointState, unit1__op=JointState, clock=Clock, unit1__text=String)
    site.heard("/unit1/pv", "/unit1/op", "/clock", "/unit1/text")
    site.say("/unit1/text", String(data="before any simulated time"))
    for k in range(5, 40):
        site.clock(k)  # of this loop
        site.sample(k)
        site.clock(1000 - k)  # of another one
    site.recorder.finish()
    times = log_times(site.bag)
    assert times == sorted(times)
    of_pv = [m.log_time for m in read_messages(site.bag) if m.topic == "/unit1/pv"]
    assert of_pv == [k * SECOND for k in range(5, 40)]
    assert (times[0], times[-1]) == (5 * SECOND, 39 * SECOND)


@pytest.mark.parametrize("namespace", ["/unit1", "/"])
def test_log_time_goes_on_when_the_plant_is_restarted(
    namespace: str, graph: Graph, tmp_path: Path
) -> None:
    site = Site(graph, tmp_path / "bag", namespace)
    site.offer(unit1__pv=JointState, unit1__op=JointState, clock=Clock)
    site.heard("/unit1/pv", "/unit1/op", "/clock")
    for k in [*range(500, 520), *range(30)]:
        site.clock(k)
        site.sample(k)
    site.recorder.finish()
    times = log_times(site.bag)
    assert times == sorted(times)
    assert times[-1] == (519 + 29) * SECOND
    parts = read_bag_parts(site.bag)
    assert [(part.start, len(part)) for part in parts] == [(500.0, 20), (0.0, 30)]


def test_it_can_be_cleaned_up_and_configured_again(graph: Graph, tmp_path: Path) -> None:
    site = Site(graph, tmp_path / "bag")
    site.offer(unit1__text=String)
    for number in range(3):
        if number:
            site.recorder.trigger_configure()
            site.recorder.trigger_activate()
            assert site.recorder.failure == ""
        site.heard("/unit1/text")
        site.say("/unit1/text", String(data=str(number)))
        site.recorder.trigger_deactivate()
        site.recorder.trigger_cleanup()
        graph.spin_until(lambda: not site.node.count_subscribers("/unit1/text"), "the end")
    for number, name in enumerate(("bag", "bag_2", "bag_3")):
        texts = [m.message.data for m in read_messages(tmp_path / name) if m.topic == "/unit1/text"]
        assert texts == [str(number)]
        assert (tmp_path / name / "metadata.yaml").is_file()


def test_a_bag_that_is_not_its_own_is_never_written_beside(graph: Graph, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "x").write_text("of somebody")
    overrides = [Parameter("directory", value=str(tmp_path / "bag"))]
    node = graph.adopt(RecorderNode(context=graph.context, parameter_overrides=overrides))
    node.trigger_configure()
    assert "exists and is not empty; choose another place or move it away" in node.failure
    shutil.rmtree(tmp_path / "bag")
    node.trigger_configure()
    assert node.failure == ""


def test_where_the_next_bag_goes(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    assert free_directory(bag, []) == bag
    assert free_directory(bag, [bag]) == bag  # it was moved away
    bag.mkdir()
    assert free_directory(bag, []) == bag  # which is refused, as it is not its own
    assert free_directory(bag, [bag]) == tmp_path / "bag_2"
    (tmp_path / "bag_2").mkdir()
    assert free_directory(bag, [bag, tmp_path / "bag_2"]) == tmp_path / "bag_3"


@pytest.mark.parametrize("what", ["directory", "file", "renamed"])
def test_a_bag_that_was_removed_is_told_and_written_again(
    what: str, graph: Graph, tmp_path: Path
) -> None:
    site = Site(graph, tmp_path / "bag")
    site.offer(unit1__text=String)
    site.heard("/unit1/text")
    site.say("/unit1/text", String(data="before"))
    if what == "directory":
        shutil.rmtree(site.bag)
    elif what == "file":
        (site.bag / "bag_0.mcap").unlink()
    else:
        site.bag.rename(tmp_path / "elsewhere")
    site.say("/unit1/text", String(data="meanwhile"))
    graph.spin_until(lambda: site.health()[0] == "error", "the error")
    assert "bag_0.mcap was removed and is written again" in site.health()[1]
    assert site.health()[2]["put_back"] == "1"
    site.say("/unit1/text", String(data="after"))
    graph.spin_until(lambda: site.health()[0] == "ok", "the end of the error")
    site.recorder.finish()
    texts = [m.message.data for m in read_messages(site.bag) if m.topic == "/unit1/text"]
    assert texts == ["before", "meanwhile", "after"]


def test_a_bag_that_cannot_be_written_again_says_how_to_mend_it(
    graph: Graph, tmp_path: Path
) -> None:
    site = Site(graph, tmp_path / "bag")
    site.offer(unit1__text=String)
    site.heard("/unit1/text")
    shutil.rmtree(site.bag)
    site.bag.write_text("a file in its place")
    graph.spin_until(lambda: site.health()[0] == "error", "the error")
    assert "cannot be written again (File exists); make room for it" in site.health()[1]
    site.say("/unit1/text", String(data="kept all the same"))
    site.bag.unlink()
    graph.spin_until(lambda: site.health()[2]["put_back"] == "1", "the bag")
    site.recorder.finish()
    texts = [m.message.data for m in read_messages(site.bag) if m.topic == "/unit1/text"]
    assert texts == ["kept all the same"]


def test_a_topic_that_finds_no_room_is_announced_later(
    graph: Graph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = Site(graph, tmp_path / "bag")
    whole = site.recorder.writer.add_topic

    def refuse(*_args: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(site.recorder.writer, "add_topic", refuse)
    site.offer(unit1__text=String)
    graph.spin_until(lambda: site.health()[0] == "error", "the error")
    assert "No space left on device" in site.health()[1]
    monkeypatch.setattr(site.recorder.writer, "add_topic", whole)
    site.heard("/unit1/text")
    site.say("/unit1/text", String(data="kept"))
