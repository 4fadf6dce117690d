"""Settings of the middleware, made before any test imports rclpy."""

import os
import random
import sys
from pathlib import Path

import pytest
from hypothesis import settings

# A domain of its own keeps a test run apart from nodes that run on the same host, and the workers
# of one run, which share its identity, from each other.
run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0")
first = (random.Random(run) if run else random.SystemRandom()).randrange(100)
os.environ["ROS_DOMAIN_ID"] = str(1 + (first + int(worker.removeprefix("gw"))) % 100)
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
# Without it rclpy sends Float64(data=1) as 5e-324 and says nothing.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ.setdefault("MPLBACKEND", "Agg")
# As the command and the nodes do; fits run on one thread.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Frozen figures follow the last digits of linear algebra, which differ between kinds of processors.
os.environ.setdefault("OPENBLAS_CORETYPE", "Haswell")
# Wheels set no prefix path; a sourced ROS installation does.
if (Path(sys.prefix) / "share" / "ament_index").is_dir():
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)

WHOLE = os.environ.get("STICTION_ALL_TRIALS") == "1"

# No example is timed: how long one takes says how busy the machine is. Many are for all trials.
settings.register_profile("untimed", deadline=None, max_examples=100 if WHOLE else 25)
settings.load_profile("untimed")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With ``-m alone`` import only the files that have such tests, a few of hundreds."""
    if config.option.markexpr != "alone" or collection_path.suffix != ".py":
        return None
    return "mark.alone" not in collection_path.read_text(encoding="utf-8") or None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Skip the trials unless all are asked for."""
    if WHOLE:
        return
    for item in items:
        if item.get_closest_marker("trial"):
            item.add_marker(pytest.mark.skip(reason="long: STICTION_ALL_TRIALS=1"))
