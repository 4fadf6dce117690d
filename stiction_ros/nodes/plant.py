"""The simulated plant: publishes pv (and sp), holds op, and owns the simulated time."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel, Plant, SetPoints, read_valve_changes
from stiction_ros.nodes.shared.managed import LOOKS, READER_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import SECOND, joint_state, to_ns, to_stamp, values_of
from stiction_ros.nodes.shared.peers import publishers_of
from stiction_ros.nodes.shared.runner import run
from stiction_ros.nodes.shared.typed import restart
from stiction_ros.online.health import stopped_after
from stiction_ros.online.input.op_port import CommandRules, OpPort, Reception
from stiction_ros.online.plain_settings import PlantNodeSettings
from stiction_ros.online.round_trips import RoundTrips
from stiction_ros.online.tick_grid import TickGrid

AGAIN = 1.0  # s after which a sample in lockstep is shown again
UNEASY = 3.0  # s without op after which a run in lockstep says so


class PlantNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.loop.Plant`."""

    settings: PlantNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        """Build the node ``plant``; ``kwargs`` go to the ROS node."""
        super().__init__("plant", PlantNodeSettings, **kwargs)
        self._pacer: Timer | None = None

    def configure(self) -> None:
        settings = self.settings
        if not settings.model:
            raise InputError("no loop model", where="plant: model", fix="set it to a *.loop.yaml")
        self.model = LoopModel.load(find_config(settings.model))
        self.schedule = None
        if settings.set_points:
            path = find_config(settings.set_points)
            self.schedule = SetPoints.load(path, self.model.outputs)
        changes = read_valve_changes(
            settings.valve_changes, self.model.valve_names, "plant: valve_changes"
        )
        self.plant = Plant(self.model, settings.seed, changes)
        self._op = np.array(self.model.stem_start)
        self._step = round(self.model.sample_time * SECOND)
        self._start = round(settings.start_time * SECOND)
        self.stamp = self._start
        # What was in force before the run: a reader knows the OP of its first sample.
        self._applied = joint_state(self._start - self._step, self.model.valve_names, self._op)
        self._realtime = settings.pace == "realtime"
        rules = CommandRules(self._commander(), self._step, exact=not self._realtime)
        self.op_port, self.round_trips = OpPort(rules), RoundTrips()
        self._missed = self._repeats = 0
        self._heard = self._shown = time.monotonic()
        self._every = -(-settings.samples // 100)  # a hundred lines of progress
        self._clock_out = self.outlet(Clock, "/clock", SIGNAL_QOS)
        self._applied_out = self.outlet(JointState, "op_applied", SIGNAL_QOS)
        self._pv = self.outlet(JointState, "pv", SIGNAL_QOS, ("controller", "estimator"))
        self._sp = None
        if self.schedule is not None:
            self._sp = self.outlet(JointState, "sp", SIGNAL_QOS, ("controller",))
        self._stem = self.outlet(JointState, "stem", SIGNAL_QOS)
        self._dv = None
        if self.model.process.measured_disturbances:
            self._dv = self.outlet(JointState, "dv", SIGNAL_QOS, ("controller",))
        self.inlet(JointState, "op", self._on_op, READER_QOS, ("controller",))

    def _commander(self) -> str:
        """Return the full name of the node that commands; empty for the first that does."""
        name = str(self.settings.commander)
        if not name or name.startswith("/"):
            return name
        return f"{self.get_namespace().rstrip('/')}/{name}"

    def configuration(self) -> dict[str, Any]:
        told = {"seed": self.settings.seed, "model": self.model.to_mapping()}
        return told if self.schedule is None else told | {"set_points": self.schedule.to_mapping()}

    def hardware(self) -> str:
        return self.model.name

    def linked(self) -> None:
        self._heard = time.monotonic()
        self._show_with_clock()
        if self._realtime:
            self._set_pace(self.settings.speed)

    def deactivate(self) -> None:
        if self._pacer is not None:
            self.destroy_timer(self._pacer)
            self._pacer = None

    def retune(self, settings: PlantNodeSettings) -> None:
        if self._pacer is not None and settings.speed != self.settings.speed:
            self.deactivate()
            self._set_pace(settings.speed)

    def partner_lost(self, name: str, what: str) -> None:
        self.end(
            f"{name} {what} at sample {self.plant.sample}; "
            "a run in lockstep cannot go on without it, start all nodes again"
        )

    # ---- diagnostics -----------------------------------------------------------------------

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        counts = self.op_port.counts
        keys: list[tuple[str, object]] = [
            ("sample", self.plant.sample),
            ("pace", self.settings.pace),
            ("commander", self.op_port.commander),
            ("op_age", f"{time.monotonic() - self._heard:.3f}"),
            ("late_op", counts[Reception.LATE]),
            ("unanswered", self.round_trips.asked - self.round_trips.answered),
        ]
        refused = [r for r in Reception if r not in (Reception.TAKEN, Reception.LATE)]
        keys += [(f"refused_op:{one.value}", counts[one]) for one in refused]
        if self._realtime:
            keys.append(("missed_ticks", self._missed))
            times = self.round_trips.milliseconds()
            keys += [(f"pv_to_op_ms_{name}", f"{value:.3f}") for name, value in times.items()]
        else:
            keys.append(("shown_again", self._repeats))
        return "ok", "finished" if self.finished else "running", keys

    def look(self) -> None:
        now = time.monotonic()
        silent = now - self._heard
        commander = self.op_port.commander or "anyone"
        if self._realtime:
            if silent > stopped_after(self.model.sample_time / self.settings.speed):
                self.notice("silent", "error", f"no op from {commander}")
        elif silent > self.settings.op_timeout:
            self.end(
                f"no op from {commander} for sample {self.plant.sample} within "
                f"{self.settings.op_timeout:g} s; check it, or raise op_timeout"
            )
            return
        else:
            if silent > UNEASY:
                self.notice("silent", "warn", f"waiting for op from {commander}")
            if now - self._shown >= AGAIN:
                self._repeats += 1
                self._show()
        if self._looks % LOOKS == 0:
            same = publishers_of(self, "op").count(self.op_port.commander)
            if same > 1:
                text = f"{same} nodes called {self.op_port.commander} publish op"
                self.notice("commanders", "error", text)

    # ---- samples ---------------------------------------------------------------------------

    def _on_op(self, message: JointState) -> None:
        if not self.running:
            return
        sender, stamp = message.header.frame_id, to_ns(message.header.stamp)
        op = values_of(message, self.model.valve_names)
        found = self.op_port.judge(sender, stamp, op, self.stamp)
        complaint = self.op_port.complaint(found, sender)
        if complaint:
            self.notice(found.value, "warn", complaint)
        if op is None or found is Reception.NAME:
            return
        self.round_trips.answer(stamp, time.monotonic())  # also of one that is refused as late
        if found not in (Reception.TAKEN, Reception.LATE):
            return
        self._heard, self._op = time.monotonic(), op
        if not self._realtime:
            self._advance()

    def _set_pace(self, speed: float) -> None:
        period = self.model.sample_time / speed
        self._grid = TickGrid(period, time.monotonic())
        self._pacer = self.create_timer(period, self._tick)

    def _tick(self) -> None:
        """Go on by one sample; ticks keep to a grid of wall time that a late one begins anew."""
        if not self.running:
            return
        before = self._grid.missed
        if self._grid.tick(time.monotonic()):
            if self._pacer is not None:
                restart(self._pacer)
            if self._grid.missed > before:
                self._missed += self._grid.missed - before
                self.notice("pace", "warn", "the plant is slower than its speed asks for")
        self._advance()

    def _advance(self) -> None:
        stem = self.plant.apply(self._op)
        self._applied = joint_state(self.stamp, self.model.valve_names, self._op)
        self._stem.publish(joint_state(self.stamp, self.model.valve_names, stem))
        self.stamp = self._start + self.plant.sample * self._step
        if self.plant.sample == self.settings.samples:
            self._applied_out.publish(self._applied)
            self.running, self.finished = False, True
        else:
            self._show_with_clock()
        if self._every and self.plant.sample % self._every == 0:
            self.log.info(f"sample {self.plant.sample} of {self.settings.samples}")

    def _show_with_clock(self) -> None:
        self._clock_out.publish(Clock(clock=to_stamp(self.stamp)))
        self._show()

    def _show(self) -> None:
        """Publish the present sample; pv, which the partners act on, comes last."""
        measured = self.plant.measure()
        self._applied_out.publish(self._applied)
        if self._dv is not None:
            names = self.model.process.measured_disturbances
            self._dv.publish(joint_state(self.stamp, names, measured.dv))
        if self._sp is not None and self.schedule is not None:
            sp = self.schedule.at(measured.time)
            self._sp.publish(joint_state(self.stamp, self.model.outputs, sp))
        self._shown = time.monotonic()
        self.round_trips.ask(self.stamp, self._shown)
        self._pv.publish(joint_state(self.stamp, self.model.outputs, measured.pv))


def main() -> int:
    """Run the node."""
    return run("plant", "Simulates a loop model with sticky valves.", PlantNode)


if __name__ == "__main__":
    raise SystemExit(main())
