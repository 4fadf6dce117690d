"""``stiction bench record``: the recorder against the bare writer of the package ``mcap``.

Times are of the processor, ms for a thousand messages: a bag is only written while others
control.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from mcap.writer import CompressionType, Writer

from stiction_ros.cli.shared.node_processes import require_ros, ros_environment
from stiction_ros.cli.shared.progress import Bar
from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.mcap_scan import RawMessage
from stiction_studies.benches.speed.graph import record_run
from stiction_studies.benches.speed.row import Row, row

REPEATS = 5
ROUNDS = 4  # times that the messages of the run are written
RATE = 1000.0  # messages per second
COUNT = 2000  # of each of three topics
WRITERS = ("bag writer, closing included", "mcap writer")
NODES = ("recorder node", "raw subscriptions and mcap writer")
_TICKS = os.sysconf("SC_CLK_TCK")


def record(show: Bar) -> list[Row]:
    """Measure the writers on the messages of a recorded run, then the nodes at a fixed rate."""
    require_ros()
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        messages = list(read_raw(record_run("siso", directory, show)))
        rows = [_writers(compression, messages, directory) for compression in ("zstd", "none")]
        rows.append(_nodes(directory))
    return rows


def _writers(compression: str, messages: Sequence[RawMessage], directory: Path) -> Row:
    ours: list[float] = []
    bare: list[float] = []
    each = 1e6 / (ROUNDS * len(messages))
    for number in range(REPEATS):
        path = directory / f"{compression}{number}"
        bare.append(each * _cpu_of(_write_bare, path.with_suffix(".mcap"), messages, compression))
        ours.append(each * _cpu_of(_write_bag, path, messages, compression))
    size = sum(len(message.data) for message in messages) / len(messages)
    middle = sorted(ours)[REPEATS // 2]
    note = f"{1e6 / middle:.0f} messages of {size:.0f} bytes a second; ms per 1000 messages"
    return row(f"writer, {compression}", WRITERS, ours, bare, note)


def _cpu_of(
    write: Callable[[Path, Sequence[RawMessage], str], None],
    path: Path,
    messages: Sequence[RawMessage],
    compression: str,
) -> float:
    """Return the processor time, s, that writing the messages takes."""
    begin = time.process_time()
    write(path, messages, compression)
    return time.process_time() - begin


def _write_bag(directory: Path, messages: Sequence[RawMessage], compression: str) -> None:
    with BagWriter(directory, compression) as writer:
        for topic in dict.fromkeys(message.topic for message in messages):
            writer.add_topic(topic.name, topic.type, topic.definition, topic.type_hash)
        for _ in range(ROUNDS):
            for topic, log_time, publish_time, data in messages:
                writer.write(topic.name, data, log_time, publish_time)


def _write_bare(path: Path, messages: Sequence[RawMessage], compression: str) -> None:
    kind = CompressionType.ZSTD if compression == "zstd" else CompressionType.NONE
    with path.open("wb") as stream:
        writer = Writer(stream, compression=kind)
        writer.start("ros2", "mcap")
        channels = {}
        for topic in dict.fromkeys(message.topic for message in messages):
            schema = writer.register_schema(topic.type, "ros2msg", topic.definition.encode())
            channels[topic.name] = writer.register_channel(topic.name, "cdr", schema)
        for _ in range(ROUNDS):
            for topic, log_time, publish_time, data in messages:
                writer.add_message(channels[topic.name], log_time, data, publish_time)
        writer.finish()


def _nodes(directory: Path) -> Row:
    """Compare the processor time of two recording processes, from the first message to the end."""
    yardstick = [sys.executable, "-P", "-m", "stiction_studies.benches.speed.record_yardstick"]
    ours = [sys.executable, "-P", "-m", "stiction_ros.nodes", "recorder", "--ros-args"]
    ours += ["-p", f"directory:={directory / 'live'}", "-p", "regex:=/bench/.*"]
    talk = [*yardstick, "talk", str(RATE), str(COUNT)]
    bare_cpu, _ = _recorded([*yardstick, "record", str(directory / "live.mcap")], talk)
    cpu, seconds = _recorded(ours, talk)
    kept = sum(1 for _ in read_raw(directory / "live"))
    kept_bare = sum(1 for _ in read_raw(directory / "live.mcap"))
    total = 3 * COUNT
    share, bare_share = 100 * cpu / seconds, 100 * bare_cpu / seconds
    note = (
        f"{share:.1f} % of one core at {RATE:.0f} messages a second, bare {bare_share:.1f} %; "
        f"lost {total - kept} and {total - kept_bare} of {total}; ms per 1000 messages"
    )
    each = 1e6 / total
    return row("graph", NODES, [each * cpu], [each * bare_cpu], note)


def _recorded(recorder: Sequence[str], talk: Sequence[str]) -> tuple[float, float]:
    """Return the recorder's processor time, s, and how long the talker spoke, s."""
    environment = ros_environment()
    listening = subprocess.Popen(recorder, env=environment, stdin=subprocess.DEVNULL)
    try:
        with subprocess.Popen(talk, env=environment, stdout=subprocess.PIPE, text=True) as talking:
            assert talking.stdout is not None
            talking.stdout.readline()
            before = _cpu(listening.pid)
            said = talking.stdout.readline().split()
        listening.send_signal(signal.SIGTERM)
        _, status, usage = os.wait4(listening.pid, 0)
        listening.returncode = os.waitstatus_to_exitcode(status)
    finally:
        if listening.returncode is None:
            listening.kill()
            listening.wait()
    if talking.returncode or listening.returncode or not said:
        raise InputError("the processes did not find each other", where="bench record")
    return usage.ru_utime + usage.ru_stime - before, float(said[1])


def _cpu(process: int) -> float:
    """Return the processor time of a process so far, s."""
    fields = Path(f"/proc/{process}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS
