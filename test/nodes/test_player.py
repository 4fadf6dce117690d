"""The player: what was recorded comes out again, at any rate, under control."""

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from graph import Graph
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from stiction_ros.nodes.player import PlayerNode
from stiction_ros.nodes.shared.managed import LATCHED_QOS, READER_QOS
from stiction_ros.nodes.shared.messages import to_ns
from stiction_ros.online.replays.bag import read_replay_bag
from stiction_ros.records.bag.messages import read_messages, read_raw

BAG = Path(__file__).parents[2] / "bags" / "sticky_siso"
SIGNALS = {"/pv": JointState, "/op": JointState, "/stiction": JointState}
FAST = 1e6


class Stage:
    """A player and a probe that notes what it plays."""

    def __init__(
        self,
        graph: Graph,
        heard: Mapping[str, type[Any]] | None = None,
        remaps: tuple[str, ...] = (),
        **values: Any,
    ) -> None:
        self.graph = graph
        self.seen: dict[str, list[Any]] = defaultdict(list)
        self.probe = graph.peer("probe")
        for topic, kind in (heard or {}).items():
            qos = LATCHED_QOS if kind is String else READER_QOS
            self.probe.create_subscription(kind, topic, self.seen[topic].append, qos)
        chosen = {"bag": str(BAG), "wait_for": ["probe"]} | values
        self.node = graph.adopt(
            PlayerNode(
                context=graph.context,
                cli_args=["--ros-args", *(word for remap in remaps for word in ("-r", remap))],
                parameter_overrides=[Parameter(key, value=value) for key, value in chosen.items()],
            )
        )
        self.node.start()
        assert self.node.failure == ""
        graph.spin_until(lambda: self.node.running or self.node.finished, "the player to run")

    def play(self, counts: Mapping[str, int]) -> None:
        """Spin until the bag is over and ``counts`` messages have come."""
        self.graph.spin_until(lambda: self.node.finished, "the end of the bag")
        self.graph.spin_until(
            lambda: all(len(self.seen[topic]) >= count for topic, count in counts.items()),
            "every message",
        )
        self.graph.spin_some(10)

    def call(self, name: str) -> Any:
        client = self.probe.create_client(Trigger, f"/player/{name}")
        self.graph.spin_until(client.service_is_ready, f"the service {name}")
        future = client.call_async(Trigger.Request())
        self.graph.spin_until(future.done, f"the answer of {name}")
        return future.result()


@pytest.fixture(scope="module")
def recorded() -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = defaultdict(list)
    for message in read_messages(BAG):
        found[message.topic].append(message.message)
    return found


def rows(messages: list[Any]) -> list[tuple[Any, ...]]:
    return [
        (
            int(m.header.stamp.sec),
            int(m.header.stamp.nanosec),
            m.header.frame_id,
            tuple(m.name),
            *(tuple(float(v) for v in column) for column in (m.position, m.velocity, m.effort)),
        )
        for m in messages
    ]


def test_every_message_comes_out_again_with_its_values(
    graph: Graph, recorded: dict[str, list[Any]]
) -> None:
    heard = SIGNALS | {"/clock": Clock}
    stage = Stage(graph, heard, rate=FAST)
    stage.play({topic: len(recorded[topic]) for topic in heard})
    for topic in SIGNALS:
        assert rows(stage.seen[topic]) == rows(recorded[topic])
    assert [to_ns(m.clock) for m in stage.seen["/clock"]] == [
        to_ns(m.clock) for m in recorded["/clock"]
    ]


def test_the_player_s_own_clock_leads_its_messages(graph: Graph) -> None:
    heard = {"/clock": Clock, "/pv": JointState}
    stage = Stage(graph, heard, rate=2000.0, clock="own", topics="/pv|/clock")
    stage.play({"/pv": 2100})
    times = [to_ns(m.clock) for m in stage.seen["/clock"]]
    assert times == sorted(times)
    assert len(times) < 2100  # not one for each sample, as the recorded one
    first = to_ns(stage.seen["/pv"][0].header.stamp)
    assert times[0] >= first
    assert times[-1] >= to_ns(stage.seen["/pv"][-1].header.stamp)


