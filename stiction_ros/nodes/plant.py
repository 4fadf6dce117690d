"""The simulated plant: publishes pv (and sp), holds op, and owns the simulated time."""

import dataclasses
import functools
import time
from collections import Counter
from typing import Any

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from stiction_ros.config_files import find_config
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel, Plant, SetPoints, read_valve_changes
from stiction_ros.loop.member_loops import MemberLoop, Wiring, read_member_loops
from stiction_ros.nodes.shared.managed import LOOKS, READER_QOS, SIGNAL_QOS, ManagedNode
from stiction_ros.nodes.shared.messages import SECOND, joint_state, to_ns, to_stamp, values_of
from stiction_ros.nodes.shared.peers import Outlet, publishers_of
from stiction_ros.online.health import stopped_after
from stiction_ros.online.input.op_port import OpPort, Reception
from stiction_ros.online.plain_settings import PlantNodeSettings
from stiction_ros.online.round_trips import RoundTrips, TickGrid

AGAIN = 1.0  # s after which a sample in lockstep is shown again
UNEASY = 3.0  # s without op after which a run in lockstep says so


@dataclasses.dataclass
class JoinedLoop:
    """One loop of the plant: its topics, its OP in force, and when its controller was heard."""

    loop: MemberLoop
    op_port: OpPort
    op: FloatArray
    applied: JointState
    op_applied: Outlet
    pv: Outlet
    sp: Outlet | None = None
    stem: Outlet | None = None
    dv: Outlet | None = None
    given: bool = False
    heard: float = dataclasses.field(default_factory=time.monotonic)

    def topic(self, name: str) -> str:
        """Return the name of one of its topics."""
        return f"{self.loop.name}/{name}" if self.loop.name else name


