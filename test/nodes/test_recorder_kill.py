"""kill -9 of the recorder at random moments: the bag opens and holds what was received."""

import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")
sys.path.insert(0, str(Path(__file__).parents[1] / "records"))

import rclpy
from bag_trials import trials
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosbags.rosbag2 import Reader
from sensor_msgs.msg import JointState

from stiction_ros.cli.shared.node_processes import ros_environment
from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state, to_ns
from stiction_ros.records.bag.messages import read_messages
from stiction_ros.records.bag.repair import RepairStatus, repair_bag

PERIOD = 0.002  # s between two messages
PATIENCE = 60.0


class Talker:
    """A node that publishes numbered messages and hears how many the recorder has counted."""

    def __init__(self) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node("talker", context=self.context)
        self.publisher = self.node.create_publisher(JointState, "/pv", SIGNAL_QOS)
        self.sent = self.counted = 0
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 100)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)

    def wait_for_reader(self) -> None:
        end = time.monotonic() + PATIENCE
        while not self.publisher.get_subscription_count():
            assert time.monotonic() < end, "the recorder did not come"
            time.sleep(0.01)

    def talk_until_counted(self) -> None:
        """Publish until the recorder tells that it has some of the messages."""
        end = time.monotonic() + PATIENCE
        while not self.counted:
            assert time.monotonic() < end, "the recorder counts nothing"
            self._say_and_hear()

    def talk(self, seconds: float) -> None:
        """Publish for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._say_and_hear()

    def _say_and_hear(self) -> None:
        """Publish message k, which bears the stamp k ns and the value 3 k."""
        self.publisher.publish(joint_state(self.sent, ["A"], [3.0 * self.sent]))
        self.sent += 1
        self.executor.spin_once(timeout_sec=PERIOD)

    def _hear(self, message: DiagnosticArray) -> None:
        for value in message.status[0].values:
            if value.key == "recorded:/pv":
                self.counted = int(value.value)

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


@pytest.fixture
def talker() -> Iterator[Talker]:
    built = Talker()
    yield built
    built.close()


def recorder(directory: Path) -> subprocess.Popen[bytes]:
    settings = [f"directory:={directory}", "regex:=/pv", "max_bag_size:=20000"]
    options = [item for setting in settings for item in ("-p", setting)]
    command = [sys.executable, "-P", "-m", "stiction_ros.nodes", "recorder", "--ros-args"]
    return subprocess.Popen([*command, *options], env=ros_environment(), stdin=subprocess.DEVNULL)


def numbers(bag: Path) -> list[int]:
    """Return the numbers of the messages in a bag, after a look at their values."""
    found = []
    for message in read_messages(bag):
        number = to_ns(message.message.header.stamp)
        assert (message.message.name, message.message.position) == (["A"], [3.0 * number])
        found.append(number)
    return found


# At once as well: then the count that was told last is hardly older than the kill.
MOMENTS = [0.0] + [random.Random(seed).uniform(0.05, 1.5) for seed in range(1, trials(3, 20) + 1)]


@pytest.mark.parametrize("moment", MOMENTS, ids=[f"{moment:.3f} s" for moment in MOMENTS])
def test_a_killed_recorder_loses_nothing_that_it_has_counted(
    moment: float, talker: Talker, tmp_path: Path
) -> None:
    bag = tmp_path / "bag"
    process = recorder(bag)
    try:
        talker.wait_for_reader()
        talker.talk_until_counted()
        talker.talk(moment)
    finally:
        process.kill()
        process.wait()
    found = numbers(bag)
    assert found == list(range(found[0], found[0] + len(found)))  # none is wrong or missing
    assert len(found) >= talker.counted > 0
    assert repair_bag(bag).status is RepairStatus.FINISHED
    assert numbers(bag) == found
    with Reader(bag) as reader:
        assert sum(1 for _ in reader.messages()) == len(found)


FINISHING = """
import sys
from stiction_ros.records.bag.writer import BagWriter
writer = BagWriter(sys.argv[1], most_bytes=400_000)
writer.add_topic("/mode", "std_msgs/msg/String", "string data\\n", "")
for k in range(20000):
    writer.write("/mode", k.to_bytes(8, "little") * 10, k, k)
print("written", flush=True)
writer.close()
"""


@pytest.mark.trial
@pytest.mark.parametrize("seed", range(trials(3, 20)))
def test_a_kill_while_the_bag_is_finished_loses_nothing(seed: int, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    command = [sys.executable, "-c", FINISHING, str(bag)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "written\n"
        time.sleep(random.Random(seed).uniform(0.0, 0.25))
        process.kill()
    repair_bag(bag)
    with Reader(bag) as reader:
        found = sorted(int.from_bytes(data[:8], "little") for _, _, data in reader.messages())
    assert found == list(range(20000))
    assert not list(bag.glob("*.part"))
