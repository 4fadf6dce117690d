"""A few faults of ``stiction faults`` in one process: the run is what it is without them."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph import Graph
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.config_files import find_config
from stiction_ros.nodes.shared import managed
from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS
from stiction_ros.nodes.shared.messages import SECOND, to_ns, to_stamp
from stiction_ros.online.health import Noticed
from stiction_ros.online.session import Scenario, run_live
from stiction_studies.faults.fault import Fault, nothing
from stiction_studies.faults.kinds.offered_models import aliases, deep
from stiction_studies.faults.kinds.signal_junk import MALFORMED, STAMPS
from stiction_studies.faults.loop.setting_up import case_parameters
from stiction_studies.faults.terms import Pace

SAMPLES = 60
SEED = 4
SPEED = 20.0
SAME_OP = 1.0  # %, between the OP in force and the first of a new controller
APPLIED = "applied"  # what was heard on op_applied
OK, ERROR = b"\x00", b"\x02"
NODES = ("plant", "controller", "estimator")
Say = Callable[[int], Any]  # what is said when the PV of a stamp comes


@pytest.fixture(autouse=True)
def _quick_statuses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five statuses a second, and conditions that are shown for half a second."""
    monkeypatch.setattr(managed, "LOOKS", 2)
    monkeypatch.setattr(managed, "Noticed", functools.partial(Noticed, shown=0.5))


@functools.cache
def without_fault() -> tuple[np.ndarray, np.ndarray]:
    """OP and stem of the run without ROS."""
    scenario = Scenario.load(find_config("siso.scenario.yaml"))
    record = run_live(scenario, samples=SAMPLES, seed=SEED, identify=False).run.record
    assert record.stem is not None
    return record.op, record.stem


def parameters(pace: Pace) -> dict[str, dict[str, Any]]:
    """Return the parameters of all nodes, as the suite gives them to its processes."""
    return case_parameters(Fault("", "", nothing), pace, SEED, SPEED, Path("bag"))


def start(graph: Graph, pace: Pace, names: tuple[str, ...], samples: int = 0) -> dict[str, Any]:
    """Start the nodes of these names; a listener stands in for the recorder."""
    recorder, applied = graph.listen("recorder"), graph.seen[APPLIED]
    recorder.create_subscription(JointState, "op_applied", applied.append, SIGNAL_QOS)
    found = parameters(pace)
    found["plant"]["samples"] = samples
    for values in found.values():
        values["wait_for"] = [
            other for other in values.get("wait_for", ()) if other in (*names, "recorder")
        ]
    built = {name: graph.add(name, found[name]) for name in names}
    for node in built.values():
        node.start()
        assert node.failure == ""
    return built


def stranger(graph: Graph, topic: str, say: Say) -> None:
    """Add a node that says something on ``topic`` whenever a PV comes."""
    node = graph.plain(f"stranger_of_{topic}")
    kind = (
        (String, topic, LATCHED_QOS) if topic == "loop_model" else (JointState, topic, SIGNAL_QOS)
    )
    publisher = node.create_publisher(*kind)
    told: set[int] = set()

    def take(message: JointState) -> None:
        stamp = to_ns(message.header.stamp)
        if stamp not in told and message.header.frame_id != "junk" and len(told) < SAMPLES:
            told.add(stamp)
            publisher.publish(say(stamp))

    node.create_subscription(JointState, "pv", take, QoSProfile(depth=1000))


def signals(tag: str, kinds: Any, frame_id: str = "junk") -> Say:
    """Say one of ``kinds`` after the other."""

    def say(stamp: int) -> Any:
        kind = kinds[(stamp // SECOND) % len(kinds)]
        message = JointState()
        at = kind.get("stamp", stamp + round(kind.get("offset", 0.0) * SECOND))
        message.header.stamp = to_stamp(max(at, 0))
        message.header.frame_id = frame_id
        message.name = list(kind.get("names", (tag,)))
        values = kind.get("values", 50.0)
        row = values if isinstance(values, list) else [values] * len(message.name)
        message.position = [float(value) for value in row]
        return message

    return say


def texts(*models: str) -> Say:
    """Offer one of ``models`` after the other, each a few times."""
    return lambda stamp: String(data=models[(stamp // SECOND) % len(models)])


WILD = ({"values": 1e6}, {"values": 1e6, "offset": 1.0}, {"values": 0.0})
JUNK: dict[str, dict[str, Say]] = {
    "signals and models": {
        "pv": signals("PV1", (*MALFORMED, *STAMPS)),
        "sp": signals("PV1", (*STAMPS, *MALFORMED)),
        "stiction": signals("V1.f_s", WILD),
        "loop_model": texts(aliases(), deep(), "{", "", "- 1", "loop: x\n"),
    },
    "op of a stranger": {"op": signals("V1", WILD, "/somebody")},
    "op of the commander": {"op": signals("V1", (*MALFORMED, *STAMPS), "/controller")},
}


@pytest.mark.parametrize("junk", JUNK.values(), ids=JUNK)
def test_junk_changes_no_number_of_a_run_in_lockstep(graph: Graph, junk: dict[str, Say]) -> None:
    for topic, say in junk.items():
        stranger(graph, topic, say)
    built = start(graph, Pace.LOCKSTEP, ("plant", "controller"), SAMPLES)
    graph.spin_until(lambda: built["plant"].finished, "the plant's last sample")
    graph.spin_until(lambda: len(graph.seen["stem"]) == SAMPLES, "every stem")
    last = SAMPLES * SECOND
    graph.spin_until(
        lambda: to_ns(graph.seen[APPLIED][-1].header.stamp) == last, "the last applied OP"
    )
    op, stem = without_fault()
    assert np.array_equal([list(m.position) for m in graph.seen["stem"]], stem)
    applied = {to_ns(m.header.stamp): m.position[0] for m in graph.seen[APPLIED]}
    assert [applied[(1 + k) * SECOND] for k in range(SAMPLES)] == op[:, 0].tolist()


def level(graph: Graph, node: str) -> bytes:
    """Return the level that a node has shown last."""
    for message in reversed(graph.seen["/diagnostics"]):
        for one in message.status:
            if one.name == f"{node}: status":
                return bytes(one.level)
    return OK


@pytest.mark.trial
def test_a_loop_in_real_time_notices_who_is_gone_and_goes_on(graph: Graph) -> None:
    built = start(graph, Pace.REALTIME, NODES)
    graph.spin_until(lambda: len(graph.seen["op"]) >= 10, "the loop to run")

    built["plant"].trigger_deactivate()
    for node in ("controller", "estimator"):
        graph.spin_until(lambda node=node: level(graph, node) == ERROR, f"{node} to say so")
    sent = len(graph.seen["op"])
    built["plant"].trigger_activate()
    graph.spin_until(lambda: len(graph.seen["op"]) > sent + 10, "the loop to go on")

    old = built["controller"]
    graph.executor.remove_node(old)
    graph.nodes.remove(old)
    old.destroy_node()
    graph.spin_until(lambda: level(graph, "plant") == ERROR, "the plant to miss its OP")
    applied = graph.seen[APPLIED][-1].position[0]
    sent = len(graph.seen["op"])
    graph.add("controller", parameters(Pace.REALTIME)["controller"]).start()
    graph.spin_until(lambda: len(graph.seen["op"]) > sent, "the first OP")
    assert abs(graph.seen["op"][sent].position[0] - applied) <= SAME_OP
    for node in NODES:
        graph.spin_until(lambda node=node: level(graph, node) != ERROR, f"{node} to be well")
