"""The graph as processes: everything recorded, deterministic, nothing left behind."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from open_sockets import listening_of
from small_loop import SAMPLES, write_small_scenario

pytest.importorskip("rclpy", reason="ROS 2 for Python is not installed")

sys.path.insert(0, str(Path(__file__).parents[1] / "records"))
from as_given import run_metadata
from foreign_readers import differences

from stiction_ros.cli.shared.node_processes import NodeProcesses, ros_environment
from stiction_ros.online.replays.result import Match
from stiction_ros.online.replays.run import replay
from stiction_ros.online.session import Scenario, run_live
from stiction_ros.records.bag.messages import read_messages
from stiction_ros.records.run.log import RunLog, read_run

PATIENCE = 120.0
TOPICS = ("clock", "pv", "sp", "op", "stem", "stiction", "loop_model", "mode", "prediction")


def run_processes(directory: Path, look: Callable[[NodeProcesses], object] | None = None) -> Path:
    """Run the small scenario in processes and return its bag; ``look`` when the plant runs."""
    nodes = {name: dict(v) for name, v in Scenario.load(scenario(directory)).nodes.items()}
    nodes["recorder"]["directory"] = str(directory / "bag")
    processes = NodeProcesses(nodes, directory)
    try:
        processes.start()
        if look is not None:
            wait_until(lambda: processes.require_running() or processes.sample)
            look(processes)
        processes.wait(lambda _share: None)
    finally:
        processes.stop()
    processes.check()
    return directory / "bag"


def scenario(directory: Path) -> Path:
    path = directory / "small.scenario.yaml"
    return path if path.exists() else write_small_scenario(directory)


def running(mark: str) -> list[int]:
    """Return the ids of running processes whose command line holds ``mark``."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            line = (entry / "cmdline").read_bytes().decode(errors="replace")
            state = (entry / "stat").read_text().rsplit(")", 1)[1].split()[0]
        except OSError:
            continue
        if mark in line and state != "Z":
            found.append(int(entry.name))
    return found


def wait_until(condition, patience: float = PATIENCE) -> None:
    """Wait for ``condition``; fail when it does not come true in time."""
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end, "it did not come true in time"
        time.sleep(0.02)


@pytest.fixture(scope="module")
def listening() -> list[list[str]]:
    """Tell on which addresses each node listens, once the bag is there."""
    return []


@pytest.fixture(scope="module")
def bag(tmp_path_factory, listening) -> Path:
    def look(processes: NodeProcesses) -> None:
        listening.extend(map(listening_of, running(str(processes.directory))))

    return run_processes(tmp_path_factory.mktemp("graph"), look)


@pytest.fixture(scope="module")
def log(bag) -> RunLog:
    return read_run(bag)


@pytest.fixture(scope="module")
def core(bag):
    return run_live(Scenario.load(scenario(bag.parent)))


def test_no_node_listens(bag, listening):
    assert bag.exists()
    assert listening == [[]] * 4


def test_every_topic_is_recorded_whole(log):
    assert log.published
    assert {topic: log.recorded.get(topic) for topic in log.published} == log.published
    assert {f"/{topic}" for topic in TOPICS} <= {t for t, n in log.recorded.items() if n}


@pytest.mark.parametrize("signal_name", ["op", "pv", "sp", "stem"])
def test_the_graph_gives_the_numbers_of_the_core(log, core, signal_name):
    recorded = getattr(log.record, signal_name)
    assert np.array_equal(recorded, getattr(core.run.record, signal_name))


def test_the_swap_comes_at_the_same_sample(log, core):
    assert core.swap is not None
    assert log.swap is not None
    assert log.seconds(log.swap.stamp) == core.swap.sample


def test_the_replay_gives_the_run_again_bit_for_bit(bag):
    found = replay(bag)
    assert (found.match, found.first_difference) == (Match.EQUAL, "")
    assert found.from_first_sample
    assert found.op is not None
    assert found.op.equal == SAMPLES
    assert {fit.comparison.match for fit in found.fits} == {Match.EQUAL}
    recorded, replayed = found.swaps
    assert recorded is not None
    assert recorded == replayed
    assert found.notes == ()


@pytest.mark.trial
def test_a_second_run_gives_identical_pv_and_op(log, tmp_path):
    first = log.record
    second = read_run(run_processes(tmp_path)).record
    assert np.array_equal(first.pv, second.pv)
    assert np.array_equal(first.op, second.op)


def test_other_readers_decode_the_same_values(bag):
    assert differences(bag) == []


def test_the_bag_tells_of_its_run(bag, log):
    found = run_metadata(bag)
    nodes = {"/plant", "/controller", "/estimator", "/recorder"}
    assert {key.partition(":")[2] for key in found if key.startswith("config:")} == nodes
    assert found["seed"] == str(Scenario.load(scenario(bag.parent)).seed)
    assert found["loop_model:/loop_model"] == log.loop_models[-1].text


def test_log_time_is_simulated_time(bag):
    late = [
        (m.log_time - m.message.header.stamp.sec * 10**9 - m.message.header.stamp.nanosec) / 1e9
        for m in read_messages(bag)
        if m.topic == "/pv"
    ]
    assert max(abs(value) for value in late) <= 1.0  # one sample


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGINT,
        *(pytest.param(n, marks=pytest.mark.trial) for n in (signal.SIGTERM, signal.SIGKILL)),
    ],
)
def test_an_ended_demo_leaves_no_process_behind(tmp_path, number):
    out = tmp_path / "demo"
    # Tests that run in the background inherit a SIGINT that is ignored.
    start = ["env", "--default-signal=INT", sys.executable, "-m", "stiction_ros.cli.main"]
    process = subprocess.Popen(
        [*start, "demo", "siso", "--out", str(out)],
        env=ros_environment(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        wait_until(lambda: len(running(str(out))) >= 5 or process.poll() is not None)
        assert process.poll() is None
        wait_until(lambda: any((out / "siso").glob("bag/*.mcap")))
        process.send_signal(number)
        _, said = process.communicate(timeout=PATIENCE)
    finally:
        if process.poll() is None:
            process.kill()
    assert process.returncode == (-number if number == signal.SIGKILL else 130)
    assert "Traceback" not in said
    wait_until(lambda: not running(str(out)))


@pytest.mark.trial
def test_a_partner_that_was_killed_ends_a_run_in_lockstep_with_a_sentence(tmp_path):
    nodes = {name: dict(v) for name, v in Scenario.load(scenario(tmp_path)).nodes.items()}
    nodes["recorder"]["directory"] = str(tmp_path / "bag")
    nodes["plant"]["samples"] = 20_000
    processes = NodeProcesses(nodes, tmp_path)
    try:
        processes.start()
        wait_until(lambda: processes.sample > 0)
        controller = processes._processes["controller"]
        controller.kill()
        wait_until(lambda: processes._processes["plant"].poll() is not None)
        wait_until(lambda: processes._processes["estimator"].poll() is not None)
    finally:
        processes.stop()
    codes = {name: process.returncode for name, process in processes._processes.items()}
    assert codes == {"plant": 1, "controller": -9, "estimator": 0, "recorder": 0}
    said = {name: (tmp_path / "log" / f"{name}.log").read_text() for name in codes}
    assert "controller has gone at sample" in said["plant"]
    assert "plant has gone: the run is over" in said["estimator"]
    assert "Traceback" not in "".join(said.values())
