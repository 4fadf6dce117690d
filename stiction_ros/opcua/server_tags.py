"""The tags of one session: which nodes they are, and which of them the server refuses, and why."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from stiction_ros.errors import InputError
from stiction_ros.opcua.session import is_open, node_id
from stiction_ros.opcua.tag_map import Use

if TYPE_CHECKING:
    from asyncua import Client, ua

WIDE = frozenset({"Int32", "UInt32", "Int64", "UInt64", "Double"})  # they hold a beat of 31 bits
NUMBERS = WIDE | {"SByte", "Byte", "Int16", "UInt16", "Float"}
FITTING = {  # types that a written tag may have, and what is said of another one
    Use.REQUEST: (NUMBERS | {"Boolean"}, "a request is a number or Boolean"),
    Use.BEAT: (WIDE, "a heartbeat is a whole number of 32 bits"),
    Use.OP: (NUMBERS, "an OP is a number"),
}
QUEUE = 100  # changes of one tag that the server keeps between two publications


class ServerTags:
    """Tags as a server knows them. One that it refuses leaves the others as they are.

    Attributes:
        names: of the tags that are read from a node.
        nodes: of the tags that are node ids of a namespace that is there.
        kinds: type of number that a written tag takes; without those that are refused.
        refused: why a tag is refused, for those that are.
    """

    def __init__(self, client: "Client", read: Sequence[str], written: Mapping[str, Use]) -> None:
        """Take the tags; :meth:`ask` asks the server."""
        self._client, self._read, self._written = client, read, written
        self._heard: set[str] = set()  # tags that are subscribed to
        self.names: dict[ua.NodeId, list[str]] = {}
        self._writers: dict[ua.NodeId, str] = {}  # the first tag of each written node
        self.nodes: dict[str, ua.NodeId] = {}
        self.kinds: dict[str, ua.VariantType] = {}
        self.refused = dict.fromkeys((*read, *written), "is not known yet")

    async def ask(self, subscription: Any, interval: float) -> None:
        """Ask for all that is refused: nodes, types of what is written, changes of what is read.

        Changes are sampled every ``interval`` ms.
        """
        spaces = await self._client.get_namespace_array()
        asked, self.refused = self.refused, {}
        for tag in asked:
            try:
                self.nodes[tag] = node_id(tag, spaces)
            except InputError as error:
                self.refused[tag] = error.what
        there = asked.keys() - self.refused.keys()
        for tag in (one for one in self._written if one in there and one not in self.kinds):
            first = self._writers.setdefault(self.nodes[tag], tag)
            # Of two spellings of one node only the server can tell.
            twice = f"is the node of {first}, which is written already"
            why = await self._find_kind(tag) if first == tag else twice
            if why:
                self.refused[tag] = why
        await self._subscribe(
            subscription, [t for t in self._read if t in there - self._heard], interval
        )

    async def _find_kind(self, tag: str) -> str:
        """Note the type of number that a written tag takes; return why it is refused, if it is."""
        from asyncua import ua

        try:
            node = self._client.get_node(self.nodes[tag])
            kind = await node.read_data_type_as_variant_type()
        except ua.UaError as error:
            if not is_open(self._client):
                raise
            told = isinstance(error, ua.UaStatusCodeError)
            why = ua.StatusCode(error.code).name if told else "its type is not known"
            return f"is refused ({why})"
        fitting, needs = FITTING[self._written[tag]]
        if kind.name not in fitting:
            return f"is of type {kind.name}, and {needs}"
        self.kinds[tag] = kind
        return ""

    async def _subscribe(self, subscription: Any, tags: list[str], interval: float) -> None:
        from asyncua import ua

        if not tags:
            return
        for tag in tags:
            names = self.names.setdefault(self.nodes[tag], [])
            names += [tag] if tag not in names else []
        nodes = [self._client.get_node(self.nodes[tag]) for tag in tags]
        found = await subscription.subscribe_data_change(
            nodes, queuesize=QUEUE, sampling_interval=interval
        )
        for tag, handle in zip(tags, found, strict=True):
            if isinstance(handle, ua.StatusCode):
                self.refused[tag] = f"is refused ({handle.name})"
            else:
                self._heard.add(tag)
