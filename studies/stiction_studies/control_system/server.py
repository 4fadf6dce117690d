"""The OPC UA server of the simulated plant: tags, users and their rights, history, faults."""

import asyncio
import contextlib
import dataclasses
import datetime
import hmac
import json
import logging
import time
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from asyncua import Server, ua
from asyncua.common.callback import CallbackType
from asyncua.common.utils import ServiceError
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.crypto.truststore import TrustStore
from asyncua.crypto.validator import CertificateValidator, CertificateValidatorOptions

from stiction_ros.opcua.session import EPOCH
from stiction_studies.control_system.control_system import ControlSystem
from stiction_studies.control_system.tags import NAMESPACE, REMOTE_USE, SERVER_URI, PlantTags

PAGE = 5000  # values of history in one answer


@dataclasses.dataclass(frozen=True)
class Account:
    """A user: its password, and the kinds of tags that it may write."""

    password: str = dataclasses.field(repr=False)
    writes: frozenset[str] = frozenset()


@dataclasses.dataclass(frozen=True)
class ServerSettings:
    """How the server is reached.

    Attributes:
        port: on 127.0.0.1.
        certificate, private_key: of the server.
        trusted: folder of the clients' certificates that are let in.
        accounts: users by name.
        speed: seconds of the plant per second of the wall clock.
        start: the plant's time at the first sample, ns.
        journal: file of all that happened, JSON lines; None for none.
        history: whether values are kept for clients that read history.
    """

    port: int
    certificate: Path
    private_key: Path
    trusted: Path
    accounts: Mapping[str, Account]
    speed: float
    start: int
    journal: Path | None = None
    history: bool = False


class _Users:
    """Knows the accounts; nobody comes in without one."""

    def __init__(self, accounts: Mapping[str, Account]) -> None:
        self._accounts = accounts

    def get_user(
        self, _server: Any, username: Any = None, password: Any = None, certificate: Any = None
    ) -> User | None:
        account = self._accounts.get(username or "")
        given = password.encode() if isinstance(password, str) else bytes(password or b"")
        if account is None or not hmac.compare_digest(account.password.encode(), given):
            return None
        return User(role=UserRole.User, name=username)


