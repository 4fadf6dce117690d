"""Certificates, secrets, and what may not be connected with."""

import dataclasses
import datetime
import stat
from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.opcua.security import (
    Credentials,
    Identity,
    check_secret_file,
    fingerprint,
    load_certificate,
    make_certificate,
    write_secret,
)

NOW = datetime.datetime.now(datetime.UTC)


def made(folder: Path, name: str, begin: datetime.datetime = NOW, days: int = 3) -> None:
    identity = Identity("urn:test", ("127.0.0.1", "plant"), False, begin, days)
    make_certificate(identity, folder / f"{name}.der", folder / f"{name}.pem")


@pytest.fixture
def credentials(tmp_path: Path) -> Credentials:
    made(tmp_path, "client", NOW - datetime.timedelta(hours=1))
    made(tmp_path, "server", NOW - datetime.timedelta(hours=1))
    write_secret(tmp_path / "word", b"open sesame\n")
    return Credentials(
        certificate=str(tmp_path / "client.der"),
        private_key=str(tmp_path / "client.pem"),
        server_certificate=str(tmp_path / "server.der"),
        user="me",
        password_file=str(tmp_path / "word"),
    )


def test_keys_are_for_their_owner_alone(tmp_path: Path) -> None:
    made(tmp_path, "client")
    assert stat.S_IMODE((tmp_path / "client.pem").stat().st_mode) == 0o600
    with pytest.raises(InputError, match="there already"):
        made(tmp_path, "client")


def test_good_credentials_may_write_and_tell_no_secret(credentials: Credentials) -> None:
    credentials.check(writes=True)
    assert credentials.password() == "open sesame"
    assert "sesame" not in repr(credentials)


def test_a_secret_that_others_may_read_is_refused(tmp_path: Path, credentials: Credentials) -> None:
    for name in ("word", "client.pem"):
        path = tmp_path / name
        path.chmod(0o640)
        with pytest.raises(InputError, match="chmod 600"):
            credentials.check(writes=False)
        path.chmod(0o600)
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="no file"):
        check_secret_file(tmp_path / "folder")


def test_a_user_without_a_password_is_refused(credentials: Credentials) -> None:
    with pytest.raises(InputError, match="password_file is needed"):
        dataclasses.replace(credentials, password_file="").check(writes=True)


@pytest.mark.parametrize(
    ("changes", "match"),
    [
        ({"user": ""}, "anonymously"),
        ({"security": "none"}, "without security"),
        ({"server_certificate": ""}, "server_certificate"),
        ({"certificate": "/nowhere.der"}, "cannot be read"),
    ],
)
def test_writing_is_refused_without(
    credentials: Credentials, changes: dict[str, str], match: str
) -> None:
    with pytest.raises(InputError, match=match):
        dataclasses.replace(credentials, **changes).check(writes=True)


def test_listening_without_security_needs_nothing() -> None:
    Credentials(security="none").check(writes=False)
    with pytest.raises(InputError, match="password"):
        Credentials(security="none", user="me").check(writes=False)


@pytest.mark.parametrize(("ago", "match"), [(10, "expired"), (-5, "valid from")])
def test_dates_are_looked_at(
    tmp_path: Path, credentials: Credentials, ago: int, match: str
) -> None:
    made(tmp_path, "odd", NOW - datetime.timedelta(days=ago))
    odd = dataclasses.replace(credentials, server_certificate=str(tmp_path / "odd.der"))
    with pytest.raises(InputError, match=match):
        odd.check(writes=False)


def test_what_is_no_certificate_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.der").write_bytes(b"nothing of the kind")
    with pytest.raises(InputError, match="no certificate"):
        load_certificate(tmp_path / "x.der")


def test_the_command_makes_and_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["certificates", "make", "--out", str(tmp_path / "own"), "--days", "30"]) == 0
    certificate = tmp_path / "own" / "client.der"
    assert fingerprint(load_certificate(certificate)) in capsys.readouterr().out
    assert main(["certificates", "make", "--out", str(tmp_path / "own")]) == 2
