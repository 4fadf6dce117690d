"""Certificates that are made and pinned, and secrets that nobody else can read."""

import dataclasses
import datetime
import ipaddress
import os
import stat
from pathlib import Path
from typing import TYPE_CHECKING

from stiction_ros.errors import InputError, storing
from stiction_ros.settings import setting

if TYPE_CHECKING:
    from cryptography import x509

KEY_BITS = 2048  # Basic256Sha256 asks for 2048 to 4096
DAYS = 365
CLIENT_URI = "urn:stiction_ros:opcua"


@dataclasses.dataclass(frozen=True)
class Credentials:
    """How a session is secured; nothing secret is kept here, only where it stands."""

    security: str = setting(
        "sign_and_encrypt",
        "sign_and_encrypt (Basic256Sha256), or none, by which nothing can be written",
        choices=("sign_and_encrypt", "none"),
        fixed=True,
    )
    certificate: str = setting("", "file of our certificate, DER", fixed=True)
    private_key: str = setting("", "file of our key, PEM, mode 600", fixed=True)
    server_certificate: str = setting(
        "", "file of the certificate that the server must show, DER", fixed=True
    )
    user: str = setting("", "name of the user; empty for none", fixed=True)
    password_file: str = setting("", "file of the user's password, mode 600", fixed=True)

    def check(self, writes: bool) -> None:
        """Refuse what cannot be connected with, and writing without encryption or user."""
        if self.security == "none":
            if writes:
                raise InputError(
                    "nothing is written over a connection without security",
                    where="security",
                    fix="use sign_and_encrypt",
                )
            if self.user:
                raise InputError(
                    "a password is not sent over a connection without security",
                    where="security",
                    fix="use sign_and_encrypt, or leave out user",
                )
            return
        for key in ("certificate", "private_key", "server_certificate"):
            if not getattr(self, key):
                raise InputError(
                    "is not set", where=key, fix="make or pin one: stiction certificates --help"
                )
        check_secret_file(Path(self.private_key))
        check_dates(load_certificate(Path(self.certificate)), self.certificate)
        check_dates(load_certificate(Path(self.server_certificate)), self.server_certificate)
        if writes and not self.user:
            raise InputError(
                "nothing is written anonymously", where="user", fix="name a user that may write"
            )
        if self.user:
            self.password()

    def password(self) -> str:
        """Return the password from its file, which nobody else may read."""
        if not self.password_file:
            raise InputError("password_file is needed", where=f"user {self.user}")
        path = Path(self.password_file)
        check_secret_file(path)
        return path.read_text(encoding="utf-8").strip("\r\n")


def check_secret_file(path: Path) -> None:
    """Raise InputError unless only the user (or root) owns and reads the file."""
    with storing(path, what="read"):
        found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        raise InputError("is no file", where=str(path))
    if found.st_uid not in (os.getuid(), 0):
        raise InputError("belongs to another user", where=str(path))
    if found.st_mode & 0o077:
        raise InputError(
            "is a secret that others may read", where=str(path), fix=f"run chmod 600 {path}"
        )


def load_certificate(path: Path) -> "x509.Certificate":
    """Return the certificate in a DER or PEM file."""
    from cryptography import x509

    with storing(path, what="read"):
        data = path.read_bytes()
    try:
        if data.startswith(b"-----"):
            return x509.load_pem_x509_certificate(data)
        return x509.load_der_x509_certificate(data)
    except ValueError:
        raise InputError("is no certificate", where=str(path)) from None


def check_dates(certificate: "x509.Certificate", where: str) -> None:
    """Raise InputError when a certificate has expired or is not valid yet."""
    now = datetime.datetime.now(datetime.UTC)
    if now > certificate.not_valid_after_utc:
        raise InputError(
            f"has expired on {certificate.not_valid_after_utc:%Y-%m-%d}",
            where=where,
            fix="make or pin a new one",
        )
    if now < certificate.not_valid_before_utc:
        raise InputError(
            f"is valid from {certificate.not_valid_before_utc:%Y-%m-%d} on",
            where=where,
            fix="check the clock",
        )


def fingerprint(certificate: "x509.Certificate") -> str:
    """Return the SHA-256 fingerprint as pairs of hexadecimal digits."""
    from cryptography.hazmat.primitives import hashes

    return certificate.fingerprint(hashes.SHA256()).hex(":")


@dataclasses.dataclass(frozen=True)
class Identity:
    """What a certificate says of its owner."""

    uri: str  # of the application
    hosts: tuple[str, ...]  # names and addresses
    server: bool  # whether it is a server's, else a client's
    begin: datetime.datetime  # first moment of validity
    days: int = DAYS  # of validity


def make_certificate(identity: Identity, certificate: Path, private_key: Path) -> None:
    """Make a key, for its owner alone, and a self-signed certificate (OPC UA part 6, 6.2.2).

    Raises:
        InputError: one of the files is there already, or cannot be written.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import rsa
    from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

    for path in (certificate, private_key):
        if path.exists():
            raise InputError("is there already", where=str(path), fix="choose another folder")
    key = rsa.generate_private_key(public_exponent=65537, key_size=KEY_BITS)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, identity.uri)])
    names: list[x509.GeneralName] = [x509.UniformResourceIdentifier(identity.uri)]
    names += [_general_name(host) for host in identity.hosts]
    use = ExtendedKeyUsageOID.SERVER_AUTH if identity.server else ExtendedKeyUsageOID.CLIENT_AUTH
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(identity.begin)
        .not_valid_after(identity.begin + datetime.timedelta(days=identity.days))
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_key_usage(), critical=True)
        .add_extension(x509.ExtendedKeyUsage([use]), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, hashes.SHA256())
    )
    pem = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    write_secret(private_key, pem)
    certificate.write_bytes(made.public_bytes(serialization.Encoding.DER))


def write_secret(path: Path, content: bytes) -> None:
    """Write a new file that only its owner may read; InputError when it cannot be made."""
    with storing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "wb") as file:
        file.write(content)


def _general_name(host: str) -> "x509.GeneralName":
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _key_usage() -> "x509.KeyUsage":
    from cryptography import x509

    return x509.KeyUsage(
        digital_signature=True,
        content_commitment=True,
        key_encipherment=True,
        data_encipherment=True,
        key_agreement=False,
        key_cert_sign=False,
        crl_sign=False,
        encipher_only=False,
        decipher_only=False,
    )
