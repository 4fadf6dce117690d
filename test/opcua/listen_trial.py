"""Many loops listened to by one bridge and one reader, with estimators on four of them; by hand.

``python test/opcua/listen_trial.py --loops 200 --seconds 600`` starts a server without security on
127.0.0.1 (``many_loops.py``), the node ``opcua``, four estimators and ``stiction listen``, each
as a process. It prints what was missed, the CPU of the bridge and its memory at every tenth, and
ends with code 1 when a sample was missed, the bridge took more than a core, or its memory grew
by 2 %.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from plant_process import wait_until

from stiction_ros.cli.shared.node_processes import ros_environment
from stiction_studies.control_system.process import free_port
from stiction_studies.faults.loop.node_process import NodeProcess

ESTIMATORS = 4
WINDOW = 300  # samples
GROWTH = 1.02  # of memory, from the first tenth to the end
TICK = os.sysconf("SC_CLK_TCK")


def cpu_of(process: int) -> float:
    """Return the CPU time of a process, s."""
    told = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(told[11]) + int(told[12])) / TICK


def run(loops: int, seconds: float, folder: Path) -> bool:
    """Run the trial below an empty folder; return whether nothing was wrong."""
    tags, told = folder / "many.tags.yaml", folder / "listened.json"
    script = str(Path(__file__).with_name("many_loops.py"))
    server = subprocess.Popen(
        [sys.executable, script, str(free_port()), str(loops), str(tags)], stdout=subprocess.DEVNULL
    )
    environment = ros_environment()
    bridge = NodeProcess("opcua", {"tags": str(tags), "security": "none"}, folder, environment)
    estimators = [
        NodeProcess(
            "estimator",
            {"loop": f"L{i}", "sample_time": 1.0, "window": WINDOW, "fit_first": WINDOW},
            folder,
            environment,
            ["-r", f"__ns:=/L{i}"],
            name=f"estimator{i}",
        )
        for i in range(ESTIMATORS)
    ]
    try:
        wait_until(tags.exists, "the server")
        for node in (bridge, *estimators):
            node.start()
        wait_until(lambda: "connected to" in bridge.log, "the bridge")
        listen = ["listen", "--seconds", f"{seconds:g}", "--window", str(WINDOW)]
        reader = subprocess.Popen(
            [sys.executable, "-m", "stiction_ros.cli.main", *listen, "--json", str(told)],
            env=environment,
        )
        begun, spent = time.monotonic(), cpu_of(bridge.pid)
        memory = []
        while reader.poll() is None:
            time.sleep(seconds / 10)
            memory.append((bridge.resident() or 0) / 2**20)
        share = (cpu_of(bridge.pid) - spent) / (time.monotonic() - begun)
        fits = [estimator.log.count("window to sample") for estimator in estimators]
    finally:
        for node in (*estimators, bridge):
            node.end()
        server.terminate()
        server.wait(60.0)
    found = json.loads(told.read_text())
    samples = [one["samples"] for one in found["loops"].values()]
    missed = sum(one["missed"] for one in found["loops"].values())
    reading, peak = 100 * found["cpu_seconds"] / seconds, found["peak_memory_mb"]
    print(f"{len(samples)} loops, at least {min(samples)} samples each, {missed} missed")
    print(f"bridge: {100 * share:.0f} % of a core; MB at tenths:", *(f"{m:.0f}" for m in memory))
    print(f"reader: {reading:.0f} % of a core, {peak:.0f} MB")
    print("fits of the estimators:", *fits)
    whole = len(samples) == loops and min(samples) >= seconds - 5 and not missed
    return whole and share <= 1.0 and memory[-1] <= GROWTH * memory[0]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=600.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        sys.exit(0 if run(options.loops, options.seconds, Path(made)) else 1)
