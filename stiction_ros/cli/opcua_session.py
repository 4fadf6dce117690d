"""Options of the commands that open a session with a control system."""

from __future__ import annotations

import argparse

from stiction_ros.opcua.security import SECURITY, Credentials


def add_session(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a session is secured."""
    group = parser.add_argument_group("session")
    group.add_argument(
        "--security", choices=SECURITY, default=SECURITY[0], help="security of the messages"
    )
    group.add_argument("--certificate", default="", metavar="F", help="our certificate, DER")
    group.add_argument(
        "--private-key", default="", metavar="F", help="our private key, PEM, mode 600"
    )
    group.add_argument(
        "--server-certificate",
        default="",
        metavar="F",
        help="pinned certificate of the server, DER",
    )
    group.add_argument("--user", default="", metavar="NAME", help="name of the user")
    group.add_argument(
        "--password-file", default="", metavar="F", help="file with the password, mode 600"
    )
    group.add_argument(
        "--password-variable",
        default="",
        metavar="NAME",
        help="environment variable with the password",
    )


def credentials_of(options: argparse.Namespace) -> Credentials:
    """Return what the options say, checked.

    Raises:
        InputError: files that lack or that others may read.
    """
    found = Credentials(
        options.security,
        options.certificate,
        options.private_key,
        options.server_certificate,
        options.user,
        options.password_file,
        options.password_variable,
    )
    found.check(writes=False)
    return found
