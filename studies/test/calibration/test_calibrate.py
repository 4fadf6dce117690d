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

ROW = {
    **{"full": False, "family": "single", "given": "exact", "cause": "none", "plant": "flow"},
    **{"circumstances": [], "oracle": [], "wrong": [], "right": True, "silent": True, "sets": 0},
    **{"held": 0, "said": "none", "closed": None, "covered": {}, "seconds": 1.0, "answer": {}},
}


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


def test_the_probability_of_effects_is_fitted_to_a_log_and_written(tmp_path: Path) -> None:
    random = np.random.default_rng(2)
    log, out = tmp_path / "log.jsonl", tmp_path / "gap.json"
    rows = []
    for seed in range(300):
        ahead = float(np.exp(random.uniform(0.0, 8.0)))
        there = random.random() < 1.0 / (1.0 + np.exp(2.0 - np.log1p(ahead)))
        claims = [[ahead, [bool(there), False] if seed % 2 else [bool(there)]]]
        rows.append(ROW | {"seed": seed, "claims": claims})
    log.write_text("\n".join(map(json.dumps, rows)) + "\n", "utf-8")
    assert main(["calibrate", "--gap", str(log), "--out", str(out)]) == 0
    told = json.loads(out.read_text("utf-8"))
    assert told["loops"] == 300
    assert told["fitted_to"] == {"single-exact": [0, 299]}
    assert told["constant"] == pytest.approx(-2.0, abs=0.8)
    assert told["slope"] == pytest.approx(1.0, abs=0.25)
