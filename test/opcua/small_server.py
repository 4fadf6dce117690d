"""A server in a thread with the variables that a test names; without security, on 127.0.0.1."""

import asyncio
import logging
import socket
import threading
from collections.abc import Coroutine
from typing import Any

from asyncua import Server, ua

SPACE = "urn:small"


class SmallServer:
    """Serves variables of the namespace ``SPACE``, which has number 2 here."""

    def __init__(self, **values: tuple[Any, str]) -> None:
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.url = f"opc.tcp://127.0.0.1:{probe.getsockname()[1]}/small"
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._call(self._start(values))

    def add(self, name: str, value: Any, kind: str) -> None:
        self._call(self._add(name, value, kind))

    def put(self, name: str, value: Any, kind: str) -> None:
        told = ua.DataValue(ua.Variant(value, ua.VariantType[kind]))
        self._call(self._server.write_attribute_value(ua.NodeId(name, 2), told))

    def value(self, name: str) -> Any:
        return self._call(self._server.get_node(ua.NodeId(name, 2)).read_value())

    def close(self) -> None:
        self._call(self._server.stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(30.0)
        self._loop.close()

    def _call(self, work: Coroutine[Any, Any, Any]) -> Any:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(30.0)

    async def _start(self, values: dict[str, tuple[Any, str]]) -> None:
        self._server = Server()
        await self._server.init()
        self._server.set_endpoint(self.url)
        self._server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        assert await self._server.register_namespace(SPACE) == 2
        for name, (value, kind) in values.items():
            await self._add(name, value, kind)
        await self._server.start()

    async def _add(self, name: str, value: Any, kind: str) -> None:
        node, title = ua.NodeId(name, 2), ua.QualifiedName(name, 2)
        made = await self._server.nodes.objects.add_variable(
            node, title, value, ua.VariantType[kind]
        )
        await made.set_writable()
