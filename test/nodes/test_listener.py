"""The command that fills the windows of all loops, as a process beside their publishers."""

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.records.record import Quality

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from as_given import read_csv_parts
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import JointState

from stiction_ros.nodes.listener import LoopWindow
from stiction_ros.nodes.shared.managed import SIGNAL_QOS
from stiction_ros.nodes.shared.messages import joint_state

LOOPS, SAMPLES, SECOND, BUDGET = 5, 99, 1_000_000_000, 600.0

UNTIL_ALL_HAS_COME = f"""
import sys
from stiction_ros.cli.main import main
from stiction_ros.nodes.listener import Listener

listen = Listener.run

class AllHasCome(Exception):
    pass

def run(listener, seconds, progress):
    def look(share):
        windows = listener.windows.values()
        if len(windows) == {LOOPS} and all(one.samples >= {SAMPLES} for one in windows):
            raise AllHasCome

    try:
        listen(listener, seconds, look)
    except AllHasCome:
        pass

Listener.run = run
sys.exit(main(sys.argv[1:]))
"""
SECOND = 1_000_000_000


@pytest.mark.trial
def test_windows_of_all_loops_are_filled(tmp_path: Path) -> None:
    domain = random.SystemRandom().randint(1, 100)
    context = Context()
    context.init(domain_id=domain)
    node = Node("plant_of_many", context=context)
    topics = ("pv", "op_applied")
    outlets = [
        [node.create_publisher(JointState, f"L{i}/{topic}", SIGNAL_QOS) for topic in topics]
        for i in range(LOOPS)
    ]
    options = ["--seconds", "3600", "--out", str(tmp_path / "out"), "--json", str(tmp_path / "j")]
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", UNTIL_ALL_HAS_COME, "listen", *options],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
    )
    try:
        end = time.monotonic() + BUDGET
        while any(one.get_subscription_count() < 1 for row in outlets for one in row):
            assert process.poll() is None, "the listener ended before it had matched"
            assert time.monotonic() < end, "the listener never matched"
            time.sleep(0.02)
        for k in range(SAMPLES + 1):
            for i, (pv, applied) in enumerate(outlets):
                applied.publish(joint_state((k - 1) * SECOND, ("V1",), [40.0 + i]))
                pv.publish(joint_state(k * SECOND, ("PV1",), [float(k)]))
            time.sleep(0.005)
        assert process.wait(BUDGET) == 0
    finally:
        process.kill()
        process.wait()
        node.destroy_node()
        context.try_shutdown()
    told = json.loads((tmp_path / "j").read_text())["loops"]
    assert set(told) == {f"L{i}" for i in range(LOOPS)}
    assert {(one["samples"], one["missed"]) for one in told.values()} == {(SAMPLES, 0)}
    (record,) = read_csv_parts(tmp_path / "out" / "L3.csv")
    assert record.pv[:, 0].tolist() == [float(k) for k in range(SAMPLES)]
    assert set(record.op[:, 0]) == {43.0}


def filled(count: int, without: tuple[int, ...] = (), window: int = 100) -> LoopWindow:
    loop = LoopWindow("unit", 1.0, window)
    for k in range(count):
        if k not in without:
            loop.take("op_applied", (k - 1) * SECOND, ("V1",), [40.0 + k - 1])
            loop.take("pv", k * SECOND, ("PV1",), [10.0 + k])
    return loop


def test_samples_become_a_record() -> None:
    loop = filled(50)
    record = loop.record()
    assert record is not None
    assert loop.pairs.counts["missed"] == 0
    np.testing.assert_array_equal(record.op[:, 0] - record.pv[:, 0], 30.0)
    assert record.start == 0.0
    assert len(record) == 49  # the OP of the last sample is still to come


def test_the_window_keeps_the_last() -> None:
    loop = filled(300, window=100)
    record = loop.record()
    assert record is not None
    assert (len(loop), len(record), loop.samples) == (100, 100, 299)
    assert record.pv[-1, 0] == 10.0 + 298


def test_samples_that_never_came_are_counted_and_marked() -> None:
    loop = filled(60, (30, 31))
    record = loop.record()
    assert record is not None
    assert (loop.pairs.counts["missed"], record.start) == (2, 0.0)
    assert np.flatnonzero(record.quality == Quality.BAD).tolist() == [30, 31]


def test_bad_samples_are_marked() -> None:
    loop = filled(20)
    loop.take("op_applied", 19 * SECOND, ("V1",), [59.0])
    loop.take("pv", 20 * SECOND, ("PV1",), [np.nan])
    loop.take("op_applied", 20 * SECOND, ("V1",), [60.0])
    loop.take("pv", 21 * SECOND, ("PV1",), [31.0])
    loop.take("op_applied", 21 * SECOND, ("V1",), [61.0])
    record = loop.record()
    assert record is not None
    assert np.flatnonzero(record.quality == Quality.BAD).tolist() == [20]


def test_other_tags_are_left_alone() -> None:
    loop = filled(10)
    loop.take("pv", 10 * SECOND, ("PV2",), [1.0])
    assert loop.samples == 9


def test_too_little_is_no_record() -> None:
    assert LoopWindow("unit", 1.0, 10).record() is None
