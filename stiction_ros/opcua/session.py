"""One session with a server: opened by credentials, read, written, its errors in words."""

import asyncio
import datetime
import logging
import socket
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from stiction_ros.errors import InputError
from stiction_ros.opcua import security
from stiction_ros.opcua.loop_bridge import MODE_REFUSES, WriteOrder, all_grant
from stiction_ros.opcua.sampling import TagQuality, TagReading, quality_of

if TYPE_CHECKING:
    from asyncua import Client, ua
    from cryptography import x509

ANSWER = 6.0  # s for which an answer of the server is waited for
LOOK, CLOSED = 0.1, 3  # s between looks at a connection; looks at which it may be closed
PROBE = 5.0  # s between two questions whether the server still answers
SAID = {
    ConnectionRefusedError: "nobody listens at that address",
    ConnectionResetError: "the server closes the connection",
    socket.gaierror: "no machine of that name is known",
}
EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)


async def open_client(url: str, credentials: security.Credentials) -> "Client":
    """Return a client with an active session, as the credentials ask for.

    Raises:
        InputError: files that cannot be used, or certificates that have expired.
        OSError, TimeoutError, asyncua.ua.UaError: as whatever asks the server.
    """
    from asyncua import Client, ua
    from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256

    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    client = Client(url, timeout=ANSWER, watchdog_intervall=PROBE)
    client.application_uri = security.CLIENT_URI
    client.name = client.description = "stiction_ros"
    if credentials.security != "none":
        for path in (credentials.certificate, credentials.server_certificate):
            security.check_dates(security.load_certificate(Path(path)), path)
        await client.set_security(
            SecurityPolicyBasic256Sha256,
            certificate=Path(credentials.certificate),
            private_key=Path(credentials.private_key),
            server_certificate=Path(credentials.server_certificate),
            mode=ua.MessageSecurityMode.SignAndEncrypt,
        )
    if credentials.user:
        client.set_user(credentials.user)
        client.set_password(credentials.password())
    try:
        await asyncio.wait_for(_connect(client), 2 * ANSWER)
    except TimeoutError:  # a server cannot read, and does not answer, what is not for its key
        if credentials.security != "none":
            await _compare(url, Path(credentials.server_certificate))
        raise
    return client


def is_open(client: "Client") -> bool:
    """Return whether the connection of a client stands."""
    from asyncua.client.ua_client import UASocketState

    protocol = client.uaclient.protocol
    return protocol is not None and protocol.state is not UASocketState.CLOSED


async def shown_certificate(url: str) -> "x509.Certificate | None":
    """Return what a server shows for signed and encrypted sessions; None where it has none."""
    from asyncua import Client, ua
    from asyncua.crypto.uacrypto import x509_from_der

    for point in await Client(url, timeout=ANSWER).connect_and_get_server_endpoints():
        secured = point.SecurityMode == ua.MessageSecurityMode.SignAndEncrypt
        if secured and point.SecurityPolicyUri.endswith("#Basic256Sha256"):
            found: x509.Certificate = x509_from_der(point.ServerCertificate)
            return found
    return None


async def _compare(url: str, pinned: Path) -> None:
    """Raise InputError when the server shows another certificate than the pinned one."""
    from asyncua import ua

    try:
        shown = await shown_certificate(url)
    except (OSError, TimeoutError, ua.UaError):
        return  # it does not tell
    if shown is not None and security.fingerprint(shown) != security.fingerprint(
        security.load_certificate(pinned)
    ):
        raise InputError(
            f"is not what the server shows now ({security.fingerprint(shown)[:23]}…)",
            where=str(pinned),
            fix="ask the control engineer, then pin it again",
        )


async def _connect(client: "Client") -> None:
    """Connect; a connection that the other side has closed is not waited for."""
    opening, closed = asyncio.create_task(client.connect()), 0
    try:
        while not opening.done() and closed < CLOSED:
            await asyncio.wait((opening,), timeout=LOOK)
            closed += client.uaclient.protocol is not None and not is_open(client)
    finally:
        opening.cancel()  # nothing where it is done
    if not opening.done():
        raise ConnectionError("the server closes the connection")
    error = opening.exception()
    if type(error) is ConnectionError:  # the library's own, for a connection that went away
        raise ConnectionError("the server closes the connection") from error
    opening.result()


