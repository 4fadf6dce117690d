"""The network side: one OPC UA session in a thread of its own, subscribed, and reconnected."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from stiction_ros.errors import InputError
from stiction_ros.opcua.loop_bridge import WriteOrder
from stiction_ros.opcua.reading import TagReading
from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.session import (
    ANSWER,
    describe,
    kinds_of,
    node_ids,
    open_client,
    reading_of,
    write,
)

if TYPE_CHECKING:
    from asyncua import Client, ua

KEEP_ALIVE = 1.0  # s after which a server that has nothing to tell says that it lives
SILENCE = 3.5  # s without a word after which the server is given up
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 5.0  # s between two attempts to connect
QUEUE = 100  # changes of one tag that the server keeps between two publications
ROOM = 200_000  # changes that wait here


@dataclasses.dataclass(frozen=True)
class LinkSettings:
    """Where to, how, and what is heard there.

    Attributes:
        url: of the server.
        credentials: of the session.
        tags: that are subscribed to.
        written: tags that may be written; empty for none.
        publishing: s between two publications of the server.
    """

    url: str
    credentials: Credentials
    tags: tuple[str, ...]
    written: tuple[str, ...] = ()
    publishing: float = 0.1


@dataclasses.dataclass(frozen=True, slots=True)
class Heard:
    """A tag was reported at ``at``, s of ``time.monotonic``."""

    tag: str
    reading: TagReading
    at: float


@dataclasses.dataclass(frozen=True, slots=True)
class Linked:
    """The session was opened or lost, and why."""

    connected: bool
    reason: str


@dataclasses.dataclass(frozen=True, slots=True)
class Written:
    """What became of an order: why it failed (empty: it did not), and the s that it took."""

    order: WriteOrder
    failure: str
    seconds: float


LinkEvent = Heard | Linked | Written


class PlantLink:
    """Connects, subscribes, reconnects, and writes what it is told to, until it is stopped.

    Every method but the private ones may be called from any thread. What happens waits in a
    queue until :meth:`drain`; ``wake`` is called (in the link's thread) when something came.
    """

    def __init__(self, settings: LinkSettings, wake: Callable[[], None] | None = None) -> None:
        """Prepare; :meth:`start` connects."""
        self.settings = settings
        self._wake = wake or (lambda: None)
        self._events: deque[LinkEvent] = deque()
        self._heard_at = float("-inf")
        self._connected = False
        self._stop = asyncio.Event()
        self._orders: asyncio.Queue[WriteOrder] = asyncio.Queue()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._thread: threading.Thread | None = None
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # its lines may hold user names

    def start(self) -> None:
        """Begin to connect."""
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="opcua", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close the session; what waits to be written before it is written first."""
        if self._loop is None or self._thread is None:
            return
        with contextlib.suppress(RuntimeError):  # the loop has ended by itself
            self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(2 * ANSWER)

    def submit(self, orders: Sequence[WriteOrder]) -> None:
        """Write, one order after the other."""
        if self._loop is not None and self._thread is not None and self._thread.is_alive():
            for order in orders:
                self._loop.call_soon_threadsafe(self._orders.put_nowait, order)

    def drain(self) -> list[LinkEvent]:
        """Return what has happened since the last call, in its order."""
        return [self._events.popleft() for _ in range(len(self._events))]

    def alive(self, now: float) -> bool:
        """Return whether the server was heard lately; ``now`` of ``time.monotonic``."""
        return self._connected and now - self._heard_at < SILENCE

    # ---- the thread ------------------------------------------------------------------------

    def _run(self) -> None:
        assert self._loop is not None
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._keep_connected())
        finally:
            self._loop.close()

    async def _keep_connected(self) -> None:
        pause = FIRST_PAUSE
        while not self._stop.is_set():
            reason = await self._attempt()
            if self._connected:
                pause = FIRST_PAUSE
            self._connected = False
            self._tell(Linked(False, reason))
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stop.wait(), pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    async def _attempt(self) -> str:
        """Hold one session for as long as it lasts; return why it ended."""
        from asyncua import ua

        try:
            client = await open_client(self.settings.url, self.settings.credentials)
        except (OSError, TimeoutError, InputError, ua.UaError) as error:
            return describe(error)
        except Exception as error:  # of the certificates' library, whose errors share no base
            return f"no session could be opened: {type(error).__name__}"
        try:
            return await self._session(client)
        except (OSError, TimeoutError, InputError, ua.UaError) as error:
            return describe(error)
        except Exception as error:  # whatever a server sends, it must not end the bridge
            return f"the session failed: {type(error).__name__}"
        finally:
            with contextlib.suppress(OSError, TimeoutError, ua.UaError):
                await asyncio.wait_for(client.disconnect(), ANSWER)

    async def _session(self, client: Client) -> str:
        resolve = await node_ids(client, (*self.settings.tags, *self.settings.written))
        kinds = await kinds_of(client, {tag: resolve[tag] for tag in self.settings.written})
        self._forget_orders()
        self._heard_at = time.monotonic()
        subscription = await self._subscribe(client, resolve)
        self._connected = True
        self._tell(Linked(True, f"connected to {self.settings.url}"))
        listening = asyncio.create_task(self._listen(subscription, resolve))
        writing = asyncio.create_task(self._write_orders(client, resolve, kinds))
        watching = asyncio.create_task(self._watch(client, subscription))
        stopping = asyncio.create_task(self._stop.wait())
        tasks = (listening, writing, watching, stopping)
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if stopping.done():
                await self._write_the_rest(writing)
                return "stopped"
            for task in (listening, writing, watching):
                if task.done():
                    return str(task.result())
            return "ended"
        finally:
            for one in tasks:
                one.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _subscribe(self, client: Client, resolve: dict[str, ua.NodeId]) -> Any:
        from asyncua import ua

        interval = 1000.0 * self.settings.publishing
        wanted = ua.CreateSubscriptionParameters(
            RequestedPublishingInterval=interval,
            RequestedLifetimeCount=10_000,
            RequestedMaxKeepAliveCount=max(round(1000.0 * KEEP_ALIVE / interval), 1),
            MaxNotificationsPerPublish=0,
            PublishingEnabled=True,
            Priority=0,
        )
        subscription = await client.create_subscription(wanted, queue_maxsize=ROOM)
        nodes = [client.get_node(resolve[tag]) for tag in self.settings.tags]
        found = await subscription.subscribe_data_change(
            nodes, queuesize=QUEUE, sampling_interval=interval / 2
        )
        for tag, handle in zip(self.settings.tags, found, strict=True):
            if isinstance(handle, ua.StatusCode):
                raise InputError(f"is refused ({handle.name})", where=f"tag {tag}")
        return subscription

    async def _listen(self, subscription: Any, resolve: dict[str, ua.NodeId]) -> str:
        """Hand on every change; the first of each tag tells the present."""
        from asyncua.common.subscription import DataChangeEvent

        tags: dict[ua.NodeId, list[str]] = {}
        for tag in self.settings.tags:
            tags.setdefault(resolve[tag], []).append(tag)
        seen: set[str] = set()
        async for event in subscription:
            self._heard_at = now = time.monotonic()
            if not isinstance(event, DataChangeEvent):
                return "the server ended the subscription"
            value = event.data.monitored_item.Value
            for tag in tags[event.node.nodeid]:
                self._events.append(Heard(tag, reading_of(value, tag not in seen), now))
                seen.add(tag)
            self._wake()
        return "the subscription ended"

    async def _watch(self, client: Client, subscription: Any) -> str:
        """Return when the session is lost, or the server says nothing any more."""
        from asyncua.client.ua_client import UaClientState

        while client.state is UaClientState.CONNECTED:
            if subscription.last_publish_at is not None:
                self._heard_at = max(self._heard_at, subscription.last_publish_at)
            if time.monotonic() - self._heard_at > SILENCE:
                return f"nothing was heard for {SILENCE:g} s"
            await asyncio.sleep(0.05)
        return "the connection was lost"

    # ---- writing ---------------------------------------------------------------------------

    async def _write_orders(
        self, client: Client, resolve: dict[str, ua.NodeId], kinds: dict[str, ua.VariantType]
    ) -> str:
        while True:
            order = await self._orders.get()
            begin = time.monotonic()
            try:
                failure = await write(client, order, resolve, kinds)
            finally:
                self._orders.task_done()
            self._tell(Written(order, failure, time.monotonic() - begin))

    async def _write_the_rest(self, writing: asyncio.Task[str]) -> None:
        """Let what waits be written before the end, as a request that is taken back."""
        rest = asyncio.create_task(self._orders.join())
        await asyncio.wait((rest, writing), timeout=ANSWER, return_when=asyncio.FIRST_COMPLETED)
        rest.cancel()

    def _forget_orders(self) -> None:
        """Drop what was to be written in a session that is gone."""
        while not self._orders.empty():
            order = self._orders.get_nowait()
            self._orders.task_done()
            self._tell(Written(order, "the connection was lost", 0.0))

    def _tell(self, event: LinkEvent) -> None:
        self._events.append(event)
        self._wake()
