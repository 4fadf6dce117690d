"""What every loop has that faults are put into: nodes, the suite's own node, remarks, patience."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from stiction_ros.cli.shared.node_processes import ros_environment
from stiction_studies.faults.loop.node_process import NodeProcess

if TYPE_CHECKING:
    from stiction_studies.faults.loop.fault_probe import Probe

LOOK = 0.01  # s between two looks at what has come


class FaultedLoop:
    """One loop on its way through a case; subclasses fill in nodes and probe.

    Attributes:
        directory: of the case.
        bag: that the recorder writes.
        environment: of all processes.
        nodes: by name.
        probe: the suite's own node.
        remarks: what is wrong; with any the case fails.
        begun: wall time at which the fault began, s.
    """

    nodes: dict[str, NodeProcess]
    probe: "Probe"

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.bag = directory / "bag"
        self.environment = ros_environment()
        self.remarks: list[str] = []
        self.begun = 0.0
        self._beside: list[NodeProcess] = []

    def begins(self, earlier: float = 0.0) -> None:
        """Say that the fault begins now, and not when it was prepared.

        Args:
            earlier: s by which the nodes may have seen it before the suite did.
        """
        self.begun = time.monotonic() - earlier

    def restart(self, name: str) -> None:
        """Start a node again that was killed."""
        self.nodes[name].start()

    def end_beside(self) -> None:
        """End the nodes that nobody has asked for."""
        for process in self._beside:
            process.end()
        self._beside.clear()

    def end_nodes(self, order: Sequence[str]) -> None:
        """End every node, those first that nobody has asked for, and remark who does not."""
        self.end_beside()
        for name in order:
            if self.nodes[name].code is None and not self.nodes[name].end():
                self.remark(f"{name} did not end when it was asked to")

    def wait_until(self, condition: Callable[[], object], seconds: float) -> bool:
        """Wait for ``condition``, at most ``seconds``; return whether it came true."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            time.sleep(LOOK)
        return True

    def remark(self, text: str) -> None:
        """Note something that is wrong: the case fails."""
        self.remarks.append(text)
