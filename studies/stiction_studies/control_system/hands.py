"""A session of one user of the simulated plant: the operator, or who puts faults into it."""

import asyncio
import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.session import ANSWER, node_ids, open_client
from stiction_studies.control_system.tags import NAMESPACE

if TYPE_CHECKING:
    from asyncua import Client, ua

PATIENCE = 5 * ANSWER  # s for everything that one call asks the server


class PlantHand:
    """Writes tags of the plant as one user; the session stays open from one call to the next."""

    def __init__(self, url: str, credentials: Credentials) -> None:
        """Prepare; the first :meth:`write` opens the session."""
        self._url, self._credentials = url, credentials
        self._client: Client | None = None
        self._nodes: dict[str, ua.NodeId] = {}
        self._kinds: dict[str, ua.VariantType] = {}
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, name="hand", daemon=True)
        self._thread.start()

    def write(self, values: Mapping[str, Any]) -> None:
        """Write tags by name, each in a call of its own; raises what the server answers."""
        asyncio.run_coroutine_threadsafe(self._write(values), self._loop).result(PATIENCE)

    def close(self) -> None:
        """End the session."""
        try:
            asyncio.run_coroutine_threadsafe(self._drop(), self._loop).result(PATIENCE)
        finally:
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(PATIENCE)
            self._loop.close()

    async def _write(self, values: Mapping[str, Any]) -> None:
        from asyncua import ua

        client = await self._session()
        tags = {name: f"nsu={NAMESPACE};s={name}" for name in values}
        new = {name: tag for name, tag in tags.items() if name not in self._nodes}
        if new:
            found = await node_ids(client, list(new.values()))
            nodes = {name: found[tag] for name, tag in new.items()}
            for tag, node in nodes.items():
                self._kinds[tag] = await client.get_node(node).read_data_type_as_variant_type()
            self._nodes |= nodes
        for name, value in values.items():
            told = ua.DataValue(ua.Variant(value, self._kinds[name]))
            await client.get_node(self._nodes[name]).write_value(told)

    async def _session(self) -> "Client":
        from asyncua.client.ua_client import UaClientState

        if self._client is not None and self._client.state is not UaClientState.CONNECTED:
            await self._drop()
        if self._client is None:
            self._client = await open_client(self._url, self._credentials)
        return self._client

    async def _drop(self) -> None:
        from asyncua import ua

        client, self._client = self._client, None
        if client is not None:
            try:
                await asyncio.wait_for(client.disconnect(), ANSWER)
            except (OSError, TimeoutError, ua.UaError):
                return  # the server is gone, and the session with it
