"""``stiction demo opcua``: the tank behind a control system, under the operator's grant."""

import asyncio
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiction_ros.cli.shared.node_processes import NodeError, NodeProcesses
from stiction_ros.cli.shared.progress import Bar
from stiction_ros.cli.shared.scenarios import bridged_nodes, find
from stiction_ros.opcua import require_asyncua

if TYPE_CHECKING:
    from asyncua import Client

    from stiction_studies.control_system.process import PlantProcess

NAME = "opcua"
SPEED = 600.0  # simulated seconds per second: ten samples, two encrypted calls for each OP
RATE = 0.25  # % per s of the plant: 15 % a sample, as the kicks against 8 % of stiction need
WATCHDOG = 5.0  # s
ROUND = 620  # samples of a round of the set-points
GRANTED = ROUND + 560  # in the last hold of the round after that in which all are ready
START = 5 * ROUND  # scans until which the nodes must have found one another
LATEST = ROUND  # after that, when the friction must have been found
HOLD = 80  # samples into a round: within a hold, where no move of a set-point moves OP
WATCHED = 186  # samples for which the plant's PIs are watched afterwards
SILENCE = 60.0  # s without a scan after which the run is given up
USERS = ("bridge", "operator")


def require() -> None:
    """Raise InputError when what the demonstration needs is not installed."""
    require_asyncua()


def run(directory: Path, seed: int | None, speed: float | None, show: Bar) -> bool:
    """Run it into an empty ``directory`` and print what came of it; return whether it is good."""
    from stiction_studies.control_system.process import PlantError
    from stiction_studies.pages.opcua_report import report_opcua

    plant = _plant(directory, seed or 1, SPEED if speed is None else speed)
    processes = NodeProcesses(_nodes(directory, plant), directory)
    begin = time.monotonic()
    try:
        try:
            plant.start()
            processes.start()
            asyncio.run(_operate(plant, processes, show))
        finally:
            processes.stop()
            plant.stop()
        processes.check()
    except (NodeError, PlantError) as failure:
        print(f"stiction: {NAME}: {failure}; see {directory / 'log'}", file=sys.stderr)
        return False
    show(0.95, f"{NAME}: reporting")
    summary = report_opcua(directory / "bag", directory, ROUND, time.monotonic() - begin)
    show(1.0)
    for line in summary["story"]:
        print(f"{NAME}: {line}")
    print(directory / "report.html")
    return bool(summary["status"] == "ok")


def _plant(directory: Path, seed: int, speed: float) -> "PlantProcess":
    """Return the simulated plant; its clock begins now."""
    from stiction_studies.control_system.process import PlantOptions, PlantProcess

    start = int(time.time()) * 1_000_000_000
    options = PlantOptions(speed, WATCHDOG, RATE, seed=seed, start=start)
    return PlantProcess(directory, options, USERS)


def _nodes(directory: Path, plant: "PlantProcess") -> dict[str, dict[str, Any]]:
    """Return the parameters of the four nodes: those of the scenario tank, and the bridge."""
    nodes = bridged_nodes(find("tank"), directory, "opcua", speed=plant.options.speed)
    nodes["opcua"] = plant.node_parameters() | {
        "write": ["tank"],
        "ask": "start",
        "wait_for": [name for name in nodes if name != "opcua"],
    }
    return nodes


async def _operate(plant: "PlantProcess", processes: NodeProcesses, show: Bar) -> None:
    """Play the operator: grant it once the friction is found, take it back, watch the PIs."""
    from asyncua import ua

    from stiction_ros.opcua.session import describe, open_client

    client = await open_client(plant.url, plant.credentials("operator"))
    try:
        operator = _Operator(client, plant, processes, show)
        await operator.prepare()
        begun = await operator.until(0, "the nodes start", operator.ready) // ROUND * ROUND
        grant = begun + GRANTED
        found = await operator.until(grant, "the plant's PIs cycle", operator.identified)
        await operator.choose("ROUT")
        end = -(-found // ROUND) * ROUND + ROUND + HOLD
        await operator.until(end, "the operator has granted it")
        await operator.choose("AUTO")
        await operator.until(end + WATCHED, "the operator has taken it back")
    except (ua.UaError, OSError, TimeoutError) as error:
        raise NodeError(f"the operator's session was lost: {describe(error)}") from None
    finally:
        await client.disconnect()


class _Operator:
    """Sees the plant's scans and the controller's log, and chooses the mode."""

    def __init__(
        self, client: "Client", plant: "PlantProcess", processes: NodeProcesses, show: Bar
    ) -> None:
        self._client, self._plant = client, plant
        self._processes, self._show = processes, show

    async def prepare(self) -> None:
        """Find the tags."""
        from stiction_ros.opcua.session import node_ids
        from stiction_studies.control_system.tags import NAMESPACE

        tags = [f"nsu={NAMESPACE};s={name}" for name in ("LOOP.ALIVE", "LOOP.TARGET")]
        found = await node_ids(self._client, tags)
        self._scans, self._target = (self._client.get_node(found[tag]) for tag in tags)

    def ready(self) -> bool:
        """Return whether the nodes have found one another; the plant scans all the time."""
        return "opcua is ready" in self._log_of("opcua")

    def identified(self) -> bool:
        """Return whether the controller works with a friction that was found."""
        text = self._log_of("controller")
        return ": embedding, " in text or ": inversion, " in text

    def _log_of(self, name: str) -> str:
        log = self._processes.directory / "log" / f"{name}.log"
        return log.read_text(encoding="utf-8") if log.exists() else ""

    async def until(self, scan: int, what: str, also: Any = None) -> int:
        """Wait for a scan, and for ``also``; return the scan that it has come to.

        Raises:
            NodeError: a process has ended, nothing moves, or ``also`` never comes.
        """
        last, moved = -1, time.monotonic()
        while True:
            self._plant.require_running()
            self._processes.require_running()
            now = int(await self._scans.read_value())
            if now != last:
                last, moved = now, time.monotonic()
            if now >= scan and (also is None or also()):
                return now
            if also is not None and now > (scan + LATEST if scan else START):
                raise NodeError(f"waited in vain until scan {now} while {what}")
            if time.monotonic() - moved > SILENCE:
                raise NodeError(f"the plant stands still at scan {now}")
            share = now / (3 * ROUND + HOLD + WATCHED)
            self._show(min(0.94, share), f"{NAME}: {what}")
            await asyncio.sleep(0.2)

    async def choose(self, mode: str) -> None:
        """Choose a mode for the plant's controllers."""
        from asyncua import ua

        value = ua.DataValue(ua.Variant(mode, ua.VariantType.String))
        await self._target.write_value(value)
