"""A talker, and the barest of recorders: the yardstick of ``stiction bench record``."""

import signal
import sys
import time
from collections.abc import Callable

import rclpy
from mcap.writer import Writer
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import JointState

from stiction_ros.nodes.shared.managed import READER_QOS, SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state
from stiction_ros.records.bag.message_definitions import definition

TOPICS = ("/bench/pv", "/bench/op", "/bench/stem")
KIND = "sensor_msgs/msg/JointState"
BUDGET = 60.0  # s until the reader must have been found
SETTLE = 0.3  # s until the reader has found the writers as well


def talk(rate: float, count: int) -> int:
    """Publish ``count`` messages on each topic, ``rate`` a second on all together."""
    node = rclpy.create_node("talker")
    publishers = [node.create_publisher(JointState, topic, SIGNAL_QOS) for topic in TOPICS]
    begin = time.monotonic()
    while not all(publisher.get_subscription_count() for publisher in publishers):
        if time.monotonic() - begin > BUDGET:
            print("no recorder was found", file=sys.stderr)
            return 1
        time.sleep(0.02)
    time.sleep(SETTLE)
    print("begin", flush=True)
    begin = time.monotonic()
    for number in range(count):
        message = joint_state(number, ["C", "T", "L"], [7.5, 42.3, 50.0])
        for publisher in publishers:
            publisher.publish(message)
        ahead = begin + (number + 1) * len(TOPICS) / rate - time.monotonic()
        if ahead > 0:
            time.sleep(ahead)
    print(f"end {time.monotonic() - begin}", flush=True)
    time.sleep(SETTLE)
    return 0


def record(path: str) -> int:
    """Write raw messages with the package ``mcap`` alone until a signal comes."""
    stop: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _frame: stop.append(number))
    node = rclpy.create_node("bare")
    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start("ros2", "mcap")
        schema = writer.register_schema(KIND, "ros2msg", definition(KIND)[0].encode())
        for topic in TOPICS:
            take = _writing(writer, writer.register_channel(topic, "cdr", schema))
            node.create_subscription(JointState, topic, take, READER_QOS, raw=True)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not stop:
            executor.spin_once(timeout_sec=0.1)
        writer.finish()
    return 0


def _writing(writer: Writer, channel: int) -> Callable[..., None]:
    def write(data: bytes, info: dict[str, int]) -> None:
        received, sent = int(info["received_timestamp"]), int(info["source_timestamp"])
        writer.add_message(channel, received, data, sent)

    return write


def main(arguments: list[str]) -> int:
    """Run ``talk RATE COUNT`` or ``record FILE``."""
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    try:
        if arguments[0] == "talk":
            return talk(float(arguments[1]), int(arguments[2]))
        return record(arguments[1])
    finally:
        try_shutdown()


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
