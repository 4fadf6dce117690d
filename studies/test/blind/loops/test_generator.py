"""Blind loops: repeatable, finite, and silent about what is hidden."""

import json
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_studies.blind.loops.base_loops import KINDS, base_loop
from stiction_studies.blind.loops.causes import CAUSES
from stiction_studies.blind.loops.generator import blind_loop, write_blind_loop
from stiction_studies.blind.loops.truth import FAMILIES
from stiction_studies.blind.pi_stability import closed_loop_radius

SHIFTED = 37  # a seed with a time shift
every_family = pytest.mark.parametrize("family", FAMILIES)


@every_family
def test_the_seed_decides_everything(family: str) -> None:
    (one, truth), (two, again) = (blind_loop(31, family) for _ in range(2))
    assert np.array_equal(one.record.pv, two.record.pv)
    assert np.array_equal(one.record.op, two.record.op)
    assert truth == again


@every_family
def test_families_of_one_seed_are_different_loops(family: str) -> None:
    others = [blind_loop(31, other)[0].record for other in FAMILIES if other != family]
    record = blind_loop(31, family)[0].record
    assert all(len(o) != len(record) or not np.array_equal(o.op, record.op) for o in others)


@every_family
@pytest.mark.parametrize("seed", range(500, 505))
def test_nothing_that_is_hidden_can_be_seen(family: str, seed: int) -> None:
    seen, truth = blind_loop(seed, family)
    document = seen.model.to_mapping()
    outputs = document["process"]["outputs"]
    assert all(not valve["effects"] for valve in document["valves"])
    assert not {"disturbances", "sensors", "provenance"} & document.keys()
    assert not any({"effects", "noise"} & output.keys() for output in outputs)
    assert seen.record.stem is None
    assert not seen.record.notes
    assert truth.cause not in (seen.record.name, seen.model.name)


@every_family
@pytest.mark.parametrize("seed", range(500, 505))
def test_a_loop_stays_in_its_range(family: str, seed: int) -> None:
    record = blind_loop(seed, family)[0].record
    assert 1200 <= len(record) <= 2000
    assert np.all((record.op >= 0.0) & (record.op <= 100.0))
    assert np.all(record.pv.std(axis=0) > 0.0)


@pytest.mark.trial
def test_many_seeds_bring_every_cause_and_healthy_loops() -> None:
    causes = [blind_loop(seed)[1].cause for seed in range(600, 625)]
    assert 0.0 < causes.count("none") / len(causes) < 0.4
    assert len(set(causes)) > 8
    assert set(causes) <= {"none", *CAUSES}


def test_two_effects_are_two() -> None:
    for seed in range(500, 505):
        truth = blind_loop(seed, "two")[1]
        assert len(truth.names) == 2


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tight", [False, True])
def test_a_base_loop_is_stable_and_tight_ones_barely(kind: str, tight: bool) -> None:
    for seed in range(5):
        loop = base_loop(np.random.default_rng([seed, 7]), kind, tight=tight)
        sample_time = loop.model.sample_time
        gains = np.array([t.gain for t in loop.tunings])
        times = np.array([t.integral_time for t in loop.tunings]) / sample_time
        radius = closed_loop_radius(loop.model.process.linear(sample_time), gains, times)
        assert radius < 1.0
        if tight:
            assert np.exp(-1.0 / 30.0) < radius


def test_the_answer_lies_apart_from_the_loop(tmp_path: Path) -> None:
    write_blind_loop(501, "single", tmp_path / "seen", tmp_path / "answers")
    assert sorted(p.name for p in (tmp_path / "seen").iterdir()) == [
        "model.loop.yaml",
        "record.csv",
    ]
    answer = json.loads((tmp_path / "answers" / "single_501.json").read_text())
    seen, truth = blind_loop(501)
    assert answer["cause"] == truth.cause
    assert [entry["place"] for entry in answer["hidden"]] == [h.place for h in truth.hidden]
    model = LoopModel.load(tmp_path / "seen" / "model.loop.yaml")
    assert model.to_mapping() == seen.model.to_mapping()
    header = (tmp_path / "seen" / "record.csv").read_text().splitlines()[0]
    assert "STEM" not in header


@pytest.mark.parametrize(("seed", "family"), [(-1, "single"), (1, "triple")])
def test_a_wrong_seed_or_family_is_refused(seed: int, family: str) -> None:
    with pytest.raises(InputError):
        blind_loop(seed, family)


def test_a_time_shift_leaves_op_as_it_was_and_delays_pv() -> None:
    seen, truth = blind_loop(SHIFTED)
    assert truth.cause == "data time_shift"
    shift = int(truth.hidden[0].behaviour.shift)  # type: ignore[attr-defined]
    assert shift >= 1
    assert np.all(seen.record.pv[:shift] == seen.record.pv[0])
    assert seen.record.pv[shift, 0] == seen.record.pv[0, 0]
