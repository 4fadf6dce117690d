from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from graph import KINDS, Graph
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel, simulate_closed_loop
from stiction_ros.nodes.shared import managed
from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state, to_ns, trajectory
from stiction_ros.online.controller.live import LiveController
from stiction_ros.settings import settings_of

SAMPLES = Path(__file__).parents[2] / "bags"
SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


def values(kind: str, tmp_path: Path) -> dict[str, Any]:
    """Parameters with which each node starts alone."""
    return {
        "plant": {"model": "example1.loop.yaml", "set_points": "siso.set_points.yaml"},
        "controller": {"model": "example1_process.loop.yaml", "fit_first": 10**6},
        "estimator": {},
        "recorder": {"directory": str(tmp_path / "bag")},
        "player": {"bag": str(SAMPLES / "sticky_siso")},
    }[kind]


def state(node: Any) -> str:
    return str(node._state_machine.current_state[1])


# The bridge needs a control system at the other end: test/opcua has its transitions.
NODES = [kind for kind in KINDS if kind != "opcua"]
every_kind = pytest.mark.parametrize("kind", NODES)
# The estimator's worker loads machine code at each start.
every_kind_of_quick_start = pytest.mark.parametrize(
    "kind", [pytest.param(k, marks=pytest.mark.trial if k == "estimator" else ()) for k in NODES]
)


@every_kind
def test_a_node_starts_by_itself(kind: str, graph: Graph, tmp_path: Path) -> None:
    node = graph.add(kind, values(kind, tmp_path))
    node.start()
    graph.spin_until(lambda: node.running, f"{kind} to run")
    assert (state(node), node.failure) == ("active", "")


@every_kind_of_quick_start
def test_all_transitions_twice_over(kind: str, graph: Graph, tmp_path: Path) -> None:
    node = graph.add(kind, values(kind, tmp_path))
    for _ in range(2):
        assert node.trigger_configure() is SUCCESS
        assert state(node) == "inactive"
        assert not node.running
        assert node.trigger_activate() is SUCCESS
        graph.spin_until(lambda: node.running, f"{kind} to run")
        assert node.trigger_deactivate() is SUCCESS
        assert state(node) == "inactive"
        assert not node.running
        assert node.trigger_cleanup() is SUCCESS
        assert state(node) == "unconfigured"
        graph.spin_some(20)
        if kind == "recorder":
            break  # a bag is never written over
    assert node.trigger_shutdown() is SUCCESS
    assert node.finished


@every_kind
def test_a_node_deactivated_before_its_peers_came_stays_still(
    kind: str, graph: Graph, tmp_path: Path
) -> None:
    node = graph.add(kind, values(kind, tmp_path))
    node.trigger_configure()
    node.trigger_activate()
    node.trigger_deactivate()
    graph.spin_some()
    assert not node.running
    node.trigger_cleanup()
    graph.spin_some()
    assert (state(node), node.running) == ("unconfigured", False)


@every_kind_of_quick_start
def test_a_node_waits_for_its_peers(kind: str, graph: Graph, tmp_path: Path) -> None:
    node = graph.add(kind, values(kind, tmp_path) | {"wait_for": ["listener"]})
    node.start()
    graph.spin_some()
    assert not node.running
    graph.peer("listener")
    graph.spin_until(lambda: node.running, f"{kind} to find its peer")


BAD = {
    "plant": {"model": "none.loop.yaml"},
    "controller": {"model": "none.loop.yaml"},
    "estimator": {"delay_low": 5, "delay_high": 4},
    "recorder": {"regex": "("},
    "player": {"topics": "("},
}


@every_kind
def test_unusable_input_is_one_line_and_leaves_the_node_unconfigured(
    kind: str, graph: Graph, tmp_path: Path
) -> None:
    node = graph.add(kind, values(kind, tmp_path) | BAD[kind])
    node.start()
    assert node.failure
    assert "\n" not in node.failure
    assert (state(node), node.running) == ("unconfigured", False)
    graph.spin_some(10)


