"""The recorder: every topic of the graph into one MCAP bag."""

import itertools
import re
import struct
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSCompatibility, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

from stiction_ros.errors import InputError
from stiction_ros.nodes.shared.managed import READER_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import SECOND, message_class, offered_qos, reader_qos
from stiction_ros.nodes.shared.peers import Inlet
from stiction_ros.online.plain_settings import RecorderNodeSettings
from stiction_ros.records.bag.message_definitions import definition
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.run.loop_signals import JOINT_STATE
from stiction_ros.records.storage.log_time import SIMULATED, LogTime

DISCOVERY_PERIOD = 0.05  # s between two looks at the graph
BAG_PERIOD = 1.0  # s between two looks at the bag
CLOCK, CLOCK_TYPE = "/clock", "rosgraph_msgs/msg/Clock"
_STAMP = struct.Struct("<iI")  # sec and nanosec behind the 4 bytes of the encapsulation
OWN = "own"  # in place of an expression: topics of the recorder's namespace and of the graph

GLOBAL = ("clock", "diagnostics", "parameter_events", "rosout")


def topic_choice(
    names: Sequence[str], regex: str, exclude: str, namespace: str = "/"
) -> Callable[[str], bool]:
    """Return what tells whether a topic is taken; an empty expression fits nothing.

    Args:
        names: full names.
        regex: of full names; :data:`OWN` for the loop of the namespace.
        exclude: of full names that are left out, also when ``names`` has them.
        namespace: of the recorder.
    """
    if not names and not regex:
        raise InputError("no topic is chosen", where="recorder", fix="set topics or regex")
    if regex == OWN:
        own = re.escape(namespace.rstrip("/"))
        regex = f"{own}/.*|/({'|'.join(GLOBAL)})" if own else ".*"
    fits, left_out = _fitting(regex, "regex"), _fitting(exclude, "exclude_regex")
    return lambda topic: not left_out(topic) and (topic in names or bool(fits(topic)))


def _fitting(text: str, key: str) -> Callable[[str], re.Match[str] | None]:
    try:
        return re.compile(text).fullmatch if text else lambda _: None
    except re.error as error:
        raise InputError(f"no regular expression ({error})", where=f"recorder: {key}") from None


class RecorderNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.records.bag.writer.BagWriter`."""

    settings: RecorderNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("recorder", RecorderNodeSettings, **kwargs)
        self.writer: BagWriter | None = None
        self._bags: list[Path] = []

    def configure(self) -> None:
        settings = self.settings
        names = [self.resolve_topic_name(name) for name in settings.topics]
        space = self.get_namespace()
        self._wanted = topic_choice(names, settings.regex, settings.exclude_regex, space)
        directory = free_directory(Path(settings.directory), self._bags)
        most = settings.max_bag_size, round(settings.max_bag_duration * SECOND)
        self.writer = BagWriter(directory, settings.compression, *most)
        self._bags.append(directory)
        if len(self._bags) > 1:
            self.log.info(f"recording into {directory}")
        self._topics: dict[str, Inlet] = {}
        self._skipped: dict[str, str] = {}
        self._unheard: dict[str, str] = {}
        self._lost = self._put_back = 0
        self._times = LogTime()
        own = settings.regex == OWN and space != "/"
        self._own_pv = self.resolve_topic_name("pv") if own else ""
        self._clock_runs = False
        self.every(DISCOVERY_PERIOD, "discover", self._discover)
        self.every(BAG_PERIOD, "bag", self._look_at_the_bag)
        self._discover()  # now, or its own first status would find no reader

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        counts = {} if self.writer is None else self.writer.counts
        keys: list[tuple[str, object]] = [
            (f"recorded:{name}", count) for name, count in counts.items()
        ]
        keys += [(f"skipped:{name}", why) for name, why in self._skipped.items()]
        keys += [(f"unheard:{name}", why) for name, why in self._unheard.items()]
        keys += [("lost", self._lost), ("put_back", self._put_back)]
        return ("warn" if self._skipped or self._unheard else "ok"), "recording", keys

    def close(self) -> None:
        """Write what has arrived and finish the bag.

        What the storage refuses is a failure, the journals stay.
        """
        if self.writer is None:
            return
        self._take_the_rest()
        writer, self.writer = self.writer, None
        self.never("discover")
        try:
            writer.close()
        except (OSError, InputError) as error:
            why = error.strerror if isinstance(error, OSError) else error.what
            self.failure = f"{writer.directory}: not finished ({why}); repair it later"
            self.log.error(self.failure)
        else:
            self.log.info(f"bag finished: {writer.directory}")

    # ---- topics ----------------------------------------------------------------------------

    def _discover(self) -> None:
        """Subscribe to every wanted topic that has appeared since the last look."""
        for name, types in self.get_topic_names_and_types():
            if name in self._topics or name in self._skipped or not self._wanted(name):
                continue
            offered = self.get_publishers_info_by_topic(name)
            if not offered:
                continue
            try:
                if len(types) != 1:
                    raise InputError(f"published as {' and '.join(types)}")
                self._record(name, types[0], offered)
            except InputError as error:
                self._skipped[name] = str(error)
                self.log.warning(f"{name} is not recorded: {error}")
            except OSError as error:  # tried again at the next look
                self._refused(error)

    def _record(self, name: str, kind: str, offered: list[TopicEndpointInfo]) -> None:
        assert self.writer is not None
        text, type_hash = definition(kind)
        self.writer.add_topic(name, kind, text, type_hash, [offered_qos(i) for i in offered])
        qos = reader_qos(offered, READER_QOS.depth)
        subscription = self.create_subscription(
            message_class(kind),
            name,
            self._writing(name, kind),
            qos,
            raw=True,
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
        )
        self._topics[name] = Inlet(subscription, (), qos)

    def _take_the_rest(self) -> None:
        """Write what waits on the subscriptions, the node's own last status among it.

        Topics take turns, as under an executor, so that log time goes on with simulated time.
        """
        for _ in range(READER_QOS.depth):
            taken = sum(inlet.take() for inlet in self._topics.values())
            if not taken:
                return

    def _look_at_the_bag(self) -> None:
        """Look once a second for what cannot be heard, and whether the bag is still there."""
        self._look_for_unheard()
        if self.writer is None:
            return
        try:
            said = self.writer.put_back()
        except OSError as error:
            said = (
                f"{self.writer.directory} was removed and cannot be written again "
                f"({error.strerror}); make room for it under its name"
            )
        else:
            self._put_back += bool(said)
        if said:
            self.notice("removed", "error", said)

    def _refused(self, error: OSError) -> None:
        """Note that the storage refused something."""
        assert self.writer is not None
        said = f"{self.writer.directory}: {error.strerror}; {self._lost} messages lost so far"
        self.notice("storage", "error", said)

    def _look_for_unheard(self) -> None:
        """Tell of publishers that came later and offer less than the subscription asks for."""
        for name, inlet in self._topics.items():
            if name in self._unheard:
                continue
            for info in self.get_publishers_info_by_topic(name):
                compatibility, why = qos_check_compatible(info.qos_profile, inlet.qos)
                if compatibility == QoSCompatibility.ERROR:  # equal, not the same object
                    self._unheard[name] = f"{info.node_name}: {why.strip()}"
                    self.log.warning(f"{name} of {self._unheard[name]} is not recorded")
                    break

    def _writing(self, topic: str, kind: str) -> Callable[..., None]:
        """Return the callback of one topic; log time is simulated time where there is any."""
        tells_time = (topic, kind) in {(CLOCK, CLOCK_TYPE), (self._own_pv, JOINT_STATE)}

        def write(data: bytes, info: dict[str, int]) -> None:
            if self.writer is None:
                return
            try:
                if tells_time:
                    self._see(topic, data)
                log_time = self._times.of(int(info["received_timestamp"]))
                self.writer.write(topic, data, log_time, int(info["source_timestamp"]))
            except OSError as error:
                self._lost += 1
                self._refused(error)

        return write

    def _see(self, topic: str, data: bytes) -> None:
        """Take the simulated time that a message tells.

        A recorder of one loop goes by the stamps of its PV as soon as any clock runs, as
        another loop's clock may be on the same topic.
        """
        assert self.writer is not None
        self._clock_runs |= topic == CLOCK
        if not self._clock_runs or (self._own_pv and topic == CLOCK):
            return
        seconds, rest = _STAMP.unpack_from(data, 4)
        self.stamp = seconds * SECOND + rest
        if self._times.see(self.stamp):
            self.writer.add_metadata(SIMULATED, {"first": str(self.stamp)})


def free_directory(wanted: Path, written: Collection[Path]) -> Path:
    """Return where the next bag goes: where it is wanted, or beside an earlier one of this node."""
    if wanted not in written or not wanted.exists():
        return wanted
    beside = (wanted.with_name(f"{wanted.name}_{number}") for number in itertools.count(2))
    return next(path for path in beside if not path.exists())
