"""The tags of the simulated plant, and the tag map that bridges it."""

import dataclasses
from typing import Any

from stiction_ros.loop import LoopModel
from stiction_studies.control_system.control_system import AUTO, REMOTE

NAMESPACE = "urn:stiction_ros:plant"
SERVER_URI = "urn:stiction_ros:plant:server"
REMOTE_USE, OPERATION, TESTING = "remote", "operation", "testing"  # rights of users


@dataclasses.dataclass(frozen=True)
class PlantTag:
    """One tag."""

    name: str  # and node id in the plant's namespace
    kind: str  # of its value, a variant type of OPC UA
    initial: Any  # value at the start
    # rights of which a user needs one to write it; none for nobody
    writers: frozenset[str] = frozenset()
    history: bool = False  # whether its values may be kept


class PlantTags:
    """Names of all tags; controller j has PV and SP of output j and OUT of valve j.

    Attributes:
        pv, sp, out, mode, remote: names by controller; ``remote`` is the remote OP.
        faults: by which tests disturb the server: bad quality of PV, stamps s in the past, the
            heartbeat standing still, s that answers take, extra changes of PV a sample, no
            rights of the remote user.
        all, by_name: every tag.
    """

    def __init__(self, model: LoopModel) -> None:
        """Name the tags of a loop with as many valves as outputs."""
        names = [f"{output}C" for output in model.outputs]
        self.pv, self.sp, self.out, self.mode, self.remote = (
            [f"{name}.{key}" for name in names] for key in ("PV", "SP", "OUT", "MODE", "ROUT_IN")
        )
        kinds = ("QUALITY", "PAST", "ALIVE", "DELAY", "BURST", "RIGHTS")
        self.faults = tuple(f"FAULT.{kind}" for kind in kinds)
        remote = frozenset({REMOTE_USE})
        found = [PlantTag(name, "Double", 0.0, history=True) for name in (*self.pv, *self.sp)]
        found += [PlantTag(name, "Double", 0.0, history=True) for name in self.out]
        found += [PlantTag(name, "String", AUTO, history=True) for name in self.mode]
        found += [PlantTag(name, "Double", 0.0, remote) for name in self.remote]
        found += [
            PlantTag("LOOP.REQUEST", "Boolean", False, remote),
            PlantTag("LOOP.BEAT", "UInt32", 0, remote),
            PlantTag("LOOP.ALIVE", "UInt32", 0),
            PlantTag("LOOP.ALARM", "String", ""),
            PlantTag("LOOP.TARGET", "String", AUTO, frozenset({OPERATION})),
        ]
        found += [PlantTag(name, "Double", 0.0, frozenset({TESTING})) for name in self.faults]
        self.all = tuple(found)
        self.by_name = {tag.name: tag for tag in found}


def tag_map_of(model: LoopModel, server: str, rate: float, watchdog: float) -> dict[str, Any]:
    """Return the tag map, as a mapping to be written as YAML, that bridges the plant.

    Args:
        model: of the plant.
        server: address.
        rate: of what is written, % per second of the plant's time.
        watchdog: s on the wall clock.
    """
    tags = PlantTags(model)

    def node(name: str) -> str:
        return f"nsu={NAMESPACE};s={name}"

    outputs = [
        {"name": name, "pv": node(tags.pv[i]), "sp": node(tags.sp[i])}
        for i, name in enumerate(model.outputs)
    ]
    valves = [
        {
            "name": name,
            "op_read": node(tags.out[j]),
            "op": node(tags.remote[j]),
            "mode": node(tags.mode[j]),
            "limits": [float(limit) for limit in model.limits[j]],
            "rate": rate,
        }
        for j, name in enumerate(model.valve_names)
    ]
    write = {
        "request": node("LOOP.REQUEST"),
        "granted": [REMOTE],
        "heartbeat": node("LOOP.BEAT"),
        "alive": node("LOOP.ALIVE"),
        "watchdog": watchdog,
    }
    loop = {
        "loop": model.name,
        "namespace": "",
        "sample_time": model.sample_time,
        "outputs": outputs,
        "valves": valves,
        "write": write,
    }
    return {"server": server, "loops": [loop]}
