"""A running loop that faults are put into: its processes, and the suite's own node."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from stiction_ros.loop import LoopModel
from stiction_studies.faults.loop.faulted import FaultedLoop
from stiction_studies.faults.loop.node_process import NodeProcess
from stiction_studies.faults.loop.setting_up import NAMES, Asked, case_parameters, plant_model
from stiction_studies.faults.observation import Known, Sampled
from stiction_studies.faults.terms import Pace, Phase

STARTED = ("recorder", "estimator", "controller", "plant")
ENDED = ("plant", "controller", "estimator", "recorder")  # who still has readers goes first
TALKER = {"pv": "plant", "sp": "plant", "op": "controller", "op_applied": "plant"}


class RunningLoop(FaultedLoop):
    """The loop of one case, as the functions of the catalogue see it."""

    def __init__(
        self, fault: Asked, pace: Pace, phase: Phase, seed: int, speed: float, directory: Path
    ) -> None:
        """Prepare parameters and join the domain; :meth:`start` starts the nodes."""
        from stiction_studies.faults.loop.fault_probe import Probe

        super().__init__(directory)
        self.pace, self.phase, self.seed = pace, phase, seed
        self.model: LoopModel = plant_model()
        self.step = round(self.model.sample_time * 1e9)
        self.period = self.model.sample_time / speed if pace is Pace.REALTIME else 0.0
        self._parameters = case_parameters(fault, pace, seed, speed, self.bag)
        remaps: dict[str, list[str]] = {name: [] for name in NAMES}
        for topic in fault.relayed:
            remaps[TALKER[topic]] += ["-r", f"{topic}:={topic}_direct"]
        self.nodes = {
            name: NodeProcess(name, values, directory, self.environment, remaps[name])
            for name, values in self._parameters.items()
        }
        self.probe = Probe(self.environment)
        for topic in fault.relayed:
            self.probe.relay(topic)

    # ---- processes -------------------------------------------------------------------------

    def start(self) -> None:
        """Start every node."""
        for name in STARTED:
            self.nodes[name].start()

    def stop(self) -> None:
        """End every node and leave the domain."""
        self.end_nodes(ENDED)
        self.probe.close()

    def beside(self, kind: str, name: str, parameters: Mapping[str, Any] | None = None) -> None:
        """Start one more node of ``kind`` that nobody has asked for."""
        values = {**self._parameters[kind], "wait_for": [], **(parameters or {})}
        extra = NodeProcess(
            kind,
            values,
            self._folder(f"beside_{len(self._beside)}"),
            self.environment,
            name="" if name == kind else name,
        )
        extra.start()
        self._beside.append(extra)

    # ---- time ------------------------------------------------------------------------------

    def wait(self, seconds: float) -> None:
        """Let ``seconds`` of wall time pass."""
        time.sleep(seconds)

    def wait_samples(self, count: int, seconds: float = 20.0) -> bool:
        """Wait until ``count`` more measurements have come."""
        taken = self.heard("pv")
        have = len(taken)
        return self.wait_until(lambda: len(taken) >= have + count, seconds)

    # ---- what was heard --------------------------------------------------------------------

    def heard(self, topic: str) -> list[Sampled]:
        """Return what came so far on pv, op or op_applied; it grows."""
        return self.probe.heard[topic]

    def last(self, topic: str) -> Sampled:
        """Return the newest message of pv, op or op_applied; nominal before the first."""
        taken = self.heard(topic)
        if taken:
            return taken[-1]
        names = self.names(topic)
        nominal = self.model.pv_start if topic == "pv" else self.model.stem_start
        return Sampled(time.monotonic(), 0, tuple(float(v) for v in nominal[: len(names)]))

    def names(self, topic: str) -> tuple[str, ...]:
        """Return the tags of a topic."""
        inputs = topic in ("op", "op_applied", "stem")
        return self.model.valve_names if inputs else self.model.outputs

    @property
    def known(self) -> Known:
        """Mode and frictions that the controller has told last."""
        return self.probe.known

    # ---- what is said ----------------------------------------------------------------------

    def say(
        self,
        topic: str,
        values: object = None,
        *,
        offset: float = 0.0,
        stamp: int | None = None,
        names: tuple[str, ...] | None = None,
        frame_id: str = "",
    ) -> None:
        """Publish one message that should not be there.

        Args:
            topic: pv, sp, op, op_applied, dv, stem or stiction.
            values: one for all tags, or a list; the newest PV or OP unless given.
            offset: s from the stamp of the newest measurement.
            stamp: in place of that, ns.
            names: tags; those of the topic unless given.
            frame_id: of the header.
        """
        tags = self.names(topic) if names is None else names
        if values is None:
            row = list(self.last("op_applied" if topic in ("op", "op_applied") else "pv").values)
        elif isinstance(values, list | tuple):
            row = [float(value) for value in values]
        else:
            row = [float(str(values))] * len(tags)
        at = self.last("pv").stamp + round(offset * 1e9) if stamp is None else stamp
        self.probe.signal(topic, max(at, 0), tags, row, frame_id)

    def offer(self, model: LoopModel, later: float = 0.0) -> None:
        """Publish a loop model that is valid from the present sample on, or ``later`` s."""
        valid_from = self.last("pv").stamp + round(later * 1e9)
        self.offer_text(model.to_yaml(valid_from=max(valid_from, 0)))

    def offer_text(self, text: str) -> None:
        """Publish any text as a loop model."""
        self.probe.text("loop_model", text)

    def _folder(self, name: str) -> Path:
        folder = self.directory / name
        folder.mkdir(exist_ok=True)
        return folder