async def node_ids(client: "Client", tags: Sequence[str]) -> "dict[str, ua.NodeId]":
    """Return the node id of each tag by :func:`node_id`."""
    spaces = await client.get_namespace_array()
    return {tag: node_id(tag, spaces) for tag in dict.fromkeys(tags)}


def node_id(tag: str, spaces: Sequence[str]) -> "ua.NodeId":
    """Return the node id of a tag, ``nsu=URI;`` looked up in the server's namespaces.

    Raises:
        InputError: a namespace that the server does not have, or no node id.
    """
    from asyncua import ua

    text = tag
    if tag.startswith("nsu="):
        uri, _, rest = tag[4:].partition(";")
        if uri not in spaces:
            raise InputError(f"is of no namespace of the server, {uri}", where=f"tag {tag}")
        text = f"ns={spaces.index(uri)};{rest}"
    try:
        return ua.NodeId.from_string(text)
    except ua.UaError:
        raise InputError("is no node id", where=f"tag {tag}") from None


def reading_of(value: "ua.DataValue | None", first: bool) -> TagReading:
    """Return what a data value says; the server's stamp serves where the source has none."""
    stamp = None if value is None else value.SourceTimestamp or value.ServerTimestamp
    if value is None or stamp is None:
        return TagReading(None, TagQuality.BAD, 0, first)
    stamp = stamp if stamp.tzinfo else stamp.replace(tzinfo=datetime.UTC)
    spent = stamp - EPOCH
    nanoseconds = (spent.days * 86_400 + spent.seconds) * 1_000_000_000 + spent.microseconds * 1000
    code = value.StatusCode.value if value.StatusCode is not None else 0
    content = value.Value.Value if value.Value is not None else None
    quality = quality_of(code)
    if not isinstance(content, bool | int | float | str):
        content, quality = None, max(quality, TagQuality.BAD)
    plain = content if isinstance(content, str) or content is None else float(content)
    return TagReading(plain, quality, nanoseconds, first)


def describe(error: BaseException) -> str:
    """Return an error of the network or of OPC UA in one line without secrets."""
    from asyncua import ua

    if isinstance(error, ua.UaStatusCodeError):
        return f"the server answers {ua.StatusCode(error.code).name}"
    if isinstance(error, TimeoutError):
        return "the server does not answer"
    for kind, words in SAID.items():
        if isinstance(error, kind):
            return words
    return " ".join(str(error).split()) or type(error).__name__


async def write(
    client: "Client",
    order: WriteOrder,
    resolve: "dict[str, ua.NodeId]",
    kinds: "dict[str, ua.VariantType]",
) -> str:
    """Write one order, if the modes still grant it; return why not, empty when it is written."""
    from asyncua import ua

    lacking = [tag for tag, _ in order.values if tag not in kinds]
    lacking += [mode for mode in order.modes if mode not in resolve]
    if lacking:
        return f"tag {lacking[0]} is refused"
    try:
        if order.modes:
            modes = await client.read_attributes([client.get_node(resolve[m]) for m in order.modes])
            if not all_grant((reading_of(one, first=True) for one in modes), order.granted):
                return MODE_REFUSES
        if time.monotonic() > order.expires:
            return "it came too late to be written"
        nodes = [resolve[tag] for tag, _ in order.values]
        values = [
            ua.DataValue(ua.Variant(_as_kind(value, kinds[tag]), kinds[tag]))
            for tag, value in order.values
        ]
        results = await client.uaclient.write_attributes(nodes, values, ua.AttributeIds.Value)
    except (OSError, TimeoutError, ua.UaError) as error:
        return describe(error)
    bad = next((result for result in results if not result.is_good()), None)
    return "" if bad is None else f"the server answers {bad.name}"


def _as_kind(value: float, kind: "ua.VariantType") -> bool | int | float:
    from asyncua import ua

    if kind is ua.VariantType.Boolean:
        return bool(value)
    if kind in (ua.VariantType.Float, ua.VariantType.Double):
        return float(value)
    return round(value)
