"""The network side: one OPC UA session in a thread of its own, subscribed, and reconnected."""

import asyncio
import contextlib
import dataclasses
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from stiction_ros.errors import InputError
from stiction_ros.online.plain_settings import NodeSettings
from stiction_ros.opcua.loop_bridge import WriteOrder
from stiction_ros.opcua.sampling import TagReading
from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.server_tags import ServerTags
from stiction_ros.opcua.session import ANSWER, describe, is_open, open_client, reading_of, write
from stiction_ros.opcua.tag_map import Use
from stiction_ros.settings import setting

if TYPE_CHECKING:
    from asyncua import Client

KEEP_ALIVE = 1.0  # s after which a server that has nothing to tell says that it lives
SILENCE = 3.5  # s without a word after which the server is given up
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 5.0  # s between two attempts to connect
LOST = "the connection was lost"
ASKED_AGAIN = 60.0  # s until tags that the server refuses are tried again
ROOM = 200_000  # changes that wait here


@dataclasses.dataclass(frozen=True)
class OpcuaNodeSettings(NodeSettings, Credentials):
    """Which control system is listened to, how, and what may be written there."""

    tags: str = setting("", "tag map, *.tags.yaml", fixed=True)
    url: str = setting(
        "", "address of the server, opc.tcp://HOST:PORT; empty for that of the tag map", fixed=True
    )
    loops: tuple[str, ...] = setting((), "loops of the tag map; empty for all", fixed=True)
    publishing: float = setting(
        0.1, "s between two publications of the server", low=0.005, high=60.0, fixed=True
    )
    write: tuple[str, ...] = setting(
        (), "loops whose OP may be written while the plant grants it; empty for none", fixed=True
    )
    ask: str = setting(
        "service",
        "when the grant is asked for: by the service ask_grant of the loop, or once at the start",
        choices=("service", "start"),
        fixed=True,
    )
    commander: str = setting(
        "controller",
        "the only node whose op is written, as it names itself in frame_id; without a leading "
        "slash in the loop's namespace",
        fixed=True,
    )
    speed: float = setting(
        1.0,
        "seconds of the plant per second, other than 1 for a simulated one",
        low=1e-3,
        high=1e6,
        fixed=True,
    )


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


@dataclasses.dataclass(frozen=True, slots=True)
class Refused:
    """Tags that the server refuses now, each with why."""

    tags: Mapping[str, str]


LinkEvent = Heard | Linked | Written | Refused


