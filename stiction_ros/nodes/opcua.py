"""The driver of a real plant: tags of a control system to topics, and OP back under its grant."""

import dataclasses
import functools
import random
import time
from typing import Any

from sensor_msgs.msg import JointState

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.nodes.opcua_topics import LoopTopics, grant_keys
from stiction_ros.nodes.shared.managed import READER_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import to_ns, values_of
from stiction_ros.opcua import require_asyncua
from stiction_ros.opcua.loop_bridge import IDENTITIES, BridgeRules, LoopBridge, WriteOrder
from stiction_ros.opcua.plant_link import (
    Heard,
    Linked,
    OpcuaNodeSettings,
    PlantLink,
    Refused,
    Written,
)
from stiction_ros.opcua.tag_map import LoopTags, TagMap, check_address

QUICKEST, SLOWEST = 0.005, 0.05  # s between two looks for samples that are due
PART = 10  # looks in a sample
TOLD = 20  # loops that have a status of their own each; of more, those that are not well


class OpcuaNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.opcua.loop_bridge.LoopBridge`, one a loop."""

    settings: OpcuaNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("opcua", OpcuaNodeSettings, **kwargs)
        self._link: PlantLink | None = None

    def configure(self) -> None:
        settings = self.settings
        require_asyncua()
        told = TagMap.load(find_config(self.needed("tags", "tag map", "*.tags.yaml")))
        self._writes = settings.write
        chosen = self._chosen(told)
        self._url = settings.url or told.server
        check_address(self._url, "opcua: url")
        settings.check(bool(self._writes))
        self._said = "not connected yet"
        self._losses = 0
        self._refused: set[str] = set()
        identity = random.SystemRandom().randrange(1, IDENTITIES)
        self.bridges: dict[str, LoopBridge] = {}
        self._topics: dict[str, LoopTopics] = {}
        self._by_tag: dict[str, list[str]] = {}
        for tags in chosen:
            self._add(tags, identity)
        self._wakeup = self.create_guard_condition(self._serve)

    def _chosen(self, told: TagMap) -> tuple[LoopTags, ...]:
        """Return the loops that are bridged; those to be written must be able to."""
        chosen = told.chosen(self.settings.loops, "opcua: loops")
        written = told.chosen(self._writes, "opcua: write") if self._writes else ()
        for tags in written:
            if tags.grant is None:
                raise InputError(
                    f"loop {tags.loop!r} has no section write in the tag map", where="opcua: write"
                )
        return tuple(dict.fromkeys((*chosen, *written)))

    def _add(self, tags: LoopTags, identity: int) -> None:
        """Build bridge, topics and services of one loop."""
        settings, name = self.settings, tags.loop
        writes = name in self._writes
        prefix = f"{tags.namespace}/" if tags.namespace else ""
        rules = BridgeRules(
            settings.speed,
            writes,
            writes and settings.ask == "start",
            self.commander(tags.namespace),
            identity,
        )
        bridge = self.bridges[name] = LoopBridge(tags, rules, time.monotonic())
        self._topics[name] = LoopTopics(self, bridge)
        for tag in tags.read_tags():
            self._by_tag.setdefault(tag, []).append(name)
        if writes:
            take = functools.partial(self._on_op, name)
            self.inlet(JointState, f"{prefix}op", take, READER_QOS, ("controller",))
            self.offer(f"{prefix}ask_grant", functools.partial(self._on_ask, name))
            self.offer(f"{prefix}give_back_grant", functools.partial(self._on_give_back, name))

    def configuration(self) -> dict[str, Any]:
        return {"url": self._url, "bridged": list(self.bridges)}

    def hardware(self) -> str:
        return self._url

    def activate(self) -> None:
        writing = [bridge.tags for bridge in self.bridges.values() if bridge.rules.writes]
        written = {tag: use for tags in writing for tag, use in tags.uses()}
        settings = dataclasses.replace(self.settings, url=self._url)
        self._link = PlantLink(settings, tuple(self._by_tag), written, self._wakeup.trigger)
        self._link.start()
        shortest = min(bridge.period for bridge in self.bridges.values())
        self.every(min(max(shortest / PART, QUICKEST), SLOWEST), "serve", self._serve)

    def deactivate(self) -> None:
        self.never("serve")
        link, self._link = self._link, None
        if link is not None:
            now = time.monotonic()
            for bridge in self.bridges.values():
                link.submit(bridge.give_back(now, "the node stops"))
            link.stop()
            self._tell_grants()

    # ---- diagnostics -----------------------------------------------------------------------

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        alive = self._link is not None and self._link.alive(time.monotonic())
        values: list[tuple[str, object]] = [
            ("connected", alive),
            ("losses", self._losses),
            ("loops", len(self.bridges)),
            ("refused_tags", len(self._refused)),
        ]
        return ("ok" if alive else "error"), self._said, values

    def tasks(self) -> list[tuple[str, str, str, list[tuple[str, object]]]]:
        now = time.monotonic()
        found = []
        for name, topics in self._topics.items():
            level, text, values = topics.health(now)
            if level != "ok" or len(self.bridges) <= TOLD:
                found.append((level, f"loop {name}", text, values))
        return found

    # ---- the plant -------------------------------------------------------------------------

    def _serve(self) -> None:
        """Take in what the plant said, publish what is due, write what is to be written."""
        link = self._link
        if link is None:
            return
        for event in link.drain():
            if isinstance(event, Heard):
                for name in self._by_tag[event.tag]:
                    self._submit(self.bridges[name].hear(event.tag, event.reading, event.at))
            elif isinstance(event, Written):
                self._on_written(event)
            elif isinstance(event, Refused):
                self._on_refused(event)
            else:
                self._on_linked(event)
        now = time.monotonic()
        alive = link.alive(now)
        for name, bridge in self.bridges.items():
            for sample in bridge.samples(now):
                self.stamp = sample.stamp
                if self.running:
                    ours = bridge.grant.may_write  # else OP is the plant's own, as we read it
                    by = bridge.op_port.commander if ours else self.get_fully_qualified_name()
                    self._topics[name].publish(sample, by)
            self._submit(bridge.linked(alive, now))
        self._tell_grants()

    def _on_linked(self, event: Linked) -> None:
        before, self._said = self._said, event.reason
        self._losses += not event.connected
        if event.reason == before:
            return
        if event.connected:  # rclpy wants one severity a line
            self.log.info(event.reason)
        else:
            self.log.warning(event.reason)
        self.report()

    def _on_refused(self, event: Refused) -> None:
        now, before = time.monotonic(), self._refused
        for bridge in self.bridges.values():
            self._submit(bridge.refuse(event.tags, now))
        self._refused = {text for bridge in self.bridges.values() for text in bridge.refused}
        for text in sorted(self._refused - before):
            self.log.warning(text)
        if self._refused != before:
            self.report()

    def _on_written(self, event: Written) -> None:
        bridge, now = self.bridges[event.order.loop], time.monotonic()
        self._submit(bridge.written(event.order, event.failure, event.seconds, now))

    def _submit(self, orders: list[WriteOrder]) -> None:
        if orders and self._link is not None:
            self._link.submit(orders)

    def _tell_grants(self) -> None:
        """Publish every grant that has changed."""
        for name in self._writes:
            grant = self._topics[name].changed_grant()
            if grant is not None:
                self.log.info(f"loop {name}: {grant.state.value}, {grant.reason}")
                self.report([(f"grant {name}", grant.state.value, grant_keys(grant))])
                if grant.lost:
                    self.notice(f"grant {name}", "warn", f"loop {name}: {grant.reason}")

    # ---- the loop --------------------------------------------------------------------------

    def _on_op(self, name: str, message: JointState) -> None:
        if not self.running:
            return
        bridge, sender = self.bridges[name], message.header.frame_id
        op = values_of(message, [valve.name for valve in bridge.tags.valves])
        stamp = to_ns(message.header.stamp)
        found, orders = bridge.command(sender, stamp, op, time.monotonic())
        complaint = bridge.op_port.complaint(found, sender)
        if complaint:
            self.notice(found.value, "warn", complaint)
        self._submit(orders)

    def _on_ask(self, name: str) -> tuple[bool, str]:
        bridge = self.bridges[name]
        why_not = bridge.ask()
        self._submit(bridge.look(time.monotonic()))
        waits = f"; {bridge.grant.reason}" if bridge.grant.wanted else ""
        return not why_not, why_not or f"asked for{waits}"

    def _on_give_back(self, name: str) -> tuple[bool, str]:
        self._submit(self.bridges[name].give_back(time.monotonic(), "given back by service"))
        self._tell_grants()
        return True, "given back"
