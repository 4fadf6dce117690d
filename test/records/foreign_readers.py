"""Reads a bag with packages that nobody here wrote and compares every value.

``python test/records/foreign_readers.py BAG`` prints how many messages were the same.
"""

import dataclasses
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from stiction_ros.records.bag.messages import read_messages
from stiction_ros.records.run.log import read_run
from stiction_ros.records.storage.files import storage_files

Values = dict[str, list[tuple[int, object]]]
"""Topic to log time and value of each message."""


def plain(value: Any) -> object:
    """Return a decoded message, whoever decoded it, as tuples of Python's own values."""
    if dataclasses.is_dataclass(value):
        fields = [field.name for field in dataclasses.fields(value)]
        names = [n for n in fields if n.islower() and n != "__msgtype__"]  # no constants
        return tuple((name, plain(getattr(value, name))) for name in names)
    if hasattr(value, "__slots__") and not isinstance(value, str | bytes | int | float):
        return tuple((name, plain(getattr(value, name))) for name in value.__slots__)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, bytes | bytearray):
        value = value[0] if len(value) == 1 else list(value)  # a field of type byte
    if isinstance(value, list | tuple):
        return tuple(plain(item) for item in value)
    return repr(float(value)) if isinstance(value, float) else value


def by_us(bag: Path) -> Values:
    found: Values = {}
    for message in read_messages(bag):
        found.setdefault(message.topic, []).append((message.log_time, plain(message.message)))
    return found


def by_rosbags(bag: Path) -> Values:
    found: Values = {}
    with AnyReader([bag]) as reader:
        for connection, time, data in reader.messages():
            value = plain(reader.deserialize(data, connection.msgtype))
            found.setdefault(connection.topic, []).append((time, value))
    return found


def by_mcap(bag: Path) -> Values:
    found: Values = {}
    for path in storage_files(bag):
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for _, channel, message, value in reader.iter_decoded_messages():
                found.setdefault(channel.topic, []).append((message.log_time, plain(value)))
    return found


def differences(bag: Path) -> list[str]:
    """Return what the readers do not agree on; empty when all is the same."""
    ours = by_us(bag)
    found = []
    for name, theirs in (("rosbags", by_rosbags(bag)), ("mcap-ros2-support", by_mcap(bag))):
        if ours.keys() != theirs.keys():
            found.append(f"{name} has other topics: {sorted(ours.keys() ^ theirs.keys())}")
        for topic in sorted(ours.keys() & theirs.keys()):
            if sorted(map(repr, ours[topic])) != sorted(map(repr, theirs[topic])):
                found.append(f"{name} has other values on {topic}")
    return found


def checker() -> str | None:
    """Return the command ``pymcap-cli``, None where it is not installed."""
    return shutil.which("pymcap-cli", path=str(Path(sys.executable).parent)) or shutil.which(
        "pymcap-cli"
    )


def check(path: Path) -> subprocess.CompletedProcess[str]:
    """Let ``pymcap-cli doctor`` look at one file."""
    command = checker()
    assert command is not None
    return subprocess.run([command, "doctor", str(path)], capture_output=True, text=True)


def main(bag: Path) -> int:
    said = differences(bag)
    counts = Counter({topic: len(values) for topic, values in by_us(bag).items()})
    log = read_run(bag)
    for topic, count in sorted(counts.items()):
        published = log.published.get(topic, "not counted")
        print(f"{topic}: {count} in the bag, published: {published}")
    print(f"{counts.total()} messages compared; differences: {said or 'none'}")
    if checker():
        for path in storage_files(bag):
            print(check(path).stdout.strip().rpartition("┘")[2].strip())
    return 1 if said else 0


if __name__ == "__main__":
    raise SystemExit(main(Path(sys.argv[1])))