@pytest.mark.parametrize("clock", ["none", "auto"])
def test_a_clock_that_is_not_wanted_is_not_offered(graph: Graph, clock: str) -> None:
    topics = "/pv|/clock" if clock == "none" else "/pv"
    stage = Stage(graph, {"/pv": JointState}, topics=topics, clock=clock, paused=True)
    offered = stage.probe.get_publishers_info_by_topic("/clock")
    assert len(offered) == (0 if clock == "none" else 1)


def test_each_topic_is_offered_as_it_was_recorded(graph: Graph) -> None:
    stage = Stage(graph, SIGNALS | {"/loop_model": String}, paused=True)
    expected = {
        "/pv": (DurabilityPolicy.VOLATILE, 100),
        "/loop_model": (DurabilityPolicy.TRANSIENT_LOCAL, 1),
        "/plant/config": (DurabilityPolicy.TRANSIENT_LOCAL, 1),
    }
    for topic, (durability, depth) in expected.items():
        (info,) = stage.probe.get_publishers_info_by_topic(topic)
        assert info.qos_profile.reliability is ReliabilityPolicy.RELIABLE
        assert info.qos_profile.durability is durability
        outlet = stage.node.outlets[topic].publisher
        assert outlet.qos_profile.depth == depth


def test_who_comes_late_gets_the_last_loop_model(
    graph: Graph, recorded: dict[str, list[Any]]
) -> None:
    stage = Stage(graph, {"/pv": JointState}, rate=FAST, start=2000.0)
    stage.play({"/pv": 100})
    late: list[String] = []
    graph.plain("late").create_subscription(String, "/loop_model", late.append, LATCHED_QOS)
    graph.spin_until(lambda: late, "the loop model")
    assert [m.data for m in late] == [recorded["/loop_model"][-1].data]


def test_a_start_leaves_out_what_is_before(graph: Graph) -> None:
    stage = Stage(graph, {"/pv": JointState, "/loop_model": String}, rate=FAST, start=2000.0)
    stage.play({"/pv": 100, "/loop_model": 1})
    assert to_ns(stage.seen["/pv"][0].header.stamp) == 2001 * 10**9
    assert len(stage.seen["/pv"]) == 100


def test_a_topic_can_be_remapped(graph: Graph) -> None:
    stage = Stage(
        graph, {"/was/pv": JointState}, ("/pv:=/was/pv",), rate=FAST, topics="/pv", start=2050.0
    )
    stage.play({"/was/pv": 50})
    assert stage.probe.get_publishers_info_by_topic("/pv") == []


def test_a_step_shows_every_message_of_the_next_log_time(graph: Graph) -> None:
    heard = {"/pv": JointState, "/op": JointState, "/clock": Clock}
    times = [(raw.topic.name, raw.log_time) for raw in read_raw(BAG)]
    stage = Stage(graph, heard, paused=True)
    graph.spin_some(20)
    assert stage.seen["/pv"] == []
    for second in (1, 2, 3):
        answer = stage.call("step")
        assert answer.success
        for topic in heard:
            count = sum(name == topic and time <= second * 10**9 for name, time in times)
            graph.spin_until(
                lambda topic=topic, count=count: len(stage.seen[topic]) == count, f"{count} {topic}"
            )
    assert answer.message == "at 3.000000000 s"


def test_pause_and_resume(graph: Graph) -> None:
    stage = Stage(graph, {"/pv": JointState}, rate=200.0)
    graph.spin_until(lambda: len(stage.seen["/pv"]) > 20, "the first samples")
    assert stage.call("pause").success
    count = stage.node.outlets["/pv"].count
    graph.spin_until(lambda: len(stage.seen["/pv"]) == count, "what was under way")
    graph.spin_some(50)
    assert len(stage.seen["/pv"]) == count
    assert not stage.node.finished
    assert stage.call("resume").success
    graph.spin_until(lambda: len(stage.seen["/pv"]) > count, "the next samples")


