"""The worlds of the calibration, and the command that fits the probability to them."""

import json
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_ros.identification.judgement import definitions
from stiction_studies.calibration.loops import WORLDS
from stiction_studies.calibration.plain_loops import plain_loop
from stiction_studies.commands import calibrate


def test_the_command_offers_every_world() -> None:
    assert set(calibrate.SEEDS) == set(WORLDS)


@pytest.mark.parametrize("world", [name for name in WORLDS if name != "field"])
def test_a_seed_makes_the_same_record_again(world: str) -> None:
    one, other = WORLDS[world](3).record, WORLDS[world](3).record
    assert np.array_equal(one.op, other.op)
    assert np.array_equal(one.pv, other.pv)
    assert (one.sp is None) is (world == "cascade")


def test_a_record_begins_in_a_settled_cycle() -> None:
    """A first push would tell which valves stick."""
    for seed in range(20):
        loop = plain_loop(seed, law="he", sensor="plain", world="quiet")
        if loop.friction:
            op = loop.record.op[:, 0]
            assert np.ptp(op[:100]) < 1.5 * np.ptp(op[100:])


@pytest.mark.trial
def test_trees_are_fitted_to_a_log_and_written(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    log, out = tmp_path / "log.jsonl", tmp_path / "trees.json"
    rows = []
    for seed in range(80):
        friction = bool(seed % 2)
        values = random.standard_normal(len(definitions())) + 2.0 * friction
        figures = dict(zip(definitions(), values.tolist(), strict=True))
        rows.append(
            {"full": True, "world": "plain", "seed": seed, "friction": friction}
            | {"figures": figures}
        )
    log.write_text("\n".join(map(json.dumps, rows)) + "\n", "utf-8")
    call = [
        "calibrate",
        "--worlds",
        "plain",
        "--seeds",
        "0:79",
        "--log",
        str(log),
        "--out",
        str(out),
    ]
    assert main(call) == 0
    assert json.loads(out.read_text("utf-8"))["loops"] == 80
