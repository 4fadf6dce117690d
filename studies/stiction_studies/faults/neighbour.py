"""A second loop in the graph: a fault in the first one never moves its OP."""

import time

from stiction_studies.faults.fault import Fault, nothing
from stiction_studies.faults.loop.node_process import NodeProcess
from stiction_studies.faults.loop.reference import ops_without_fault
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.loop.setting_up import WARM_UP, case_parameters
from stiction_studies.faults.terms import Phase

SPACE = "/neighbour"
APPLIED = f"{SPACE}/op_applied"
PARTNERS = {"controller": "plant", "plant": "controller"}
STILL = 3.0  # s without a new sample after which it stands still; as a loop in lockstep may


class Neighbour:
    """Plant and controller of the same scenario, in a namespace of their own."""

    def __init__(self, loop: RunningLoop, seed: int, speed: float) -> None:
        """Prepare the two nodes.

        Args:
            loop: beside which they run, in its pace; what is wrong is remarked there.
            seed: of the plant's noise.
            speed: simulated seconds per second of realtime pace.
        """
        self._loop, self._seed = loop, seed
        folder = loop.directory / "neighbour"
        folder.mkdir()
        found = case_parameters(Fault("", "", nothing), loop.pace, seed, speed, folder / "bag")
        self._nodes = [
            NodeProcess(
                name,
                found[name] | {"wait_for": [partner]},
                folder,
                loop.environment,
                ["-r", f"__ns:={SPACE}"],
            )
            for name, partner in PARTNERS.items()
        ]
        loop.probe.hear(APPLIED)

    def start(self, seconds: float) -> None:
        """Start both nodes and wait for the first samples, at most ``seconds``."""
        for node in self._nodes:
            node.start()
        taken = self._loop.heard(APPLIED)
        self._loop.wait_until(lambda: len(taken) >= WARM_UP, seconds)

    def end(self) -> None:
        """End both nodes."""
        for node in reversed(self._nodes):
            node.end()

    def compare(self) -> None:
        """Remark what differs, bit for bit, from the run without ROS."""
        heard = list(self._loop.heard(APPLIED))
        if len(heard) < WARM_UP or time.monotonic() - heard[-1].wall > STILL:
            self._loop.remark(f"the second loop stands still after {len(heard)} samples")
        counts = [one.stamp // self._loop.step for one in heard]
        wanted = ops_without_fault(Phase.BEFORE, self._seed, max(counts, default=1))
        other = [k for k, one in zip(counts, heard, strict=True) if one.values != wanted[k]]
        if other:
            self._loop.remark(f"{len(other)} OPs of the second loop differ from sample {other[0]}")
