"""``stiction browse-tags``: a tag map made by browsing a control system."""

import argparse
import asyncio
from pathlib import Path
from typing import Any

import yaml

from stiction_ros.errors import InputError, storing
from stiction_ros.opcua import require_asyncua
from stiction_ros.opcua.security import Credentials
from stiction_ros.opcua.tag_map import TagMap, check_address
from stiction_ros.settings import settings_of


def add_session(parser: argparse.ArgumentParser) -> None:
    """Add the options that say how a session is secured."""
    group = parser.add_argument_group("session")
    for entry in settings_of(Credentials):
        name, choices = f"--{entry.name.replace('_', '-')}", entry.choices or None
        group.add_argument(name, default=entry.default, choices=choices, help=entry.description)


def credentials_of(options: argparse.Namespace) -> Credentials:
    """Return what the options say, checked."""
    found = Credentials(*(getattr(options, entry.name) for entry in settings_of(Credentials)))
    found.check(writes=False)
    return found


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "browse-tags",
        description="Find everything that has a PV and an OP under one name, FIC101.PV or a "
        "folder FIC101 with a variable PV, and write a tag map that listens to it.",
    )
    parser.add_argument("url", metavar="URL", help="address of the server, opc.tcp://HOST:PORT")
    parser.add_argument("--out", required=True, metavar="F", help="tag map to write, *.tags.yaml")
    parser.add_argument("--force", action="store_true", help="write over a file that is there")
    parser.add_argument("--root", default="", metavar="NODE", help="node to begin at")
    parser.add_argument(
        "--sample-time", type=float, required=True, metavar="S", help="seconds between samples"
    )
    for key, name in (("pv", "PV"), ("op", "OUT"), ("sp", "SP"), ("mode", "MODE")):
        parser.add_argument(f"--{key}", default=name, help=f"name of the tag (default: {name})")
    add_session(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    require_asyncua()
    check_address(options.url, "URL")
    if not options.sample_time > 0:
        raise InputError("is not positive", where="--sample-time")
    path = Path(options.out)
    if path.exists() and not options.force:  # it may have been edited since
        raise InputError(
            "is there already", where=options.out, fix="choose another file, or say --force"
        )
    from asyncua import ua

    from stiction_ros.opcua.browsing import browse, loops_of
    from stiction_ros.opcua.session import describe

    names = {key: getattr(options, key) for key in ("pv", "op", "sp", "mode")}
    try:
        found = asyncio.run(browse(options.url, credentials_of(options), options.root))
    except (OSError, TimeoutError, ua.UaError) as error:
        raise InputError(describe(error), where=options.url) from None
    loops = loops_of(found, names, options.sample_time)
    if not loops:
        raise InputError(
            f"none of {len(found)} variables is {options.pv} beside {options.op}",
            where=options.url,
            fix="say by --pv and --op how they are called",
        )
    with storing(options.out):
        path.write_text(yaml.safe_dump({"server": options.url, "loops": loops}, sort_keys=False))
    print(f"{path}: {len(TagMap.load(path).loops)} loops")
    return 0
