"""A tag map made by browsing a server: loops are what has a PV and an OP under one name."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stiction_ros.errors import InputError
from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.session import node_ids, open_client

if TYPE_CHECKING:
    from asyncua import Client

DEPTH = 8  # levels of folders
MOST = 200_000  # nodes that are looked at


async def browse(url: str, credentials: Credentials, root: str) -> dict[tuple[str, str], str]:
    """Return node ids of all variables below ``root``, or the folder Objects, by group and name.

    ``FIC101.PV`` is PV of the group FIC101, and so is a variable PV in a folder FIC101. Node ids
    name their namespace. Errors are those of :mod:`.session`, and more than 200 000 nodes.
    """
    client = await open_client(url, credentials)
    try:
        return await _browse(client, root)
    finally:
        await client.disconnect()


async def _browse(client: "Client", root: str) -> dict[tuple[str, str], str]:
    from asyncua import ua

    spaces = await client.get_namespace_array()
    begin = client.nodes.objects
    if root:
        begin = client.get_node((await node_ids(client, [root]))[root])
    found: dict[tuple[str, str], str] = {}
    level: list[tuple[Any, str]] = [(begin, "")]
    seen: set[Any] = set()
    for _ in range(DEPTH):
        below: list[tuple[Any, str]] = []
        for node, folder in level:
            for one in await node.get_references(
                ua.ObjectIds.HierarchicalReferences, ua.BrowseDirection.Forward
            ):
                if one.NodeId in seen or one.NodeId.NamespaceIndex == 0:
                    continue
                seen.add(one.NodeId)
                if len(seen) > MOST:
                    where = str(client.server_url.geturl())
                    raise InputError(f"more than {MOST} nodes", where=where, fix="--root")
                name = one.BrowseName.Name
                if one.NodeClass == ua.NodeClass.Variable:
                    group, _, last = name.rpartition(".")
                    found[group or folder, last] = _named(one.NodeId.to_string(), spaces)
                below.append((client.get_node(one.NodeId), name))
        level = below
    return found


def loops_of(
    found: Mapping[tuple[str, str], str], names: Mapping[str, str], sample_time: float
) -> list[dict[str, Any]]:
    """Return the loops of a tag map, one for each group that has a PV and an OP.

    ``names`` are what the control system calls ``pv``, ``op``, ``sp`` and ``mode``.
    """
    key_of = {name.casefold(): key for key, name in names.items()}
    groups: dict[str, dict[str, str]] = {}
    for (group, name), node in found.items():
        if name.casefold() in key_of:
            groups.setdefault(group, {})[key_of[name.casefold()]] = node
    loops, taken = [], set()
    for group, tags in sorted(groups.items()):
        name = re.sub(r"\W+", "_", group, flags=re.ASCII).strip("_")
        name = name if name[:1].isalpha() else f"L{name}"
        if not {"pv", "op"} <= set(tags) or name in taken:
            continue
        taken.add(name)
        output = {"name": "PV1", "pv": tags["pv"]} | ({"sp": tags["sp"]} if "sp" in tags else {})
        valve = {"name": "V1", "op_read": tags["op"]}
        valve |= {"mode": tags["mode"]} if "mode" in tags else {}
        loops.append(
            {"loop": name, "sample_time": sample_time, "outputs": [output], "valves": [valve]}
        )
    return loops


def _named(node: str, spaces: list[str]) -> str:
    """Return a node id with the name of its namespace, as its number may change."""
    match = re.match(r"ns=(\d+);", node)
    if match is None or int(match[1]) >= len(spaces):
        return node
    return f"nsu={spaces[int(match[1])]};{node[match.end() :]}"
