"""The player: a bag back into the graph, at any rate, with pause and steps."""

import time
from typing import Any

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

from stiction_ros.errors import InputError
from stiction_ros.nodes.shared.managed import SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import SECOND, message_class, to_stamp
from stiction_ros.nodes.shared.peers import Outlet
from stiction_ros.online.plain_settings import PlayerNodeSettings
from stiction_ros.records.bag.playback import Playback, bag_content, offered_qos
from stiction_ros.records.storage.bag_metadata import BagTopic, Qos
from stiction_ros.records.storage.mcap_scan import RawMessage

PERIOD = 0.002  # s between two looks at what is due
BURST = 80  # messages at one look, less than any reader's history
PATIENCE = 0.5  # s for the readers to take in a whole burst
CLOCK = "/clock"


class PlayerNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.records.bag.playback.Playback`."""

    settings: PlayerNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("player", PlayerNodeSettings, **kwargs)

    def configure(self) -> None:
        settings = self.settings
        content = bag_content(self.needed("bag", "bag", "bag"), settings.topics)
        how = settings.rate, settings.start, settings.loop
        self.playback = Playback(content, time.monotonic_ns, *how)
        self._skipped: dict[str, str] = {}
        self._topics: dict[str, Outlet] = {}
        recorded = settings.clock == "auto" and CLOCK in content.topics
        self._own = settings.clock != "none" and not recorded
        self._told = 0
        for name, topic in content.topics.items():
            if name != CLOCK or recorded:
                self._offer(topic)
        if self._own:
            self._clock_out = self.outlet(Clock, CLOCK, SIGNAL_QOS)
        self._resumes = not settings.paused
        for note in content.notes:
            self.log.warning(note)
        self.offer("~/pause", self._on_pause)
        self.offer("~/resume", self._on_resume)
        self.offer("~/step", self._on_step)
        self.every(PERIOD, "play", self._tick)

    def linked(self) -> None:
        if self._resumes:
            self.playback.resume()

    def deactivate(self) -> None:
        self._resumes = not self.playback.paused
        self.playback.pause()

    def retune(self, settings: PlayerNodeSettings) -> None:
        self.playback.rate = settings.rate

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        playback = self.playback
        text = "paused" if playback.paused else "playing"
        keys: list[tuple[str, object]] = [
            ("bag", self.settings.bag),
            ("played", playback.played),
            ("rounds", playback.rounds),
        ]
        keys += [(f"skipped:{name}", why) for name, why in self._skipped.items()]
        level = "warn" if self._skipped else "ok"
        return level, "finished" if playback.finished else text, keys

    # ---- topics ----------------------------------------------------------------------------

    def _offer(self, topic: BagTopic) -> None:
        """Create the publisher of one topic, or say why it is not played."""
        try:
            if topic.encoding != "cdr":
                raise InputError(f"messages are encoded as {topic.encoding or 'nothing'}")
            kind, qos = message_class(topic.type), _profile(offered_qos(topic))
        except InputError as error:
            self._skipped[topic.name] = str(error)
            self.log.warning(f"{topic.name} is not played: {error}")
            return
        # Diagnostics of the player itself go out there already.
        known = self.outlets.get(topic.name)
        self._topics[topic.name] = known or self.outlet(kind, topic.name, qos)

    def _tick(self) -> None:
        if not self.running:
            return
        found = self.playback.due(BURST)
        self._send(found)
        if len(found) == BURST:
            for name in {message.topic.name for message in found} & self._topics.keys():
                self._topics[name].publisher.wait_for_all_acked(Duration(seconds=PATIENCE))
        if self.playback.finished:
            self.log.info(f"played {self.playback.played} messages")
            self.finished, self.running = True, False

    def _send(self, messages: list[RawMessage]) -> None:
        """Publish; the player's own clock goes before the messages of its time."""
        self.stamp = self.playback.time
        now = time.monotonic_ns()
        if self._own and (messages or now - self._told > SECOND / self.settings.clock_rate):
            self._told = now
            self._clock_out.publish(Clock(clock=to_stamp(self.stamp)))
        for message in messages:
            outlet = self._topics.get(message.topic.name)
            if outlet is not None:
                outlet.publish(message.data)

    # ---- services --------------------------------------------------------------------------

    def _on_pause(self) -> tuple[bool, str]:
        if self.running:
            self.playback.pause()
        return self._answer()

    def _on_resume(self) -> tuple[bool, str]:
        if self.running:
            self.playback.resume()
        return self._answer()

    def _on_step(self) -> tuple[bool, str]:
        if self.running and not self.playback.paused:
            return False, "it is playing, pause it first"
        if self.running:
            self._send(self.playback.next_messages())
        return self._answer()

    def _answer(self) -> tuple[bool, str]:
        """Return whether it was done, and the time that is being played."""
        self.report()
        at = f"at {self.playback.time / SECOND:.9f} s"
        return bool(self.running), at if self.running else "not active"


def _profile(qos: Qos) -> QoSProfile:
    return QoSProfile(
        depth=qos.depth,
        reliability=ReliabilityPolicy[qos.reliability.upper()],
        durability=DurabilityPolicy[qos.durability.upper()],
        history=HistoryPolicy[qos.history.upper()],
    )