def test_a_node_without_a_model_says_so(graph: Graph) -> None:
    for kind in ("plant", "controller"):
        node = graph.add(kind)
        node.start()
        assert node.failure.startswith(f"{kind}: model: no loop model")


def test_a_mended_file_is_read_at_the_next_start(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "mine.loop.yaml"
    path.write_text("loop: [")
    node = graph.add("plant", {"model": str(path)})
    node.start()
    assert str(path) in node.failure
    config = Path(__file__).parents[2] / "config" / "example1.loop.yaml"
    path.write_text(config.read_text())
    node.start()
    assert (state(node), node.failure) == ("active", "")


def test_the_failure_is_the_line_that_the_core_says(graph: Graph, tmp_path: Path) -> None:
    path = tmp_path / "bad.loop.yaml"
    config = Path(__file__).parents[2] / "config" / "example1.loop.yaml"
    path.write_text(config.read_text().replace("f_d: 2.0", "f_d: 7.0"))
    node = graph.add("plant", {"model": str(path)})
    node.start()
    assert "larger than f_s" in node.failure
    assert str(path) in node.failure


def test_a_bag_that_is_there_already_is_refused(graph: Graph, tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "mine.txt").touch()
    node = graph.add("recorder", values("recorder", tmp_path))
    node.start()
    assert "bag" in node.failure
    assert "\n" not in node.failure


# ---- parameters --------------------------------------------------------------------------------


@every_kind
def test_every_setting_is_a_parameter_with_description_and_range(
    kind: str, graph: Graph, tmp_path: Path
) -> None:
    node = graph.add(kind)
    for entry in settings_of(node.settings_class):
        descriptor = node.describe_parameter(entry.name)
        assert descriptor.description == entry.description
        assert ("is configured" in descriptor.additional_constraints) == entry.fixed
        if entry.kind == "int" and entry.low > -(2**62):
            assert descriptor.integer_range[0].from_value == entry.low
        if entry.kind == "float" and entry.low > -1e300:
            assert descriptor.floating_point_range[0].from_value == entry.low
        if entry.choices:
            assert all(choice in descriptor.additional_constraints for choice in entry.choices)


REFUSED = [
    ("controller", "horizon", 1),
    ("controller", "move_weights", [1.0, 1.0]),
    ("controller", "move_weights", [-1.0]),
    ("controller", "mode", "smart"),
    ("controller", "model", "tank_linear.loop.yaml"),
    ("estimator", "window", 3),
    ("estimator", "delay_low", 50),
    ("plant", "seed", 3),
    ("plant", "speed", -1.0),
    ("recorder", "directory", "elsewhere"),
]


@pytest.mark.parametrize(("kind", "name", "value"), REFUSED)
def test_a_refused_value_leaves_the_old_one(
    kind: str, name: str, value: Any, graph: Graph, tmp_path: Path
) -> None:
    node = graph.add(kind, values(kind, tmp_path))
    node.start()
    before = node.get_parameter(name).value
    (result,) = node.set_parameters([Parameter(name, value=value)])
    assert not result.successful
    assert result.reason
    assert "\n" not in result.reason
    assert node.get_parameter(name).value == before
    in_force = getattr(node.settings, name)
    assert (list(in_force) if isinstance(in_force, tuple) else in_force) == (
        list(before) if isinstance(in_force, tuple) else before
    )


def test_parameters_of_ros_itself_can_be_set(graph: Graph, tmp_path: Path) -> None:
    node = graph.add("controller", values("controller", tmp_path))
    node.start()
    (result,) = node.set_parameters([Parameter("use_sim_time", value=True)])
    assert result.successful


# ---- topics ------------------------------------------------------------------------------------


class Hand:
    """The test in the place of the plant: shows samples, hears op."""

    def __init__(self, graph: Graph, **parameters: Any) -> None:
        self.graph = graph
        self.node = graph.add(
            "controller", {"model": "example1_process.loop.yaml", "fit_first": 10**6} | parameters
        )
        self.node.start()
        probe = graph.plain()
        self.pv = probe.create_publisher(JointState, "pv", SIGNAL_QOS)
        self.sp = probe.create_publisher(JointState, "sp", SIGNAL_QOS)
        self.model = probe.create_publisher(String, "loop_model", LATCHED_QOS)
        self.op: list[JointState] = []
        probe.create_subscription(JointState, "op", self.op.append, SIGNAL_QOS)
        publishers = (self.pv, self.sp, self.model)
        graph.spin_until(
            lambda: (
                all(p.get_subscription_count() == 1 for p in publishers)
                and self.node._op.publisher.get_subscription_count() == 1
                and self.node.running
            ),
            "the links",
        )

    def show(self, second: int, pv: float, sp: float = 50.0) -> None:
        for publisher, value in ((self.sp, sp), (self.pv, pv)):
            publisher.publish(joint_state(second * 10**9, ["PV1"], [value]))


def test_the_controller_steps_when_pv_and_sp_of_one_stamp_are_in(graph: Graph) -> None:
    hand = Hand(graph)
    hand.pv.publish(joint_state(10**9, ["PV1"], [49.0]))
    hand.sp.publish(joint_state(2 * 10**9, ["PV1"], [50.0]))
    graph.spin_some()
    assert hand.op == []
    hand.sp.publish(joint_state(10**9, ["PV1"], [50.0]))
    graph.spin_until(lambda: hand.op, "op")
    assert to_ns(hand.op[0].header.stamp) == 10**9


def test_a_sample_shown_again_gets_the_same_op_and_counts_once(graph: Graph) -> None:
    hand = Hand(graph)
    for _ in range(2):
        hand.show(1, 49.0)
    graph.spin_until(lambda: len(hand.op) == 2, "op twice")
    assert hand.op[0] == hand.op[1]
    assert hand.node.port.next == 1
    assert len(hand.node.live.changes) == 1


def test_a_plant_that_was_paused_goes_on_with_the_same_numbers(graph: Graph) -> None:
    ops: list[JointState] = []
    graph.plain().create_subscription(JointState, "op", ops.append, SIGNAL_QOS)
    plant = graph.add(
        "plant", values("plant", Path()) | {"samples": 60, "seed": 4, "wait_for": ["controller"]}
    )
    controller = graph.add("controller", values("controller", Path()) | {"wait_for": ["plant"]})
    plant.start()
    controller.start()
    graph.spin_until(lambda: plant.plant.sample >= 20, "the first samples")
    plant.trigger_deactivate()
    graph.spin_some()
    paused_at = plant.plant.sample
    graph.spin_some()
    assert plant.plant.sample == paused_at
    plant.trigger_activate()
    graph.spin_until(lambda: plant.finished, "the last sample")
    graph.spin_some()
    found = {to_ns(op.header.stamp): op.position[0] for op in ops}
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    live = LiveController(controller.live.settings, model)
    twin = simulate_closed_loop(
        plant.model, lambda m, sp: live.step(m.pv, sp).op, plant.schedule, 60, 4
    )
    assert [found[(1 + k) * 10**9] for k in range(60)] == twin.record.op[:, 0].tolist()


def test_a_message_without_every_tag_is_ignored(graph: Graph) -> None:
    hand = Hand(graph)
    hand.pv.publish(joint_state(10**9, ["OTHER"], [49.0]))
    hand.pv.publish(JointState(name=["PV1"]))
    hand.show(2, 49.0)
    graph.spin_until(lambda: hand.op, "op")
    assert to_ns(hand.op[0].header.stamp) == 2 * 10**9


def test_values_that_are_no_numbers_follow_the_plan_and_then_hold_op(graph: Graph) -> None:
    hand = Hand(graph)
    hand.show(1, 49.0)
    for second in range(2, 12):
        hand.show(second, float("nan"))
    graph.spin_until(lambda: len(hand.op) == 11, "op")
    ops = [op.position[0] for op in hand.op]
    assert all(np.isfinite(ops))
    assert len(set(ops[:6])) == 6  # the plan and the rest of it, five samples old at most
    assert set(ops[6:]) == {ops[5]}


def test_diagnostics_name_the_strategy_in_force(graph: Graph) -> None:
    hand = Hand(graph)
    told: list[DiagnosticArray] = []
    graph.plain().create_subscription(DiagnosticArray, "/diagnostics", told.append, 100)
    hand.show(1, 49.0)
    hand.show(2, float("nan"))

    def strategies() -> set[str]:
        return {
            pair.value
            for message in told
            for entry in message.status
            for pair in entry.values
            if pair.key == "strategy"
        }

    graph.spin_until(lambda: "shift" in strategies(), "diagnostics")
    assert strategies() <= {"solve", "shift"}


def test_a_preview_moves_op_before_the_set_point_moves(graph: Graph) -> None:
    hand = Hand(graph)
    hand.show(1, 50.0)
    graph.spin_until(lambda: hand.op, "op at rest")
    publisher = graph.plain().create_publisher(JointTrajectory, "sp_preview", SIGNAL_QOS)
    graph.spin_until(lambda: publisher.get_subscription_count() > 0, "the link")
    publisher.publish(trajectory(10**9, ["PV1"], np.array([[50.0], [54.0]]), [0.0, 8.0]))
    graph.spin_until(lambda: hand.node.port.preview is not None, "the preview")
    hand.show(2, 50.0)
    graph.spin_until(lambda: len(hand.op) == 2, "op")
    assert hand.op[0].position[0] == pytest.approx(50.0)
    assert hand.op[1].position[0] > 50.5


@pytest.mark.parametrize(
    "text", ["", "loop: [", "loop: x", "valid_from: noon", "- 1", "\x00", "loop: 2026-13-01"]
)
def test_a_loop_model_that_is_none_does_not_end_the_controller(graph: Graph, text: str) -> None:
    hand = Hand(graph)
    hand.model.publish(String(data=text))
    graph.spin_some()
    hand.show(1, 49.0)
    graph.spin_until(lambda: hand.op, "op")
    assert len(hand.node.live.changes) == 1


def test_a_loop_model_swaps_at_its_valid_from(graph: Graph) -> None:
    hand = Hand(graph, hand_over_samples=3, offer_samples=0)
    known = (Path(__file__).parents[2] / "config" / "example1.loop.yaml").read_text()
    hand.show(1, 50.0)
    graph.spin_until(lambda: len(hand.op) == 1, "the first op")
    hand.model.publish(String(data=f"{known}\nvalid_from: {4 * 10**9}\n"))
    graph.spin_until(lambda: hand.node.live._offered is not None, "the offer")
    for second in range(2, 7):
        hand.show(second, 50.0)
    graph.spin_until(lambda: len(hand.op) == 6, "every op")
    assert [(c.sample, c.mode.value) for c in hand.node.live.changes] == [
        (0, "unaware"),
        (3, "embedding"),
    ]


def test_the_mode_is_latched(graph: Graph) -> None:
    hand = Hand(graph, mode="hold")
    hand.show(1, 50.0)
    graph.spin_until(lambda: hand.op, "op")
    late: list[String] = []
    graph.plain("late").create_subscription(String, "mode", late.append, LATCHED_QOS)
    graph.spin_until(lambda: late, "the latched mode")
    assert [m.data for m in late] == ["hold"]


@pytest.mark.trial
def test_a_node_says_once_whom_it_waits_for(
    graph: Graph, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(managed, "LINK_PATIENCE", 0.0)
    node = graph.add("estimator", values("estimator", tmp_path) | {"wait_for": ["controler"]})
    said: list[str] = []
    monkeypatch.setattr(node, "get_logger", lambda: Listener(said))
    node.start()
    graph.spin_until(lambda: said, "the warning")
    graph.spin_some()
    assert said == ["still waiting for controler (no such node); see the parameter wait_for"]


class Listener:
    """Notes warnings."""

    def __init__(self, said: list[str]) -> None:
        self.warning = said.append
        self.info = self.error = lambda _said: None