class PlantLink:
    """Connects, subscribes, reconnects, and writes what it is told to, until it is stopped.

    Every method but the private ones may be called from any thread. What happens waits in a
    queue until :meth:`drain`; ``wake`` is called (in the link's thread) when something came.
    """

    def __init__(
        self,
        settings: OpcuaNodeSettings,
        read: Sequence[str],
        written: Mapping[str, Use],
        wake: Callable[[], None] | None = None,
    ) -> None:
        """Prepare; :meth:`start` connects. ``written`` says what each tag is written for."""
        self.settings = settings
        self._tags = (read, written)
        self._sampling = 500.0 * settings.publishing  # ms between two looks of the server at a tag
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
        """Write, one order after the other; a request goes before all that its loop waits for."""
        if self._loop is not None and self._thread is not None and self._thread.is_alive():
            for order in orders:
                self._loop.call_soon_threadsafe(self._put, order)

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

        client = None
        try:
            client = await open_client(self.settings.url, self.settings)
            return await self._session(client)
        except (OSError, TimeoutError, InputError, ua.UaError) as error:
            return describe(error)
        except Exception as error:  # whatever server or certificate brings must not end the bridge
            return f"the session failed: {type(error).__name__}"
        finally:
            if client is not None:
                with contextlib.suppress(OSError, TimeoutError, ua.UaError):
                    await asyncio.wait_for(client.disconnect(), ANSWER)

    async def _session(self, client: "Client") -> str:
        tags = ServerTags(client, *self._tags)
        self._orders = asyncio.Queue()  # what was to be written in a session that is gone is not
        self._heard_at = time.monotonic()
        subscription = await self._subscribe(client)
        await tags.ask(subscription, self._sampling)
        self._tell(Refused(tags.refused))
        self._connected = True
        self._tell(Linked(True, f"connected to {self.settings.url}"))
        listening = asyncio.create_task(self._listen(subscription, tags))
        writing = asyncio.create_task(self._write_orders(client, tags))
        watching = asyncio.create_task(self._watch(client, subscription))
        mending = asyncio.create_task(self._ask_again(subscription, tags))
        stopping = asyncio.create_task(self._stop.wait())
        tasks = (listening, writing, watching, mending, stopping)
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            if stopping.done():
                await self._write_the_rest(writing)
                return "stopped"
            told = [str(task.result()) for task in tasks[:-1] if task.done()]
            return told[0] if is_open(client) else LOST
        finally:
            for one in tasks:
                one.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _ask_again(self, subscription: Any, tags: ServerTags) -> str:
        """Try refused tags again from time to time: somebody may mend them at the server."""
        while True:
            await asyncio.sleep(ASKED_AGAIN)
            before = tags.refused
            if before:
                await tags.ask(subscription, self._sampling)
            if tags.refused != before:
                self._tell(Refused(tags.refused))

    async def _subscribe(self, client: "Client") -> Any:
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
        return await client.create_subscription(wanted, queue_maxsize=ROOM)

    async def _listen(self, subscription: Any, tags: ServerTags) -> str:
        """Hand on every change; the first of each tag tells the present."""
        from asyncua.common.subscription import DataChangeEvent

        seen: set[str] = set()
        async for event in subscription:
            self._heard_at = now = time.monotonic()
            if not isinstance(event, DataChangeEvent):
                return "the server ended the subscription"
            value = event.data.monitored_item.Value
            for tag in tags.names.get(event.node.nodeid, []):
                self._events.append(Heard(tag, reading_of(value, tag not in seen), now))
                seen.add(tag)
            self._wake()
        return "the subscription ended"

    async def _watch(self, client: "Client", subscription: Any) -> str:
        """Return when the session is lost, or the server says nothing any more."""
        from asyncua.client.ua_client import UaClientState

        while client.state is UaClientState.CONNECTED:
            if subscription.last_publish_at is not None:
                self._heard_at = max(self._heard_at, subscription.last_publish_at)
            if time.monotonic() - self._heard_at > SILENCE:
                return f"nothing was heard for {SILENCE:g} s"
            await asyncio.sleep(0.05)
        return LOST

    # ---- writing ---------------------------------------------------------------------------

    async def _write_orders(self, client: "Client", tags: ServerTags) -> str:
        while True:
            order = await self._orders.get()
            begin = time.monotonic()
            try:
                failure = await write(client, order, tags.nodes, tags.kinds)
            finally:
                self._orders.task_done()
            self._tell(Written(order, failure, time.monotonic() - begin))

    def _put(self, order: WriteOrder) -> None:
        """Queue an order; what its loop wanted before a request is not written any more."""
        if order.kind is Use.REQUEST:
            waiting = [self._orders.get_nowait() for _ in range(self._orders.qsize())]
            for one in waiting:
                self._orders.task_done()
                if one.loop == order.loop and one.kind is not Use.REQUEST:
                    self._tell(Written(one, "a request came after it", 0.0))
                else:
                    self._orders.put_nowait(one)
        self._orders.put_nowait(order)

    async def _write_the_rest(self, writing: asyncio.Task[str]) -> None:
        """Let what waits be written before the end, as a request that is taken back."""
        rest = asyncio.create_task(self._orders.join())
        await asyncio.wait((rest, writing), timeout=ANSWER, return_when=asyncio.FIRST_COMPLETED)
        rest.cancel()

    def _tell(self, event: LinkEvent) -> None:
        self._events.append(event)
        self._wake()