class PlantServer:
    """Runs a :class:`ControlSystem` behind OPC UA until it is told to stop."""

    def __init__(self, system: ControlSystem, settings: ServerSettings) -> None:
        """Prepare; :meth:`run` serves."""
        self.system, self.settings = system, settings
        self.tags = PlantTags(system.model)
        self._server: Any = None
        self._period = system.model.sample_time / settings.speed
        self._tick_at = 0.0
        self._nodes: dict[str, ua.NodeId] = {}
        self._names: dict[ua.NodeId, str] = {}
        self._faults: dict[str, float] = dict.fromkeys(self.tags.faults, 0.0)
        self._alive = 0
        self._mode = ""
        self._journal: IO[str] | None = None
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)

    async def run(self, stop: asyncio.Event) -> None:
        """Serve and scan until ``stop``."""
        with contextlib.ExitStack() as stack:
            if self.settings.journal is not None:
                file = self.settings.journal.open("a", encoding="utf-8")
                self._journal = stack.enter_context(file)
            await self._build()
            async with self._server:
                print(f"listening on {self.settings.port}", flush=True)
                await self._scan_until(stop)

    async def _build(self) -> None:
        settings = self.settings
        self._server = server = Server(user_manager=_Users(settings.accounts))
        await server.init()
        await server.set_application_uri(SERVER_URI)
        server.set_endpoint(f"opc.tcp://127.0.0.1:{settings.port}/plant")
        server.set_server_name("stiction_ros simulated plant")
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        server.set_identity_tokens([ua.UserNameIdentityToken])
        await server.load_certificate(settings.certificate)
        await server.load_private_key(settings.private_key)
        store = TrustStore([settings.trusted], [])
        await store.load()
        options = (
            CertificateValidatorOptions.TRUSTED_VALIDATION | CertificateValidatorOptions.PEER_CLIENT
        )
        server.set_certificate_validator(CertificateValidator(options, store))
        space = await server.register_namespace(NAMESPACE)
        for tag in self.tags.all:
            node = ua.NodeId(tag.name, space)
            kind = ua.VariantType[tag.kind]
            made = await server.nodes.objects.add_variable(
                node, ua.QualifiedName(tag.name, space), tag.initial, kind
            )
            if tag.writers:
                await made.set_writable()
            self._nodes[tag.name], self._names[node] = node, tag.name
        if settings.history:
            server.iserver.history_manager.storage.max_history_data_response_size = PAGE
        server.subscribe_server_callback(CallbackType.PreRead, self._before_read)
        server.subscribe_server_callback(CallbackType.PreWrite, self._before_write)
        server.subscribe_server_callback(CallbackType.PostWrite, self._after_write)

    # ---- scanning --------------------------------------------------------------------------

    async def _scan_until(self, stop: asyncio.Event) -> None:
        self._tick_at = time.monotonic()
        await self._show()
        await self._keep_history()
        due = self._tick_at + self._period
        while not stop.is_set():
            await self._rest(due - self._period / 2, stop)
            self.system.half_over()
            await self._rest(due, stop)
            await self._burst(int(self._faults["FAULT.BURST"]))
            now = time.monotonic()
            self.system.scan(now)
            self._tick_at = now
            await self._show()
            missed = max(int((now - due) / self._period), 0)
            due += (missed + 1) * self._period

    async def _keep_history(self) -> None:
        """Keep what comes from now on: before it the tags had values that nobody measured."""
        if self.settings.history:
            for tag in self.tags.all:
                if tag.history:
                    node = self._server.get_node(self._nodes[tag.name])
                    await self._server.historize_node_data_change(node, None, 0)

    async def _burst(self, count: int) -> None:
        """Let each PV change ``count`` times more within the sample that ends."""
        step = round(self.system.model.sample_time * 1e9)
        begin = self.settings.start + self.system.sample * step
        for i in range(1, count + 1):
            stamp = begin + i * step // (count + 1)
            for name, value in zip(self.tags.pv, self.system.pv, strict=True):
                await self._put(name, float(value) + 1e-6 * i, stamp)

    async def _rest(self, until: float, stop: asyncio.Event) -> None:
        seconds = until - time.monotonic()
        if seconds > 0:
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), seconds)
        else:
            await asyncio.sleep(0)

    def _stamp(self) -> int:
        """Return the plant's time, ns; within a sample it goes on with the wall clock."""
        step = round(self.system.model.sample_time * 1e9)
        spent = (time.monotonic() - self._tick_at) * self.settings.speed * 1e9
        inside = min(round(spent), step - 1) if self._tick_at else 0
        return self.settings.start + self.system.sample * step + inside

    async def _show(self) -> None:
        """Write what a scan has found to the tags, all with the scan's stamp."""
        system, tags = self.system, self.tags
        stamp = self.settings.start + system.sample * round(system.model.sample_time * 1e9)
        faults = self._faults
        good = ua.StatusCodes.BadSensorFailure if faults["FAULT.QUALITY"] else ua.StatusCodes.Good
        past = round(faults["FAULT.PAST"] * 1e9)
        for name, value in zip(tags.pv, system.pv, strict=True):
            await self._put(name, float(value), stamp - past, good)
        for name, value in zip(tags.sp, system.sp, strict=True):
            await self._put(name, float(value), stamp)
        if not faults["FAULT.ALIVE"]:
            self._alive += 1
        await self._put("LOOP.ALIVE", self._alive, stamp)
        await self._show_outputs(stamp)

    async def _show_outputs(self, stamp: int) -> None:
        system, tags = self.system, self.tags
        for name, value in zip(tags.out, system.out, strict=True):
            await self._put(name, float(value), stamp)
        for name in tags.mode:
            await self._put(name, system.mode, stamp)
        await self._put("LOOP.ALARM", system.alarm, stamp)
        if system.mode != self._mode:
            self._mode = system.mode
            self._note("mode", mode=system.mode, alarm=system.alarm, stamp=stamp)
        self._note("out", out=[float(v) for v in system.out], stamp=stamp, mode=system.mode)

    async def _put(
        self, name: str, value: Any, stamp: int, status: int = ua.StatusCodes.Good
    ) -> None:
        tag = self.tags.by_name[name]
        moment = EPOCH + datetime.timedelta(microseconds=stamp // 1000)
        await self._server.write_attribute_value(
            self._nodes[name],
            ua.DataValue(
                ua.Variant(value, ua.VariantType[tag.kind]),
                ua.StatusCode(status),
                SourceTimestamp=moment,
                ServerTimestamp=datetime.datetime.now(datetime.UTC),
            ),
        )

    # ---- clients ---------------------------------------------------------------------------

    async def _before_read(self, event: Any, _service: Any) -> None:
        if event.is_external and self._faults["FAULT.DELAY"]:
            await asyncio.sleep(self._faults["FAULT.DELAY"])

    async def _before_write(self, event: Any, _service: Any) -> None:
        """Refuse what the user may not write, and remote OPs that no mode grants."""
        if not event.is_external:
            return
        written = [self._names.get(one.NodeId, "") for one in event.request_params.NodesToWrite]
        if self._faults["FAULT.DELAY"] and not any(n.startswith("FAULT") for n in written):
            await asyncio.sleep(self._faults["FAULT.DELAY"])
        account = self.settings.accounts[event.user.name]
        for name in written:
            tag = self.tags.by_name.get(name)
            taken = self._faults["FAULT.RIGHTS"] and tag is not None and REMOTE_USE in tag.writers
            if tag is None or taken or not tag.writers & account.writes:
                self._note("denied", tag=name, user=event.user.name)
                raise ServiceError(ua.StatusCodes.BadUserAccessDenied)
        self.system.watch(time.monotonic())
        if any(name in self.tags.remote for name in written) and self.system.mode != "ROUT":
            self._note("refused", user=event.user.name, mode=self.system.mode)
            raise ServiceError(ua.StatusCodes.BadNotWritable)

    async def _after_write(self, event: Any, _service: Any) -> None:
        if not event.is_external:
            return
        now = time.monotonic()
        remote: dict[int, float] = {}
        for one in event.request_params.NodesToWrite:
            name, value = self._names[one.NodeId], one.Value.Value.Value
            if name in self.tags.remote:
                remote[self.tags.remote.index(name)] = float(value)
            elif name == "LOOP.REQUEST":
                self.system.ask(bool(value))
            elif name == "LOOP.BEAT":
                self.system.beat(float(value), now)
            elif name == "LOOP.TARGET":
                why_not = self.system.target(str(value), now)
                self._note("target", target=str(value), why_not=why_not)
            elif name in self._faults:
                self._faults[name] = float(value)
            await self._put(name, value, self._stamp())
        if remote:
            taken = self.system.write(list(remote), list(remote.values()))
            self._note("op", op=list(remote.values()), taken=taken, user=event.user.name)
        await self._show_outputs(self._stamp())

    def _note(self, event: str, **values: Any) -> None:
        if self._journal is not None:
            line = {"event": event, "wall": time.monotonic(), "sample": self.system.sample}
            self._journal.write(json.dumps(line | values) + "\n")
            self._journal.flush()
