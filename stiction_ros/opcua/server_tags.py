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
FITTING = {Use.REQUEST: NUMBERS | {"Boolean"}, Use.BEAT: WIDE, Use.OP: NUMBERS}
NEEDS = {
    Use.REQUEST: "a request is a number or Boolean",
    Use.BEAT: "a heartbeat is a whole number of 32 bits",
    Use.OP: "an OP is a number",
}
QUEUE = 100  # changes of one tag that the server keeps between two publications


class ServerTags:
    """Tags as a server knows them. One that it refuses leaves the others as they are.

    Attributes:
        nodes: of the tags that are node ids of a namespace that is there.
        kinds: type of number that a written tag takes; without those that are refused.
        unread, unwritten: why a tag is refused, for those that are.
    """

    def __init__(self, client: "Client", read: Sequence[str], written: Mapping[str, Use]) -> None:
        """Take the tags; :meth:`find` and :meth:`subscribe` ask the server."""
        self._client, self._written = client, written
        self._names: dict[ua.NodeId, list[str]] = {}
        self._writers: dict[ua.NodeId, str] = {}  # the first tag of each written node
        self.nodes: dict[str, ua.NodeId] = {}
        self.kinds: dict[str, ua.VariantType] = {}
        self.unread: dict[str, str] = dict.fromkeys(read, "is not known yet")
        self.unwritten: dict[str, str] = dict.fromkeys(written, "is not known yet")

    @property
    def refused(self) -> tuple[Mapping[str, str], Mapping[str, str]]:
        """Copies of ``unread`` and ``unwritten``."""
        return dict(self.unread), dict(self.unwritten)

    def of(self, node: "ua.NodeId") -> list[str]:
        """Return the tags that are read from a node."""
        return self._names.get(node, [])

    async def find(self) -> None:
        """Ask for the nodes of all refused tags and for the types of those that are written."""
        spaces = await self._client.get_namespace_array()
        for tag in dict.fromkeys((*self.unread, *self.unwritten)):
            try:
                self.nodes[tag] = node_id(tag, spaces)
            except InputError as error:
                for refused in (self.unread, self.unwritten):
                    if tag in refused:
                        refused[tag] = error.what
        for tag in [one for one in self._written if one in self.unwritten and one in self.nodes]:
            first = self._writers.setdefault(self.nodes[tag], tag)
            if first == tag:
                await self._find_kind(tag)
            else:  # two spellings of one node, which only the server can tell
                self.unwritten[tag] = f"is the node of {first}, which is written already"

    async def _find_kind(self, tag: str) -> None:
        from asyncua import ua

        try:
            node = self._client.get_node(self.nodes[tag])
            kind = await node.read_data_type_as_variant_type()
        except ua.UaError as error:
            if not is_open(self._client):
                raise
            self.unwritten[tag] = refusal(error)
            return
        use = self._written[tag]
        if kind.name in FITTING[use]:
            self.kinds[tag] = kind
            del self.unwritten[tag]
        else:
            self.unwritten[tag] = f"is of type {kind.name}, and {NEEDS[use]}"

    async def subscribe(self, subscription: Any, interval: float) -> None:
        """Subscribe to what is not subscribed yet, sampled every ``interval`` ms."""
        from asyncua import ua

        tags = [tag for tag in self.unread if tag in self.nodes]
        if not tags:
            return
        for tag in tags:
            names = self._names.setdefault(self.nodes[tag], [])
            names += [tag] if tag not in names else []
        nodes = [self._client.get_node(self.nodes[tag]) for tag in tags]
        found = await subscription.subscribe_data_change(
            nodes, queuesize=QUEUE, sampling_interval=interval
        )
        for tag, handle in zip(tags, found, strict=True):
            if isinstance(handle, ua.StatusCode):
                self.unread[tag] = f"is refused ({handle.name})"
            else:
                del self.unread[tag]


def refusal(error: Exception) -> str:
    """Return why a tag is refused, by what OPC UA says of it."""
    from asyncua import ua

    code = ua.StatusCode(error.code).name if isinstance(error, ua.UaStatusCodeError) else ""
    return f"is refused ({code or 'its type is not known'})"
