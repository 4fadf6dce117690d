"""``stiction certificates``: make our own, pin that of a server."""

import argparse
import asyncio
import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.errors import InputError, storing
from stiction_ros.opcua import require_asyncua

if TYPE_CHECKING:
    from cryptography import x509


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "certificates", description="Make our certificate and key, pin the certificate of a server."
    )
    actions = parser.add_subparsers(title="actions", metavar="ACTION", required=True)
    make = actions.add_parser("make", help="make a self-signed certificate and its key")
    make.add_argument("--out", required=True, metavar="DIR", help="folder of the two files")
    make.add_argument("--name", default="client", help="name of the files (default: client)")
    make.add_argument(
        "--uri", default="", help="URI of the application, by which the server knows it"
    )
    make.add_argument(
        "--host", action="append", default=[], help="host name or address; may be repeated"
    )
    make.add_argument("--days", type=int, default=365, help="days of validity (default: 365)")
    make.add_argument(
        "--server",
        action="store_true",
        help="make a certificate of a server (default: of a client)",
    )
    make.set_defaults(run=_make)
    pin = actions.add_parser(
        "pin",
        help="save the certificate of a server",
        description="Without --fingerprint show what the server shows; compare it with what the "
        "control engineer says; then save it by giving the fingerprint.",
    )
    pin.add_argument("url", help="address of the server, opc.tcp://HOST:PORT")
    pin.add_argument("--to", metavar="FILE", help="file to save, DER")
    pin.add_argument("--fingerprint", help="SHA-256, pairs of hexadecimal digits")
    pin.set_defaults(run=_pin)


def _make(options: argparse.Namespace) -> int:
    from stiction_ros.opcua.security import CLIENT_URI, Identity, load_certificate, make_certificate

    require_asyncua()
    if not 1 <= options.days <= 3650:
        raise InputError(f"{options.days} is out of range", where="--days", fix="use 1 to 3650")
    folder = Path(options.out)
    certificate, key = folder / f"{options.name}.der", folder / f"{options.name}.pem"
    now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
    identity = Identity(
        options.uri or CLIENT_URI,
        tuple(options.host) or ("127.0.0.1",),
        options.server,
        now,
        options.days,
    )
    make_certificate(identity, certificate, key)
    print(f"{certificate}\n{key} (keep it to yourself)")
    _describe(load_certificate(certificate))
    return 0


def _pin(options: argparse.Namespace) -> int:
    from stiction_ros.opcua.security import check_dates, fingerprint
    from stiction_ros.opcua.tag_map import check_address

    require_asyncua()
    check_address(options.url, "URL")
    if bool(options.to) != bool(options.fingerprint):
        raise InputError("--to and --fingerprint belong together", where="pin")
    found = asyncio.run(_certificate_of(options.url))
    _describe(found)
    if not options.to:
        print("compare the fingerprint; then pin it by --to FILE --fingerprint …")
        return 0
    given = options.fingerprint.replace(":", "").lower()
    if given != fingerprint(found).replace(":", ""):
        raise InputError("the server shows another certificate", where="--fingerprint")
    check_dates(found, options.url)
    from cryptography.hazmat.primitives.serialization import Encoding

    path = Path(options.to)
    with storing(options.to):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(found.public_bytes(Encoding.DER))
    print(f"pinned: {options.to}")
    return 0


async def _certificate_of(url: str) -> "x509.Certificate":
    """Return what the server shows at its endpoint for signed and encrypted sessions."""
    from asyncua import ua

    from stiction_ros.opcua.session import describe, shown_certificate

    try:
        found = await shown_certificate(url)
    except (OSError, TimeoutError, ua.UaError) as error:
        raise InputError(describe(error), where=url) from None
    if found is not None:
        return found
    raise InputError(
        "offers no endpoint with Basic256Sha256, signed and encrypted",
        where=url,
        fix="let the control engineer enable it",
    )


def _describe(certificate: "x509.Certificate") -> None:
    from cryptography import x509

    from stiction_ros.opcua.security import fingerprint

    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        uris = names.get_values_for_type(x509.UniformResourceIdentifier)
    except x509.ExtensionNotFound:
        uris = []
    print(f"application  {', '.join(uris) or 'not named'}")
    begin, end = certificate.not_valid_before_utc, certificate.not_valid_after_utc
    print(f"valid        {begin:%Y-%m-%d %H:%M} to {end:%Y-%m-%d %H:%M} UTC")
    print(f"fingerprint  {fingerprint(certificate)}")
