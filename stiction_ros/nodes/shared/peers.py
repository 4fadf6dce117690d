"""The partners of a node: who must be there before it begins, what lacks, and who has gone."""

import dataclasses
import time
from collections.abc import Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

ABOVE = "../"  # before the name of a node that is in the namespace above
TOPIC = "topic:"  # marks an entry of wait_for that names a topic; "/" and "~" do as well
PATIENCE = 0.5  # s for readers to receive
GRACE = 0.5  # s for which a partner may be missing before it has gone
PLANTS = ("plant", "opcua")  # nodes that publish pv: the simulated plant, the driver of a real one
WATCHER = "recorder"  # reads every topic and commands nothing


@dataclasses.dataclass
class Outlet:
    """A publisher that counts, and knows which nodes must hear its first message.

    A writer keeps its last messages alone, so that a reader whose process gets no time for a
    while loses what is older. In lockstep nothing need be lost: now and then the outlet ``waits``
    until all was received. A reader that lets it wait in vain, as one that was killed does, is not
    waited for again before it has received.
    """

    publisher: Publisher
    readers: tuple[str, ...]  # names of the nodes
    qos: QoSProfile  # offered
    waits: bool
    count: int = 0
    _in_vain: bool = False

    def publish(self, message: Any) -> None:
        """Publish and count."""
        self.count += 1
        self.publisher.publish(message)
        if self.waits and self.count % (self.qos.depth // 2) == 0:
            patience = Duration(seconds=0.0 if self._in_vain else PATIENCE)
            self._in_vain = not self.publisher.wait_for_all_acked(patience)


@dataclasses.dataclass
class Inlet:
    """A subscription, and the nodes whose first message must not be missed.

    The callback of a raw one is also told what the middleware knows of a message.
    """

    subscription: Subscription
    writers: tuple[str, ...]  # names of the nodes
    qos: QoSProfile  # asked for

    def drain(self) -> None:
        """Take all that is queued now, and hand each message to the callback."""
        for _ in range(self.qos.depth):
            if not self.take():
                return

    def take(self) -> bool:
        """Hand the oldest message that is queued to the callback; tell whether there was one."""
        with self.subscription.handle:
            found = self.subscription.handle.take_message(
                self.subscription.msg_type, self.subscription.raw
            )
        if found is None:
            return False
        self.subscription.callback(*found[: 1 + self.subscription.raw])
        return True


class Peers:
    """What ``wait_for`` asks: nodes of this package, which announce themselves, and topics.

    A node is in the same namespace, in one below (``TC1/controller``) or in the one above
    (``../plant``).

    A node is ready when it has announced ``~/config``, and linked when its topics have
    matched in both directions. A topic is there when a publisher of it (or, where this node
    publishes it, a reader other than the recorder) has matched, whatever its name: so a relay
    or a driver can stand between the nodes.
    """

    def __init__(self, node: Node, wait_for: Sequence[str]) -> None:
        """Wait for the entries of ``wait_for`` on behalf of ``node``."""
        self._node = node
        self.names = tuple(sorted({e for e in wait_for if not _is_topic(e)}))
        self.topics = tuple(
            sorted(
                {node.resolve_topic_name(e.removeprefix(TOPIC)) for e in wait_for if _is_topic(e)}
            )
        )
        self._pinned: dict[str, frozenset[tuple[int, ...]]] = {}
        self._missing: dict[str, float] = {}

    def unheard(self, inlets: dict[str, Inlet]) -> list[str]:
        """Return what lacks until no first message can be missed; empty when nothing does."""
        missing = []
        for topic, inlet in inlets.items():
            full = self._node.resolve_topic_name(topic)
            found = self._node.get_publishers_info_by_topic(full)
            missing += self._silent(inlet.writers, found, f"does not publish {topic}")
            usable = [i for i in found if _fit(i.qos_profile, inlet.qos)]
            if inlet.subscription.get_publisher_count() < len(usable):
                missing.append(f"{topic} (not every publisher is matched)")
        own = {publisher.topic_name for publisher in self._node.publishers}
        missing += [
            f"{topic} (nobody publishes it)"
            for topic in self.topics
            if topic not in own and not self._node.count_publishers(topic)
        ]
        return _once(missing)

    def unlinked(self, outlets: dict[str, Outlet]) -> list[str]:
        """Return what lacks until all partners are ready and hear; empty when nothing does."""
        unready = [name for name in self.names if not self._announced(name)]
        missing = self._told(unready, "not ready")
        for topic, outlet in outlets.items():
            full = self._node.resolve_topic_name(topic)
            found = self._node.get_subscriptions_info_by_topic(full)
            missing += self._silent(outlet.readers, found, f"does not read {topic}")
            usable = [i for i in found if _fit(outlet.qos, i.qos_profile)]
            if outlet.publisher.get_subscription_count() < len(usable):
                missing.append(f"{topic} (not every reader is matched)")
            elif full in self.topics and all(i.node_name == WATCHER for i in usable):
                missing.append(f"{topic} (nobody reads it)")
        return _once(missing)

    def pin(self) -> None:
        """Remember who is there now; :meth:`gone` compares with it."""
        names = [name for name in self.names if name != WATCHER]
        self._pinned = {name: self._announced(name) for name in names}
        self._missing = {}

    def gone(self) -> dict[str, str]:
        """Return partners that are not those of :meth:`pin`, and what became of them.

        Of several under one name, as while a killed one has not been given up, one must stay.
        One that is missing for a moment only stood still: the middleware gives up whoever is
        silent, and finds them again.
        """
        lost = {}
        clock = time.monotonic()
        for name, before in self._pinned.items():
            now = self._announced(name)
            if now - before:
                lost[name] = "was replaced"
            elif now:
                self._pinned[name] = now
                self._missing.pop(name, None)
            elif clock - self._missing.setdefault(name, clock) >= GRACE:
                lost[name] = "has gone"
        return lost

    def _announced(self, name: str) -> frozenset[tuple[int, ...]]:
        """Return the identities of those that announce themselves under ``name``."""
        space, name_there = self._node.get_namespace().rstrip("/"), known_as(name)
        if name_there != name:
            space = space.rpartition("/")[0]
        found = self._node.get_publishers_info_by_topic(f"{space}/{name_there}/config")
        return frozenset(tuple(i.endpoint_gid) for i in found if i.node_name == _last(name))

    def _silent(
        self, asked: Sequence[str], found: Sequence[TopicEndpointInfo], what: str
    ) -> list[str]:
        """Return each ``asked`` partner that is not at a topic, with ``what`` it does not do."""
        names = {info.node_name for info in found}
        away = [n for n in self.names if known_as(n) in asked and _last(n) not in names]
        return self._told(away, what)

    def _told(self, names: Sequence[str], what: str) -> list[str]:
        """Return what is said of partners of which something lacks, or who are not there at all."""
        there = set(self._node.get_node_names()) if names else set()
        return [f"{n} ({what if _last(n) in there else 'no such node'})" for n in names]


def publishers_of(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, as often as they do."""
    found = node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
    return [f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in found]


def known_as(name: str) -> str:
    """Return the name by which topics know the node of an entry of ``wait_for``."""
    return name.removeprefix(ABOVE)


def _last(name: str) -> str:
    """Return the name of a node without its namespace."""
    return name.rpartition("/")[2]


def _is_topic(entry: str) -> bool:
    return entry.startswith(("/", "~", TOPIC))


def _fit(offered: QoSProfile, asked: QoSProfile) -> bool:
    """Tell whether a reader can match; one that cannot is waited for by nobody."""
    lossy = offered.reliability == ReliabilityPolicy.BEST_EFFORT
    fleeting = offered.durability == DurabilityPolicy.VOLATILE
    return not (
        (lossy and asked.reliability == ReliabilityPolicy.RELIABLE)
        or (fleeting and asked.durability == DurabilityPolicy.TRANSIENT_LOCAL)
    )


def _once(said: list[str]) -> list[str]:
    return list(dict.fromkeys(said))
