"""A bare echo between two processes: the yardstick of ``stiction bench graph``."""

import json
import signal
import sys
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import JointState

from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state

WARM_UP = 200
BUDGET = 60.0  # s until the two must have met


def mirror() -> int:
    """Send every message back until a signal comes."""
    stop: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _frame: stop.append(number))
    node = rclpy.create_node("mirror")
    back = node.create_publisher(JointState, "back", SIGNAL_QOS)
    node.create_subscription(JointState, "there", back.publish, SIGNAL_QOS)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    while not stop:
        executor.spin_once(timeout_sec=0.1)
    return 0


def measure(names: list[str], count: int) -> int:
    """Print the times of ``count`` round trips, ms, as JSON."""
    node = rclpy.create_node("timer")
    there = node.create_publisher(JointState, "there", SIGNAL_QOS)
    times: list[float] = []
    sent = [0.0]
    values = [50.0] * len(names)

    def send() -> None:
        sent[0] = time.perf_counter()
        there.publish(joint_state(len(times), names, values))

    def receive(message: JointState) -> None:
        times.append(1e3 * (time.perf_counter() - sent[0]))
        if len(times) < count + WARM_UP:
            send()

    node.create_subscription(JointState, "back", receive, SIGNAL_QOS)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    begin = time.monotonic()
    while not (there.get_subscription_count() and node.count_publishers("back")):
        executor.spin_once(timeout_sec=0.05)
        if time.monotonic() - begin > BUDGET:
            print("the other process was not found", file=sys.stderr)
            return 1
    send()
    while len(times) < count + WARM_UP:
        executor.spin_once(timeout_sec=0.5)
        if time.monotonic() - sent_at(sent) > BUDGET:
            print("an echo was lost", file=sys.stderr)
            return 1
    print(json.dumps(times[WARM_UP:]))
    return 0


def sent_at(sent: list[float]) -> float:
    """Return when the last message was sent, on the monotonic clock."""
    return time.monotonic() - (time.perf_counter() - sent[0])


def main() -> int:
    """Run ``mirror``, or ``time NAMES COUNT``."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        if sys.argv[1] == "mirror":
            return mirror()
        return measure(sys.argv[2].split(","), int(sys.argv[3]))
    finally:
        try_shutdown()


if __name__ == "__main__":
    sys.exit(main())
