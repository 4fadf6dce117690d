"""The topics and the status of one bridged loop."""

from array import array

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from stiction_ros.nodes.shared.managed import LATCHED_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import joint_state
from stiction_ros.nodes.shared.peers import Outlet
from stiction_ros.online.input.op_port import Reception
from stiction_ros.opcua.grant import Grant
from stiction_ros.opcua.loop_bridge import LoopBridge
from stiction_ros.opcua.sampling import PlantSample, TagQuality

COUNTED = ("past", "ahead", "late", "bad", "skipped", "new_runs")
SHOWN = 3  # refused tags that a status names


class LoopTopics:
    """Publishes samples of one loop and tells how it fares."""

    def __init__(self, node: ManagedNode, bridge: LoopBridge) -> None:
        """Create the topics of what the loop has, in the namespace of its tags."""
        self._bridge, self._tags = bridge, bridge.tags
        space = f"{self._tags.namespace}/" if self._tags.namespace else ""
        self._outputs = [output.name for output in self._tags.outputs]
        self._valves = [valve.name for valve in self._tags.valves]
        self._measured = [one.name for one in self._tags.disturbances]

        def outlet(name: str, *readers: str) -> Outlet:
            return node.outlet(JointState, f"{space}{name}", SIGNAL_QOS, readers)

        self._pv = outlet("pv", "controller", "estimator")
        self._applied = outlet("op_applied")
        has_sp = any(one.sp for one in self._tags.outputs)
        self._sp = outlet("sp", "controller") if has_sp else None
        self._dv = outlet("dv", "controller") if self._measured else None
        self._grant: Outlet | None = None
        if bridge.rules.writes:
            self._grant = node.outlet(String, f"{space}grant", LATCHED_QOS)
        self._told: Grant | None = None
        self._last: PlantSample | None = None

    def publish(self, sample: PlantSample, by: str) -> None:
        """Publish a sample; pv, which the partners act on, comes last.

        ``velocity`` of ``pv`` is the age of each value in s, ``effort`` its quality; ``frame_id``
        of ``op_applied`` is ``by``, the full name of the node whose OP is in force.
        """
        self._last, stamp = sample, sample.stamp
        if np.isfinite(sample.op_before).all():
            before = stamp - self._tags.sample_ns
            applied = joint_state(before, self._valves, sample.op_before)
            applied.header.frame_id = by
            self._applied.publish(applied)
        if self._dv is not None:
            self._dv.publish(joint_state(stamp, self._measured, sample.dv))
        if self._sp is not None and np.isfinite(sample.sp).all():
            self._sp.publish(joint_state(stamp, self._outputs, sample.sp))
        message = joint_state(stamp, self._outputs, sample.pv)
        message.velocity = array("d", sample.pv_age)
        message.effort = array("d", [float(one) for one in sample.pv_quality])
        self._pv.publish(message)

    def changed_grant(self) -> Grant | None:
        """Publish the grant when its state or reason is new, and return it then."""
        grant, before = self._bridge.grant, self._told
        if before is not None and (grant.state, grant.reason) == (before.state, before.reason):
            return None
        self._told = grant
        if self._grant is not None and (before is None or grant.state is not before.state):
            self._grant.publish(String(data=grant.state.value))
        return grant

    def health(self, now: float) -> tuple[str, str, list[tuple[str, object]]]:
        """Return level, message and values of the loop's status."""
        bridge = self._bridge
        sampler, grant = bridge.sampler, bridge.grant
        present = sampler.clock.now(now)
        values = grant_keys(grant)
        if present is not None:
            values.append(("plant_time", f"{present / 1e9:.3f}"))
        modes = [
            (f"mode:{v.name}", sampler.latest(v.mode).value) for v in self._tags.valves if v.mode
        ]
        values += [*modes, *((key, sampler.counts[key]) for key in COUNTED)]
        values += sorted(bridge.counts.items())
        values += [
            (f"refused_op:{one.value}", bridge.op_port.counts[one])
            for one in Reception
            if bridge.op_port.counts[one] and one is not Reception.TAKEN
        ]
        values.append(("refused_tags", len(bridge.refused)))
        refused, more = bridge.refused[:SHOWN], len(bridge.refused) - SHOWN
        said = "; ".join((*refused, f"and {more} more") if more > 0 else refused)
        if bad := said or self._bad_values():
            return "error", bad, values
        if bridge.rules.writes:
            values += bridge.rate_watch.keys()
        cut = bridge.rate_watch.text() if grant.may_write else ""
        if cut:
            return "warn", cut, values
        waits = grant.wanted and not grant.requesting
        return "warn" if waits else "ok", f"{grant.state.value}: {grant.reason}", values

    def _bad_values(self) -> str:
        if self._last is None:
            return "no sample yet"
        pairs = zip(self._outputs, self._last.pv_quality, self._last.pv, strict=True)
        found = [
            f"{name} {quality.name.lower() if quality is not TagQuality.GOOD else 'no number'}"
            for name, quality, value in pairs
            if not np.isfinite(value)
        ]
        return "PV not usable: " + ", ".join(found) if found else ""


def grant_keys(grant: Grant) -> list[tuple[str, object]]:
    """Return a grant as keys and values of a status."""
    return [("grant", grant.state.value), ("reason", grant.reason), ("wanted", grant.wanted)]
