"""A long run of the nodes: what is missed, and whether memory grows."""

import dataclasses
import math
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from stiction_ros.cli.shared.node_processes import ros_environment
from stiction_ros.online.controller.live import HISTORY_SAMPLES
from stiction_ros.online.loop_estimator import EstimatorNodeSettings
from stiction_ros.settings import from_mapping
from stiction_studies.faults.loop.node_process import NodeProcess

STARTED = ("recorder", "estimator", "controller", "plant")
ENDED = ("plant", "controller", "estimator", "recorder")
TENTH = 0.1
READINGS = 5  # of memory, of which the median counts
LOOK = 1.0  # s between two readings
GROWTH = 1.02  # largest ratio of the memory at the end to that at a tenth
# Keys of the statuses: what must be 0, and what is told besides.
MISSED = (("controller", "missing"), ("controller", "passed_over"), ("estimator", "missed_samples"))
TOLD = (
    ("plant", "late_op"),
    ("plant", "unanswered"),
    ("plant", "missed_ticks"),
    ("plant", "shown_again"),
    ("plant", "pv_to_op_ms_p999"),
    ("plant", "pv_to_op_ms_max"),
)
STALL = 300.0  # s without a sample


@dataclasses.dataclass(frozen=True)
class Memory:
    """Resident memory of one node, bytes: at a tenth of the run, and at its end."""

    tenth: float
    end: float

    @property
    def ratio(self) -> float:
        """The end over the tenth."""
        return self.end / self.tenth if self.tenth > 0.0 else math.nan


@dataclasses.dataclass(frozen=True)
class Soaked:
    """How a long run went."""

    # samples, seconds: how long it was
    samples: int
    seconds: float
    missed: Mapping[str, int]  # samples that were missed, by node and key
    told: Mapping[str, str]  # what else the nodes have counted, by node and key
    kept: Mapping[str, int]  # most samples of the past that a node keeps
    memory: Mapping[str, Memory]  # of every node
    # nodes that ended when they should not have, a run that stood still
    failures: tuple[str, ...] = ()

    @property
    def reasons(self) -> list[str]:
        """Why it fails; empty for a pass."""
        found = list(self.failures)
        if not self.samples:
            found.append("no sample was seen")
        if not self.missed:
            found.append("no node has told what it missed")
        found += [f"{key}: {count}" for key, count in self.missed.items() if count]
        if not self.memory:
            found.append("the memory of no node was seen")
        for name, memory in self.memory.items():
            if not memory.ratio <= GROWTH:
                found.append(f"the memory of {name} is {memory.ratio:.3f} of that at a tenth")
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return plain values."""
        memory = {
            name: {"tenth": one.tenth, "end": one.end, "ratio": one.ratio}
            for name, one in self.memory.items()
        }
        plain = dataclasses.asdict(self) | {"memory": memory}
        return plain | {"passed": not self.reasons, "reasons": self.reasons}


class Readings:
    """Memory of every node over a run, by the share of it that is done."""

    def __init__(self) -> None:
        """Start without readings."""
        self._found: dict[str, list[tuple[float, int]]] = {}

    def add(self, share: float, name: str, resident: int | None) -> None:
        """Note one reading; None for a node that has ended."""
        if resident is not None:
            self._found.setdefault(name, []).append((share, resident))

    def memory(self) -> dict[str, Memory]:
        """Return each node's memory at a tenth and at the end; none where either is missing."""
        found = {}
        for name, readings in self._found.items():
            later = [size for share, size in readings if share >= TENTH]
            if len(later) < 2 * READINGS:
                continue
            first = statistics.median(later[:READINGS])
            found[name] = Memory(first, statistics.median(later[-READINGS:]))
        return found


def soak(
    nodes: Mapping[str, Mapping[str, Any]],
    directory: Path,
    seconds: float,
    progress: Callable[[float], None],
) -> Soaked:
    """Run the nodes until the plant has run its samples, or for ``seconds``.

    Args:
        nodes: parameters by node.
        directory: for parameters, logs and the bag.
        seconds: wall time; infinite for as long as the samples take.
        progress: told the share that is done.
    """
    from stiction_studies.faults.loop.fault_probe import Probe

    environment = ros_environment()
    probe = Probe(environment, topics=())
    processes = {
        name: NodeProcess(name, values, directory, environment) for name, values in nodes.items()
    }
    wanted = int(nodes["plant"].get("samples", 0))
    readings, failures = Readings(), list[str]()
    begun = time.monotonic()
    last = (begun, 0)
    try:
        for name in STARTED:
            processes[name].start()
        while True:
            time.sleep(LOOK)
            now, sample = time.monotonic(), _number(probe.values, "plant", "sample")
            share = max((now - begun) / seconds, sample / wanted if wanted else 0.0)
            if processes["plant"].code is not None or share >= 1.0:
                break
            for name, process in processes.items():
                readings.add(share, name, process.resident())
                if process.code is not None:
                    failures.append(f"{name} ended with code {process.code}")
            last = (now, sample) if sample != last[1] else last
            if now - last[0] > STALL:
                failures.append(f"no sample for {STALL:g} s at sample {sample}")
            if failures:
                break
            progress(share)
        code = processes["plant"].code
        if code:
            failures.append(f"plant ended with code {code}")
    finally:
        took = time.monotonic() - begun
        for name in ENDED:
            if not processes[name].end():
                failures.append(f"{name} did not end when it was asked to")
        probe.close()
    return Soaked(
        _number(probe.values, "plant", "sample"),
        took,
        _missed(probe.values),
        _values(probe.values, TOLD),
        kept(nodes),
        readings.memory(),
        tuple(failures),
    )


def _number(values: Mapping[str, Mapping[str, str]], node: str, key: str) -> int:
    return int(values.get(f"{node}: status", {}).get(key, 0))


def _values(
    values: Mapping[str, Mapping[str, str]], keys: Sequence[tuple[str, str]]
) -> dict[str, str]:
    return {
        f"{node} {key}": values[f"{node}: status"][key]
        for node, key in keys
        if key in values.get(f"{node}: status", {})
    }


def _missed(values: Mapping[str, Mapping[str, str]]) -> dict[str, int]:
    return {key: int(value) for key, value in _values(values, MISSED).items()}


def kept(nodes: Mapping[str, Mapping[str, Any]]) -> dict[str, int]:
    """Return the most samples of the past that controller and estimator keep."""
    window = from_mapping(EstimatorNodeSettings, nodes["estimator"], "estimator").window
    return {"controller": HISTORY_SAMPLES, "estimator": window}
