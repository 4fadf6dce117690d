"""What all nodes share: lifecycle, counted publishers, peers, diagnostics, configuration."""

from __future__ import annotations

import time
import traceback
from collections.abc import Iterable
from typing import Any

import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import String

from stiction_ros import __version__
from stiction_ros.errors import InputError
from stiction_ros.nodes import parameters
from stiction_ros.nodes.messages import status, to_stamp

SIGNAL_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
# What waits for a process that is busy for a moment; writers keep SIGNAL_QOS.
READER_QOS = QoSProfile(depth=5000, reliability=ReliabilityPolicy.RELIABLE)
LATCHED_QOS = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
LATCHED_READER_QOS = QoSProfile(
    depth=100,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
ACK_PATIENCE = 3.0  # s for all topics together: a reader that was killed never answers
LINK_PATIENCE = 5.0  # s until a node says whom it waits for
LINK_PERIOD = 0.02  # s between two looks at the graph until all peers are there


class Outlet:
    """A publisher that counts, and knows which nodes must hear its first message."""

    def __init__(self, publisher: Publisher, readers: tuple[str, ...]) -> None:
        self.publisher = publisher
        self.readers = readers
        self.count = 0

    def publish(self, message: Any) -> None:
        """Publish and count."""
        self.count += 1
        self.publisher.publish(message)


class ManagedNode(LifecycleNode):
    """A lifecycle node that starts by itself unless ``autostart`` is false.

    Subclasses write :meth:`configure`, :meth:`activate` and :meth:`deactivate`. An
    :class:`InputError` in any of them is logged in one line, kept in :attr:`failure`, and
    leaves the node where it was.
    """

    def __init__(self, name: str, settings: type[Any], **kwargs: Any) -> None:
        """Declare the parameters of ``settings``; ``kwargs`` go to the ROS node."""
        super().__init__(name, **kwargs)
        self.settings_class = settings
        self.failure = ""
        self.finished = False
        self.running = False
        self.stamp = 0
        self.outlets: dict[str, Outlet] = {}
        self._inlets: list[tuple[str, Subscription, tuple[str, ...]]] = []
        self._ready = self._linked = self._tunable = False
        self._link_timer: Any = None
        parameters.declare(self, settings)
        self.settings = settings()

    # ---- lifecycle -------------------------------------------------------------------------

    def start(self) -> None:
        """Configure and activate, as ``autostart`` does."""
        self.trigger_configure()
        if not self.failure:
            self.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._guarded(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        result = super().on_activate(state)
        if result is not TransitionCallbackReturn.SUCCESS:
            return result
        return self._guarded(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._stop()
        self.deactivate()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._tear_down()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._stop()
        self.finished = True
        return TransitionCallbackReturn.SUCCESS

    def configure(self) -> None:
        """Build what the node runs; may raise InputError."""

    def activate(self) -> None:
        """Begin; may raise InputError."""

    def deactivate(self) -> None:
        """Stop for a while."""

    def finish(self) -> None:
        """Publish the last diagnostics and wait until all readers have everything."""
        if not self.outlets:
            return
        self.running = False
        self.deactivate()
        self.report()
        end = time.monotonic() + ACK_PATIENCE
        for outlet in self.outlets.values():
            left = max(end - time.monotonic(), 0.0)
            outlet.publisher.wait_for_all_acked(Duration(seconds=left))

    def _configure(self) -> None:
        parameters.refuse_unknown(self)
        self.settings = parameters.read(self, self.settings_class)
        self._diagnostics = self.outlet(DiagnosticArray, "/diagnostics", QoSProfile(depth=100))
        self._beat = self.create_timer(1.0, self._each_second)
        self.configure()
        self.add_on_set_parameters_callback(self._on_set)
        self._tunable = True

    def _activate(self) -> None:
        self._ready = self._linked = False
        self._told_waiting = False
        self._link_begun = time.monotonic()
        self.activate()
        self._link_timer = self.create_timer(LINK_PERIOD, self._look_for_peers)

    def _stop(self) -> None:
        self.running = False
        if self._link_timer is not None:
            self.destroy_timer(self._link_timer)
            self._link_timer = None

    def _tear_down(self) -> None:
        self._stop()
        self._linked = False
        if self._tunable:
            self.remove_on_set_parameters_callback(self._on_set)
            self._tunable = False
        self.destroy_timer(self._beat)
        for subscription in list(self.subscriptions):
            self.destroy_subscription(subscription)
        for outlet in self.outlets.values():
            self.destroy_publisher(outlet.publisher)
        self.outlets, self._inlets = {}, []

    def _guarded(self, action: Any) -> TransitionCallbackReturn:
        self.failure = ""
        try:
            action()
        except InputError as error:
            self.failure = str(error)
            self.get_logger().error(self.failure)
            if self.outlets:
                self._tear_down()
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would swallow it without a word
            self.failure = f"internal error: {error!r}"
            self.get_logger().error(traceback.format_exc())
            return TransitionCallbackReturn.ERROR
        return TransitionCallbackReturn.SUCCESS

    # ---- topics ----------------------------------------------------------------------------

    def outlet(
        self, kind: Any, topic: str, qos: QoSProfile, readers: tuple[str, ...] = ()
    ) -> Outlet:
        """Create a counted publisher; ``recorder`` is among the readers of every topic."""
        # Readers warn of incompatible QoS; what a publisher hears of it costs time at every spin.
        quiet = PublisherEventCallbacks(use_default_callbacks=False)
        publisher = self.create_publisher(kind, topic, qos, event_callbacks=quiet)
        self.outlets[topic] = Outlet(publisher, (*readers, "recorder"))
        return self.outlets[topic]

    def inlet(
        self, kind: Any, topic: str, take: Any, qos: QoSProfile, writers: tuple[str, ...] = ()
    ) -> None:
        """Subscribe; ``writers`` are the nodes whose first message must not be missed."""
        subscription = self.create_subscription(kind, topic, take, qos)
        self._inlets.append((topic, subscription, writers))

    def linked(self) -> None:
        """Called once when every node of ``wait_for`` has matched, in both directions."""

    def _look_for_peers(self) -> None:
        """Become ready when all writers have matched; begin when all peers are ready.

        A reader of a volatile topic misses what is sent before it has matched the writer,
        also when the writer has matched it already. So each node looks at its own readers
        first and then says that it is ready by announcing ``~/config``.
        """
        wanted = {name for name in self.settings.wait_for if name}
        if not self._told_waiting and time.monotonic() > self._link_begun + LINK_PATIENCE:
            self._told_waiting = True
            missing = sorted(wanted.difference(self.get_node_names()))
            which = ", ".join(missing) or ", ".join(sorted(wanted))
            self.get_logger().warning(f"still waiting for {which}; see the parameter wait_for")
        if not self._ready:
            if not all(self._hears(*inlet, wanted) for inlet in self._inlets):
                return
            if "~/config" not in self.outlets:  # it is there already after a pause
                self._announce_configuration()
            self._ready = True
        namespace = self.get_namespace().rstrip("/")
        for name in wanted:
            announced = self.get_publishers_info_by_topic(f"{namespace}/{name}/config")
            if all(info.node_name != name for info in announced):
                return
        if all(self._is_heard(topic, outlet, wanted) for topic, outlet in self.outlets.items()):
            self._stop()
            self._linked = self.running = True
            self.report()
            self.linked()

    def _hears(
        self, topic: str, inlet: Subscription, writers: tuple[str, ...], wanted: set[str]
    ) -> bool:
        found = self.get_publishers_info_by_topic(self.resolve_topic_name(topic))
        names = {info.node_name for info in found}
        return wanted.intersection(writers) <= names and inlet.get_publisher_count() >= len(found)

    def _is_heard(self, topic: str, outlet: Outlet, wanted: set[str]) -> bool:
        found = self.get_subscriptions_info_by_topic(self.resolve_topic_name(topic))
        names = {info.node_name for info in found}
        matched = outlet.publisher.get_subscription_count()
        return wanted.intersection(outlet.readers) <= names and matched >= len(found)

    def _announce_configuration(self) -> None:
        document = {
            "node": self.get_fully_qualified_name(),
            "version": __version__,
            "parameters": parameters.as_mapping(self.settings),
        }
        text = yaml.safe_dump(document | self.configuration(), sort_keys=False)
        self.outlet(String, "~/config", LATCHED_QOS).publish(String(data=text))

    # ---- parameters ------------------------------------------------------------------------

    def configuration(self) -> dict[str, Any]:
        """Return what ``~/config`` tells besides the parameters."""
        return {}

    def retune(self, settings: Any) -> None:
        """React to changed settings; InputError refuses them."""

    def _on_set(self, changed: list[Any]) -> Any:
        known = {p.name: p.value for p in changed if hasattr(self.settings, p.name)}
        if not known:
            return parameters.accepted()
        try:
            settings = parameters.read(self, self.settings_class, known)
            self.retune(settings)
        except InputError as error:
            return parameters.refusal(error)
        self.settings = settings
        return parameters.accepted()

    # ---- diagnostics -----------------------------------------------------------------------

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        """Return level (ok, warn, error), message and key-values of the 1 Hz status."""
        return "ok", "running", []

    def tasks(self) -> list[tuple[str, str, str, list[tuple[str, object]]]]:
        """Return further 1 Hz statuses: level, task, message and key-values of each."""
        return []

    def report(self, extra: Iterable[tuple[str, str, list[tuple[str, object]]]] = ()) -> None:
        """Publish the health now, and ``extra`` as further statuses (task, text, values)."""
        if not self._linked:
            return
        level, text, values = self.health()
        self._diagnostics.count += 1  # this message counts as well
        counts = [
            (f"published:{self.resolve_topic_name(topic)}", outlet.count)
            for topic, outlet in self.outlets.items()
        ]
        name, hardware = self.get_fully_qualified_name()[1:], self.hardware()
        message = DiagnosticArray()
        message.header.stamp = to_stamp(self.stamp)
        message.status = [status(f"{name}: status", hardware, level, text, [*values, *counts])]
        further = [*self.tasks(), *(("ok", *one) for one in extra)]
        message.status += [
            status(f"{name}: {task}", hardware, level, said, keys)
            for level, task, said, keys in further
        ]
        self._diagnostics.publisher.publish(message)

    def hardware(self) -> str:
        """Return the identifier of the loop for ``hardware_id``."""
        return self.get_name()

    def _each_second(self) -> None:
        if self.running:
            self.report()
