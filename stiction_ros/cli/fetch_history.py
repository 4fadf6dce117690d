"""``stiction fetch-history``: history of a control system into records."""

import argparse
import asyncio
import datetime
import sys
from pathlib import Path
from typing import Any

from stiction_ros.cli.browse_tags import add_session, credentials_of
from stiction_ros.cli.shared.progress import bar
from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.opcua import require_asyncua
from stiction_ros.opcua.tag_map import LoopTags, TagMap, check_address
from stiction_ros.records.csv_writer import write_csv


def add(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "fetch-history",
        description="Read the history of the loops of a tag map, page by page, and write one CSV "
        "record a loop. A call that was broken off goes on with the tag at which it stopped.",
    )
    option = parser.add_argument
    option("url", metavar="URL", help="address of the server, opc.tcp://HOST:PORT")
    option("--tags", required=True, metavar="F", help="tag map, *.tags.yaml")
    option("--from", dest="begin", required=True, metavar="TIME", help="first time, ISO 8601")
    option("--to", dest="end", required=True, metavar="TIME", help="last time, ISO 8601")
    option(
        "--loop",
        action="append",
        default=[],
        help="a loop of the map; may be repeated (default: all)",
    )
    option(
        "--out", default="history", metavar="DIR", help="folder of the records (default: history)"
    )
    add_session(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command."""
    from stiction_ros.opcua.history import Span, fetch, modes_of, record_of

    require_asyncua()
    check_address(options.url, "URL")
    loops = TagMap.load(find_config(options.tags)).chosen(options.loop, "--loop")
    span = Span(_stamp(options.begin, "--from"), _stamp(options.end, "--to"))
    if span.end <= span.begin:
        raise InputError("is not after --from", where="--to")
    credentials = credentials_of(options)
    out = Path(options.out)
    files: dict[str, Path] = {}
    for loop in loops:
        for tag in _tags(loop):
            files.setdefault(tag, out / "raw" / f"{loop.loop}_{len(files) + 1}.json")
    with bar("reading history") as show:
        found = asyncio.run(fetch(options.url, credentials, files, span, show))
    for loop in loops:
        record = record_of(loop, found, span)
        target = out / f"{loop.loop}.csv"
        write_csv(record, target, modes=modes_of(loop, found, record))
        bad = int((record.quality == 2).sum())
        print(f"{target}: {len(record)} samples of {record.sample_time:g} s, {bad} bad")
    print("raw values are kept below", out / "raw", file=sys.stderr)
    return 0


def _tags(loop: LoopTags) -> list[str]:
    found = [tag for output in loop.outputs for tag in (output.pv, output.sp) if tag]
    found += [valve.op_read for valve in loop.valves]
    return [*found, *(valve.mode for valve in loop.valves if valve.mode)]


def _stamp(text: str, where: str) -> int:
    """Return a time in ns since 1970; one without a zone is taken as UTC."""
    try:
        found = datetime.datetime.fromisoformat(text)
    except ValueError:
        raise InputError(
            f"{text!r} is no time", where=where, fix="write 2026-01-31T12:00"
        ) from None
    found = found if found.tzinfo else found.replace(tzinfo=datetime.UTC)
    return round(found.timestamp() * 1e6) * 1000
