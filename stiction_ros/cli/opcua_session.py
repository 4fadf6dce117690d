"""Options of the commands that open a session with a control system."""

import argparse

from stiction_ros.opcua.security import SECURITY, Credentials


def add_session(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a session is secured."""
    group = parser.add_argument_group("session")
    group.add_argument(
        "--security", choices=SECURITY, default=SECURITY[0], help="security of the messages"
    )
    for name, metavar, text in (
        ("--certificate", "F", "our certificate, DER"),
        ("--private-key", "F", "our private key, PEM, mode 600"),
        ("--server-certificate", "F", "pinned certificate of the server, DER"),
        ("--user", "NAME", "name of the user"),
        ("--password-file", "F", "file with the password, mode 600"),
    ):
        group.add_argument(name, default="", metavar=metavar, help=text)


def credentials_of(options: argparse.Namespace) -> Credentials:
    """Return what the options say, checked."""
    found = Credentials.of(options)
    found.check(writes=False)
    return found
