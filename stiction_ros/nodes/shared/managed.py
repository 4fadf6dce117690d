"""What all nodes share: lifecycle, counted publishers, peers, diagnostics, configuration."""

import time
import traceback
from collections.abc import Callable, Iterable
from typing import Any

import yaml
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.timer import Timer
from std_msgs.msg import String
from std_srvs.srv import Trigger

from stiction_ros import __version__
from stiction_ros.errors import InputError
from stiction_ros.nodes.shared import parameters
from stiction_ros.nodes.shared.messages import status, to_stamp
from stiction_ros.nodes.shared.peers import Inlet, Outlet, Peers, known_as
from stiction_ros.online.health import LEVELS, Noticed
from stiction_ros.settings import changed

SIGNAL_QOS = QoSProfile(depth=100)
# What waits for a process that is busy for a moment; writers keep SIGNAL_QOS.
READER_QOS = QoSProfile(depth=5000)
LATCHED_QOS = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LATCHED_READER_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ACK_PATIENCE = 3.0  # s for all topics together: a reader that was killed never answers
LINK_PATIENCE = 5.0  # s until a node says what it waits for
LINK_REMINDER = 30.0  # s until it says so again
LINK_PERIOD = 0.02  # s between two looks at the graph until all peers are there
LOOK_PERIOD = 0.1  # s between two looks at what has become of the loop
LOOKS = 10  # of them until the next status
PEER_LOOKS = 5  # of them until the next look at the partners


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
        self.inlets: dict[str, Inlet] = {}
        self.noticed = Noticed(time.monotonic)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._ready = self._linked = self._configured = False
        self.regular: dict[str, Timer] = {}
        self._offered: list[Any] = []
        parameters.declare(self, settings)
        self.settings: Any = settings()  # of the class that the subclass declares
        self.add_on_set_parameters_callback(self._on_set)

    @property
    def log(self) -> RcutilsLogger:
        log: RcutilsLogger = self.get_logger()
        return log

    def every(self, period: float, name: str, work: Callable[[], None]) -> None:
        """Do ``work`` every ``period`` s, in place of what had this name, until :meth:`never`.

        The clock is a steady one: simulated time that stands still stops no node.
        """
        self.never(name)
        self.regular[name] = self.create_timer(period, work, clock=self._steady)

    def never(self, name: str) -> None:
        """End what is done regularly under a name, if anything is."""
        if name in self.regular:
            self.destroy_timer(self.regular.pop(name))

    # ---- lifecycle -------------------------------------------------------------------------

    def start(self) -> None:
        """Configure and activate, as ``autostart`` does."""
        transitions: Any = self  # rclpy gives them no types
        transitions.trigger_configure()
        if not self.failure:
            transitions.trigger_activate()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._guarded(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        return self._guarded(self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._stop()
        self.deactivate()
        return TransitionCallbackReturn.SUCCESS

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

    def close(self) -> None:
        """End what runs beside the node, if anything does."""

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
        self.close()

    def _configure(self) -> None:
        parameters.refuse_unknown(self)
        self.settings = parameters.read(self, self.settings_class)
        self._diagnostics = self.outlet(DiagnosticArray, "/diagnostics", QoSProfile(depth=100))
        self._looks, self._told_level = 0, "ok"
        self.every(LOOK_PERIOD, "look", self._look_around)
        self.configure()
        self._configured = True

    def _activate(self) -> None:
        self._ready = self._linked = False
        self._peers, self._busy = Peers(self, self.settings.wait_for), ""
        self._remind_at = time.monotonic() + LINK_PATIENCE
        self.activate()
        self.every(LINK_PERIOD, "link", self._look_for_peers)

    def _stop(self) -> None:
        self.running = False
        self.never("link")

    def _tear_down(self) -> None:
        self._stop()
        self.close()
        self._linked = self._configured = False
        for name in list(self.regular):
            self.never(name)
        for service in self._offered:
            self.destroy_service(service)
        for subscription in list(self.subscriptions):
            if subscription is not self._time_source._clock_sub:  # that of use_sim_time
                self.destroy_subscription(subscription)
        for outlet in self.outlets.values():
            self.destroy_publisher(outlet.publisher)
        self.outlets, self.inlets, self._offered = {}, {}, []

    def _guarded(self, action: Callable[[], None]) -> TransitionCallbackReturn:
        self.failure = ""
        try:
            action()
        except InputError as error:
            self.failure = str(error)
            self.log.error(self.failure)
            if self.outlets:
                self._tear_down()
            return TransitionCallbackReturn.FAILURE
        except Exception as error:  # rclpy would swallow it without a word
            self.failure = f"internal error: {error!r}"
            self.log.error(traceback.format_exc())
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
        waits = qos is SIGNAL_QOS and getattr(self.settings, "pace", "") == "lockstep"
        self.outlets[topic] = Outlet(publisher, (*readers, "recorder"), qos, waits=waits)
        return self.outlets[topic]

    def inlet(
        self, kind: Any, topic: str, take: Any, qos: QoSProfile, writers: tuple[str, ...] = ()
    ) -> None:
        """Subscribe; ``writers`` are the nodes whose first message must not be missed."""
        subscription = self.create_subscription(kind, topic, take, qos)
        self.inlets[topic] = Inlet(subscription, writers, qos)

    def offer(self, name: str, call: Callable[[], tuple[bool, str]]) -> None:
        """Offer a service that takes nothing and answers whether it was done, and what to say."""

        def serve(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success, response.message = call()
            return response

        self._offered.append(self.create_service(Trigger, name, serve))

    def linked(self) -> None:
        """Called once when everything in ``wait_for`` has matched, in both directions."""

    def preparing(self) -> str:
        """Return what is done before the node is ready, such as compilation; empty: nothing."""
        return ""

    def _look_for_peers(self) -> None:
        """Become ready when all writers have matched; begin when all peers are ready.

        A reader of a volatile topic misses what is sent before it has matched the writer,
        also when the writer has matched it already. So each node looks at its own readers
        first and then says that it is ready by announcing ``~/config``.
        """
        busy = "" if self._ready else self.preparing()
        if busy != self._busy:
            self._busy, self._remind_at = busy, time.monotonic() + LINK_PATIENCE
            self.log.info(f"not ready yet: {busy}" if busy else "prepared")
        if busy:
            return
        missing = [] if self._ready else self._peers.unheard(self.inlets)
        if not missing and not self._ready:
            if "~/config" not in self.outlets:  # it is there already after a pause
                self._announce_configuration()
            self._ready = True
        missing = missing or self._peers.unlinked(self.outlets)
        if not missing:
            self._begin()
        elif time.monotonic() > self._remind_at:
            self._remind_at = time.monotonic() + LINK_REMINDER
            said = f"still waiting for {', '.join(missing)}; see the parameter wait_for"
            self.log.warning(said)

    def _begin(self) -> None:
        self._stop()
        self._peers.pin()
        others = (*self._peers.names, *self._peers.topics)
        self.log.info(f"{self.get_name()} is ready: {', '.join(others) or 'alone'}")
        self._linked = self.running = True
        self.report()
        self.linked()

    def partner_lost(self, name: str, what: str) -> None:
        """React to a partner in lockstep that has gone or was replaced: end with the plant."""
        if known_as(name) == "plant":
            self.log.info(f"{name} {what}: the run is over")
            self.running, self.finished = False, True

    def end(self, reason: str) -> None:
        """End the node as failed, with one sentence."""
        self.failure = reason
        self.log.error(reason)
        self.running, self.finished = False, True

    def _announce_configuration(self) -> None:
        document = {
            "node": self.get_fully_qualified_name(),
            "version": __version__,
            "parameters": parameters.as_mapping(self.settings),
        }
        text = yaml.safe_dump(document | self.configuration(), sort_keys=False)
        self.outlet(String, "~/config", LATCHED_QOS).publish(String(data=text))

    # ---- parameters ------------------------------------------------------------------------

    def needed(self, key: str, what: str, kind: str) -> str:
        """Return a text parameter; InputError, which says of what ``kind`` it is, if empty."""
        value = str(getattr(self.settings, key))
        if not value:
            where = f"{self.get_name()}: {key}"
            raise InputError(f"no {what}", where=where, fix=f"set it to a {kind}")
        return value

    def commander(self, space: str = "") -> str:
        """Return the full name of the node that commands a loop in the namespace ``space``."""
        name = str(self.settings.commander)
        if name.startswith("/"):
            return name
        parts = (self.get_namespace().strip("/"), space, name)
        return "/" + "/".join(part for part in parts if part)

    def configuration(self) -> dict[str, Any]:
        """Return what ``~/config`` tells besides the parameters."""
        return {}

    def retune(self, settings: Any) -> None:
        """React to changed settings; InputError refuses them."""

    def set_parameters_atomically(self, parameter_list: list[Any]) -> Any:
        """Set parameters as ROS does, but say which one is unknown."""
        try:
            for parameter in parameter_list:
                parameters.check_known(self, parameter.name)
        except InputError as error:
            return parameters.answer(str(error))
        return super().set_parameters_atomically(parameter_list)

    def _on_set(self, wanted: list[Any]) -> Any:
        values = {p.name: p.value for p in wanted}
        try:
            name = self.get_fully_qualified_name()
            settings = changed(self.settings, values, name, self._configured)
            if self._configured and settings is not self.settings:
                self.retune(settings)
        except InputError as error:
            return parameters.answer(str(error))
        self.settings = settings
        return parameters.answer()

    # ---- diagnostics -----------------------------------------------------------------------

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        """Return level (ok, warn, error), message and key-values of the 1 Hz status."""
        return "ok", "running", []

    def tasks(self) -> list[tuple[str, str, str, list[tuple[str, object]]]]:
        """Return further 1 Hz statuses: level, task, message and key-values of each."""
        return []

    def look(self) -> None:
        """Notice what has become of the loop; called every LOOK_PERIOD while it runs."""

    def notice(self, name: str, level: str, text: str) -> None:
        """Show a condition (warn or error) long enough to be seen; log it when it is new."""
        if self.noticed.notice(name, level, text):
            self.log.warning(text)
        if LEVELS.index(level) > LEVELS.index(self._told_level):
            self.report()

    def report(self, extra: Iterable[tuple[str, str, list[tuple[str, object]]]] = ()) -> None:
        """Publish the health now, and ``extra`` as further statuses (task, text, values)."""
        if not self._linked:
            return
        level, text, values = self.health()
        level = max(level, self.noticed.level, key=LEVELS.index)
        text = "; ".join(said for said in (text, self.noticed.text) if said)
        if self.failure:
            level, text = "error", self.failure
        self._told_level = level
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
        return str(self.get_name())

    def _look_around(self) -> None:
        """Look at the loop, now and then at the partners, and tell once a second or at once."""
        if not self.running:
            return
        self._looks += 1
        self.look()
        if self._looks % PEER_LOOKS == 0 and getattr(self.settings, "pace", "") == "lockstep":
            for name, what in self._peers.gone().items():
                if self.running:
                    self.partner_lost(name, what)
        if self.running and self._looks % LOOKS == 0:
            self.report()