class PlantNode(ManagedNode):
    """Thin shell around :class:`stiction_ros.loop.Plant`."""

    settings: PlantNodeSettings

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("plant", PlantNodeSettings, **kwargs)

    def configure(self) -> None:
        settings = self.settings
        model = self.needed("model", "loop model", "*.loop.yaml")
        self.model = LoopModel.load(find_config(model))
        self.schedule = None
        if settings.set_points:
            path = find_config(settings.set_points)
            self.schedule = SetPoints.load(path, self.model.outputs)
        changes = read_valve_changes(
            settings.valve_changes, self.model.valve_names, "plant: valve_changes"
        )
        self.plant = Plant(self.model, settings.seed, changes)
        self._step = round(self.model.sample_time * SECOND)
        self._start = SECOND  # simulated time of the first sample
        self.stamp = self._start
        self._realtime = settings.pace == "realtime"
        loops = read_member_loops(settings.loops, self.model, "plant: loops")
        whole = MemberLoop("", self.model.valve_names, self.model.outputs)
        self.wiring = Wiring(self.model, loops or [whole])
        self.round_trips = RoundTrips()
        self._grid, self._repeats = TickGrid(), 0
        self._shown = time.monotonic()
        self._every = -(-settings.samples // 100)  # a hundred lines of progress
        self._clock_out = self.outlet(Clock, "/clock", SIGNAL_QOS)
        self._loops = [self._join(loop) for loop in self.wiring.loops]

    def _join(self, loop: MemberLoop) -> JoinedLoop:
        """Create the topics of one loop, in the namespace of its name."""
        space = f"{loop.name}/" if loop.name else ""  # of one loop alone: that of the plant
        controller, estimator = f"{space}controller", f"{space}estimator"
        commander = self.commander(loop.name) if self.settings.commander else ""
        op = self.wiring.op_of(loop)
        joined = JoinedLoop(
            loop,
            op_port=OpPort(commander, self._step, exact=not self._realtime),
            op=op,
            # What was in force before the run: a reader knows the OP of its first sample.
            applied=joint_state(self._start - self._step, loop.valves, op),
            op_applied=self.outlet(JointState, f"{space}op_applied", SIGNAL_QOS),
            pv=self.outlet(JointState, f"{space}pv", SIGNAL_QOS, (controller, estimator)),
        )
        if self.schedule is not None:
            joined.sp = self.outlet(JointState, f"{space}sp", SIGNAL_QOS, (controller,))
        if set(loop.valves) <= set(self.model.valve_names):
            joined.stem = self.outlet(JointState, f"{space}stem", SIGNAL_QOS)
        if self.model.process.measured_disturbances:
            joined.dv = self.outlet(JointState, f"{space}dv", SIGNAL_QOS, (controller,))
        take = functools.partial(self._on_op, joined)
        self.inlet(JointState, f"{space}op", take, READER_QOS, (controller,))
        return joined

    def configuration(self) -> dict[str, Any]:
        told = {"seed": self.settings.seed, "model": self.model.to_mapping()}
        return told if self.schedule is None else told | {"set_points": self.schedule.to_mapping()}

    def hardware(self) -> str:
        return self.model.name

    def linked(self) -> None:
        for joined in self._loops:
            joined.heard = time.monotonic()
        self._show_with_clock()
        if self._realtime:
            self._set_pace(self.settings.speed)

    def deactivate(self) -> None:
        self.never("pace")

    def retune(self, settings: PlantNodeSettings) -> None:
        if "pace" in self.regular and settings.speed != self.settings.speed:
            self._set_pace(settings.speed)

    def partner_lost(self, name: str, what: str) -> None:
        self.end(
            f"{name} {what} at sample {self.plant.sample}; "
            "a run in lockstep cannot go on without it, start all nodes again"
        )

    @property
    def _silent(self) -> JoinedLoop:
        """The loop whose controller has been silent for longest."""
        return min(self._loops, key=lambda joined: joined.heard)

    # ---- diagnostics -----------------------------------------------------------------------

    def health(self) -> tuple[str, str, list[tuple[str, object]]]:
        ports = [joined.op_port for joined in self._loops]
        counts: Counter[Reception] = sum((port.counts for port in ports), Counter())
        keys: list[tuple[str, object]] = [
            ("sample", self.plant.sample),
            ("pace", self.settings.pace),
            ("commander", ", ".join(port.commander for port in ports)),
            ("op_age", f"{time.monotonic() - self._silent.heard:.3f}"),
            ("late_op", counts[Reception.LATE]),
            ("unanswered", self.round_trips.asked - self.round_trips.answered),
        ]
        refused = [r for r in Reception if r not in (Reception.TAKEN, Reception.LATE)]
        keys += [(f"refused_op:{one.value}", counts[one]) for one in refused]
        if self._realtime:
            keys.append(("missed_ticks", int(self._grid.missed)))
            times = self.round_trips.milliseconds()
            keys += [(f"pv_to_op_ms_{name}", f"{value:.3f}") for name, value in times.items()]
        else:
            keys.append(("shown_again", self._repeats))
        return "ok", "finished" if self.finished else "running", keys

    def look(self) -> None:
        now = time.monotonic()
        silent = now - self._silent.heard
        commander = self._silent.op_port.commander or "anyone"
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
            for joined in self._loops:
                commander = joined.op_port.commander
                same = publishers_of(self, joined.topic("op")).count(commander)
                if same > 1:
                    text = f"{same} nodes called {commander} publish op"
                    self.notice("commanders", "error", text)

    # ---- samples ---------------------------------------------------------------------------

    def _on_op(self, joined: JoinedLoop, message: JointState) -> None:
        if not self.running:
            return
        sender, stamp = message.header.frame_id, to_ns(message.header.stamp)
        op = values_of(message, joined.loop.valves)
        found = joined.op_port.judge(sender, stamp, op, self.stamp)
        complaint = joined.op_port.complaint(found, sender)
        if complaint:
            self.notice(found.value, "warn", complaint)
        if op is None or found is Reception.NAME:
            return
        self.round_trips.answer(stamp, time.monotonic())  # also of one that is refused as late
        if found not in (Reception.TAKEN, Reception.LATE):
            return
        joined.op, joined.given, joined.heard = op, True, time.monotonic()
        if not self._realtime and all(one.given for one in self._loops):
            self._advance()

    def _set_pace(self, speed: float) -> None:
        period = self.model.sample_time / speed
        self._grid.begin(period, time.monotonic())
        self.every(period, "pace", self._tick)

    def _tick(self) -> None:
        """Go on by one sample; ticks keep to a grid of wall time that a late one begins anew."""
        if not self.running:
            return
        before = self._grid.missed
        if self._grid.tick(time.monotonic()):
            self.regular["pace"].reset()
            if int(self._grid.missed) > int(before):
                self.notice("pace", "warn", "the plant is slower than its speed asks for")
        self._advance()

    def _advance(self) -> None:
        stems = self.plant.apply(self.wiring.take([joined.op for joined in self._loops]))
        stem = dict(zip(self.model.valve_names, stems, strict=True))
        for joined in self._loops:
            valves, joined.given = joined.loop.valves, False
            joined.applied = joint_state(self.stamp, valves, joined.op)
            if joined.stem is not None:
                joined.stem.publish(joint_state(self.stamp, valves, [stem[tag] for tag in valves]))
        self.stamp = self._start + self.plant.sample * self._step
        if self.plant.sample == self.settings.samples:
            for joined in self._loops:
                joined.op_applied.publish(joined.applied)
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
        sp = None
        if self.schedule is not None:
            sp = self.wiring.set_points(self.schedule.at(measured.time))
        for joined in self._loops:
            joined.op_applied.publish(joined.applied)
            if joined.dv is not None:
                names = self.model.process.measured_disturbances
                joined.dv.publish(joint_state(self.stamp, names, measured.dv))
            if joined.sp is not None and sp is not None:
                shown = self.wiring.of(joined.loop, sp)
                joined.sp.publish(joint_state(self.stamp, joined.loop.outputs, shown))
        self._shown = time.monotonic()
        self.round_trips.ask(self.stamp, self._shown)
        for joined in self._loops:
            shown = self.wiring.of(joined.loop, measured.pv)
            joined.pv.publish(joint_state(self.stamp, joined.loop.outputs, shown))
