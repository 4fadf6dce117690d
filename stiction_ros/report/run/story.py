"""What a report tells: the run, what is known of the truth, the scores, and ``summary.json``."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from stiction_ros.effects import FrictionPair, SlipJumpPair, Stiction
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.session import Scenario, run_live
from stiction_ros.processes.process import NoiseEntry
from stiction_ros.records.bag.run_metadata import mapping_of
from stiction_ros.records.record import Record
from stiction_ros.records.run.log import RunLog
from stiction_ros.report.run.scoring import Phase, Phases, phases, score
from stiction_ros.texts import finite

TANK_UNITS = {"C": "kg/m³", "T": "°C"}


@dataclasses.dataclass(frozen=True)
class Story:
    """A run of the live loop, ready to be told."""

    name: str  # of the scenario or the bag
    log: RunLog  # what the bag holds
    phases: Phases  # before and after the swap
    stiction_free: Phase | None  # the same moves with ideal valves, None when not simulated
    truth: LoopModel | None  # the loop that the plant node simulated; None for a real plant
    seed: int | None  # of the plant's noise, None when unknown
    round_samples: int | None  # samples of one round of set-points, None when they do not repeat
    units: Mapping[str, str]  # engineering unit of each PV where known

    @property
    def record(self) -> Record:
        """The loop's signals."""
        return self.log.record

    @property
    def swap_time(self) -> float | None:
        """Seconds from the first sample to the first one of the new controller."""
        return None if self.log.swap is None else self.log.seconds(self.log.swap.stamp)

    @property
    def identified(self) -> Mapping[str, Any]:
        """The fit that caused the swap, or the last one; empty when there is none."""
        fit = self.log.fit_at_swap or (self.log.fits[-1] if self.log.fits else None)
        return {} if fit is None else fit.identification

    def true_friction(self, valve: str) -> tuple[float, float] | None:
        """Return f_S and f_D of the simulated plant, (0, 0) for an ideal valve, None if unknown."""
        if self.truth is None:
            return None
        for entry in self.truth.valves:
            if entry.name == valve:
                law = next((e for e in entry.effects if e.effect == Stiction.effect), None)
                if isinstance(law, FrictionPair | SlipJumpPair):
                    return law.static_friction, law.dynamic_friction
                return (0.0, 0.0) if law is None else None
        return None


def tell(log: RunLog, *, scenario: Scenario | None = None, name: str | None = None) -> Story:
    """Score a run; with the ``scenario`` that was run the stiction-free loop is simulated, too."""
    record = log.record
    truth, seed = simulated_plant(log)
    if scenario is not None:
        truth, seed = truth or scenario.plant, scenario.seed if seed is None else seed
    sigma = [0.0] * len(record.outputs)
    if truth is not None and truth.outputs == record.outputs:
        sigma = truth.process.noise_std(NoiseEntry.MEASUREMENT).tolist()
    repeat = round_of(log, scenario)
    found = phases(record, log.swap_sample, repeat, sigma)
    free = None
    if scenario is not None and found.after is not None:
        last = found.after.last
        run = run_live(scenario, seed=seed, samples=last, ideal_valves=True, identify=False)
        period = None if found.cycle is None else found.cycle.period
        free = score(run.run.record, found.after.first, last, period, sigma)
    tank = truth is not None and truth.process.kind == "stirred_tank"
    return Story(
        name or (record.name if scenario is None else scenario.name),
        log,
        found,
        free,
        truth,
        seed,
        repeat,
        TANK_UNITS if tank else {},
    )


def round_of(log: RunLog, scenario: Scenario | None) -> int | None:
    """Return the samples of one round of the set-points; None where they do not repeat.

    It is the scenario's schedule, or else what the node ``plant`` said.
    """
    length = math.inf
    if scenario is not None:
        length = scenario.set_points.repeat
    else:
        schedule = plant_configuration(log).get("set_points")
        repeat = schedule.get("repeat") if isinstance(schedule, dict) else None
        if isinstance(repeat, int | float) and repeat > 0:
            length = repeat
    return round(length / log.record.sample_time) if math.isfinite(length) else None


def simulated_plant(log: RunLog) -> tuple[LoopModel | None, int | None]:
    """Return the loop and the seed that the node ``plant`` published in its configuration."""
    document = plant_configuration(log)
    if not document:
        return None, None
    seed = document.get("seed")
    try:
        model = LoopModel.from_mapping(
            document.get("model"), f"configuration of {document['node']}"
        )
    except InputError:
        model = None
    return model, seed if isinstance(seed, int) else None


def plant_configuration(log: RunLog) -> Mapping[str, Any]:
    """Return what the node ``plant`` said on ``~/config``; empty when it was not there."""
    for config in log.configs:
        document = mapping_of(config.text)
        node = document.get("node")
        if isinstance(node, str) and node.rpartition("/")[2] == "plant":
            return document
    return {}


def summary(story: Story, seconds: float | None = None) -> dict[str, Any]:
    """Return the mapping of ``summary.json``; numbers that do not exist are null.

    Without the wall time in ``seconds`` it is that between first and last publication in the bag.
    """
    log, record, free = story.log, story.record, story.stiction_free
    seconds = log.wall_seconds if seconds is None else seconds
    found, latest = story.phases, log.fits[-1].identification if log.fits else {}
    mapping = {
        "scenario": story.name,
        "status": found.status.value,
        "reason": found.reason,
        "seed": story.seed,
        "samples": len(record),
        "sample_time": record.sample_time,
        "seconds": seconds,
        "samples_per_second": len(record) / seconds if seconds > 0 else None,
        "swap_time": story.swap_time,
        "delay": {o["name"]: dict(o["delay"]) for o in story.identified.get("outputs", [])},
        "valves": list(story.identified.get("valves", [])),
        "valves_latest": list(latest.get("valves", [])),
        "period": None if found.cycle is None else found.cycle.period * record.sample_time,
        "cycles": None if found.cycle is None else found.cycle.count,
        **measured({"before": found.before, "after": found.after, "stiction_free": free}),
        "pv_to_op_ms": dict(log.pv_to_op_ms) or None,
        "messages": messages(log.published, log.recorded),
        "notes": list(log.notes),
    }
    return dict(finite(mapping))


def measured(phases: Mapping[str, Phase | None]) -> dict[str, dict[str, Any]]:
    """Return ``phases``, ``valve_work`` and ``largest_op_step`` of those that there are."""
    there = {n: dataclasses.asdict(phase) for n, phase in phases.items() if phase is not None}
    parts = {"phases": "scores", "valve_work": "work", "largest_op_step": "op_step"}
    return {key: {n: phase[part] for n, phase in there.items()} for key, part in parts.items()}


def messages(
    published: Mapping[str, int], recorded: Mapping[str, int]
) -> dict[str, dict[str, int | None]]:
    """Return ``{topic: {published, recorded}}``; published is None where nobody counts."""
    return {
        topic: {"published": published.get(topic), "recorded": recorded.get(topic, 0)}
        for topic in sorted(published.keys() | recorded.keys())
    }
