"""What rclpy leaves without types, typed: loggers, qualities of service, the end of a node."""

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.guard_condition import GuardCondition
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from rclpy.utilities import try_shutdown

RawTake = Callable[[bytes, dict[str, int]], None]  # a message as bytes, and when it came


class Log(Protocol):
    """A logger of ROS; it wants one severity for each line of code that calls it."""

    def info(self, message: str) -> object:
        """Say what happened."""
        ...

    def warning(self, message: str) -> object:
        """Say what should not have happened."""
        ...

    def error(self, message: str) -> object:
        """Say what cannot go on."""
        ...


def log_of(node: Node) -> Log:
    """Return the logger of ``node``."""
    untyped: Any = node
    log: Log = untyped.get_logger()
    return log


def quality(
    depth: int,
    reliability: ReliabilityPolicy | None = None,
    durability: DurabilityPolicy | None = None,
    history: HistoryPolicy | None = None,
) -> QoSProfile:
    """Return a quality of service; what is None is that of ROS: reliable, volatile, last ones.

    Args:
        depth: messages that are kept.
        reliability: whether every message must arrive.
        durability: whether late comers get the last messages.
        history: whether the last messages are kept, or all.
    """
    make: Any = QoSProfile
    policies = {"reliability": reliability, "durability": durability, "history": history}
    profile: QoSProfile = make(
        depth=depth, **{name: policy for name, policy in policies.items() if policy is not None}
    )
    return profile


def subscribe_raw(
    node: Node, kind: Any, topic: str, take: RawTake, qos: QoSProfile, **options: Any
) -> Subscription:
    """Subscribe to messages as bytes, with what the middleware tells of each.

    Args:
        node: that subscribes.
        kind: class of the messages.
        topic: name of the topic.
        take: called with each message and its times (``received_timestamp`` …), ns.
        qos: asked for.
        options: go to the subscription.
    """
    untyped: Any = node
    made: Subscription = untyped.create_subscription(kind, topic, take, qos, raw=True, **options)
    return made


def parameter_value(name: str, kind: Parameter.Type, value: object) -> Any:
    """Return ``value`` as a parameter of ``kind`` holds it.

    Raises:
        ValueError: it is not of that kind.
    """
    make: Any = Parameter
    return make(name, kind, value).value


def trigger(condition: GuardCondition) -> None:
    """Wake the thread that spins the node of ``condition``."""
    untyped: Any = condition
    untyped.trigger()


def restart(timer: Timer) -> None:
    """Let ``timer`` count its period from now on."""
    untyped: Any = timer
    untyped.reset()


def end_node(node: Node) -> None:
    """Take ``node`` out of the graph."""
    untyped: Any = node
    untyped.destroy_node()


def leave(node: Node | None) -> None:
    """Take ``node``, where there is one, and this process out of the graph."""
    if node is not None:
        end_node(node)
    try_shutdown()
