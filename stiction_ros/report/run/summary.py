"""``summary.json`` of a run: the figures that acceptance looks at."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from stiction_ros.report.run.scoring import Phase
from stiction_ros.report.run.story import Story
from stiction_ros.texts import finite


def summary(story: Story, seconds: float | None = None) -> dict[str, Any]:
    """Return the mapping of ``summary.json``; numbers that do not exist are null.

    Without the wall time in ``seconds`` it is that between first and last publication in the bag.
    """
    log, record, free = story.log, story.record, story.stiction_free
    seconds = log.wall_seconds if seconds is None else seconds
    found = story.phases
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
        "valves_latest": list(story.latest.get("valves", [])),
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