def test_a_running_player_refuses_a_step(graph: Graph) -> None:
    stage = Stage(graph)
    answer = stage.call("step")
    assert not answer.success
    assert "pause it first" in answer.message


@pytest.mark.trial
def test_a_loop_begins_again(graph: Graph) -> None:
    stage = Stage(graph, {"/pv": JointState}, rate=FAST, loop=True, topics="/pv", start=2090.0)
    graph.spin_until(lambda: len(stage.seen["/pv"]) >= 25, "the third round")
    stamps = [to_ns(m.header.stamp) for m in stage.seen["/pv"]]
    assert stamps[:10] == stamps[10:20]
    assert stage.node.playback.rounds >= 2


@pytest.mark.trial
def test_a_new_rate_is_taken_while_it_plays(graph: Graph) -> None:
    stage = Stage(graph, {"/pv": JointState}, rate=0.001, topics="/pv")
    (result,) = stage.node.set_parameters([Parameter("rate", value=FAST)])
    assert result.successful
    stage.play({"/pv": 2100})


@pytest.mark.trial
def test_after_a_rest_it_goes_on_where_it_was(graph: Graph, recorded: dict[str, list[Any]]) -> None:
    stage = Stage(graph, {"/pv": JointState}, rate=2000.0, topics="/pv")
    graph.spin_until(lambda: len(stage.seen["/pv"]) > 50, "the first samples")
    stage.node.trigger_deactivate()
    count = stage.node.outlets["/pv"].count
    graph.spin_until(lambda: len(stage.seen["/pv"]) == count, "what was under way")
    graph.spin_some(50)
    assert len(stage.seen["/pv"]) == count
    stage.node.trigger_activate()
    stage.play({"/pv": len(recorded["/pv"])})
    stamps, wanted = (
        [to_ns(m.header.stamp) for m in messages]
        for messages in (stage.seen["/pv"], recorded["/pv"])
    )
    assert stamps == wanted


def test_recorded_diagnostics_go_out_beside_the_player_s_own(
    graph: Graph, recorded: dict[str, list[Any]]
) -> None:
    stage = Stage(graph, {"/diagnostics": DiagnosticArray}, rate=FAST)
    stage.play({"/diagnostics": len(recorded["/diagnostics"])})
    names = {status.name for m in stage.seen["/diagnostics"] for status in m.status}
    assert {"player: status", "estimator: fit", "controller: mode"} <= names


def test_rosout_and_parameter_events_are_left_out(graph: Graph) -> None:
    assert "/rosout" in {raw.topic.name for raw in read_raw(BAG)}
    stage = Stage(graph, paused=True)
    assert not {"/rosout", "/parameter_events"} & set(stage.node.outlets)


def test_a_player_without_a_bag_says_so(graph: Graph) -> None:
    node = graph.add("player")
    node.start()
    assert node.failure == "player: bag: no bag; set it to a bag"


@pytest.mark.trial
def test_an_estimator_that_hears_the_player_finds_what_the_live_one_found(
    graph: Graph, recorded: dict[str, list[Any]]
) -> None:
    config = read_replay_bag(BAG).estimator
    assert config is not None
    values = dict(config.parameters) | {"wait_for": ["player"], "fit_every": 10**6}
    estimator = graph.add("estimator", values)
    estimator.start()
    stage = Stage(graph, rate=FAST, topics="/(pv|op)", wait_for=["probe", "estimator"])
    found: list[JointState] = []
    stage.probe.create_subscription(JointState, "/stiction", found.append, READER_QOS)
    graph.spin_until(lambda: found, "the first fit")
    live = recorded["/stiction"][0]
    assert to_ns(found[0].header.stamp) == to_ns(live.header.stamp)
    # Not in every bit: the bag is from another processor, or from an older version.
    for key in ("position", "velocity", "effort"):
        assert list(getattr(found[0], key)) == pytest.approx(list(getattr(live, key)), rel=1e-6)
