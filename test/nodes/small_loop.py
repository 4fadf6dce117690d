"""A small scenario with fits and a swap, quick enough for tests."""

from pathlib import Path

import yaml

from stiction_ros.config_files import find_config

SAMPLES = 420
SCHEDULE = {"fit_first": 300, "fit_every": 50, "fit_latency": 5}


def write_small_scenario(directory: Path, samples: int = SAMPLES) -> Path:
    """Write the scenario ``small`` below ``directory`` and return its file."""
    path = find_config("siso.scenario.yaml")
    nodes = yaml.safe_load(path.read_text(encoding="utf-8"))
    for node in nodes.values():
        values = node["ros__parameters"]
        for key in ("model", "set_points"):
            if key in values:
                values[key] = str(path.parent / values[key])
    nodes["plant"]["ros__parameters"]["samples"] = samples
    nodes["controller"]["ros__parameters"].update(SCHEDULE, horizon=30)
    nodes["estimator"]["ros__parameters"].update(SCHEDULE, window=300, delay_low=4, delay_high=6)
    small = directory / "small.scenario.yaml"
    small.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    return small
