"""The command that fills the windows of all loops, as a process beside their publishers."""

import json
import os
import random
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

from as_given import read_csv_parts
from rclpy.context import Context
from rclpy.node import Node
from sensor_msgs.msg import JointState

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
