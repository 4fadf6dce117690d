"""What wanders by itself, and what a stem does that the model does not."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from gap_loops import loop, record, without_controller

from stiction_ros.discrepancy.data.gate import open_gate
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.gap.noise_effects import noise_effects
from stiction_ros.discrepancy.gap.noise_laws import declared_block, laws_of
from stiction_ros.discrepancy.gap.of_the_stem import relations, with_a_stem
from stiction_ros.discrepancy.likelihood.declared_noise import declared_noise
from stiction_ros.discrepancy.simulation.free_run import FreeRun
from stiction_ros.effects import Backlash, Behaviour, RandomWalkDisturbance
from stiction_ros.loop import LoopModel

WALK = RandomWalkDisturbance(0.15)


def base_of(place: str, effect: Behaviour, model: LoopModel | None = None) -> Baseline:
    """Return the baseline of a model beside a record of the loop with an effect."""
    given = loop() if model is None else model
    recorded = record(given.with_effect(place, effect), seed=4)
    runs, _ = open_gate(without_controller(given), [recorded])
    return Baseline.of(FreeRun(given, runs))


def names(base: Baseline) -> list[tuple[str, str]]:
    declared = declared_noise(base.run.model)[0]
    assert declared is not None
    return [(each.place, each.behaviour.effect) for each in noise_effects(base, 0, declared)]


def test_a_walk_of_the_load_is_named() -> None:
    assert names(base_of("load:V1", WALK))[0] == ("load:V1", "random_walk")


def test_a_stem_behind_a_play_is_no_walk() -> None:
    assert names(base_of("valve:V1", Backlash(6.0))) == []


def test_a_walk_beside_a_stem_that_rests_is_none_that_moves_with_it() -> None:
    base = base_of("load:V1", WALK, loop().with_effect("valve:V1", Backlash(4.0)))
    declared = declared_noise(base.run.model)[0]
    assert declared is not None
    own, laws = declared_block(base, 0, declared), laws_of(base, 0, declared)
    through = min(each.score for each in noise_effects(base, 0, declared))
    assert with_a_stem(base, 0, laws, own) > through


def test_no_stem_rests_where_the_model_has_no_friction() -> None:
    base = base_of("load:V1", WALK)
    declared = declared_noise(base.run.model)[0]
    assert declared is not None
    own, laws = declared_block(base, 0, declared), laws_of(base, 0, declared)
    assert with_a_stem(base, 0, laws, own) == math.inf


def test_an_op_that_stands_still_has_no_relation_to_anything() -> None:
    base = base_of("load:V1", WALK)
    runs = dataclasses.replace(base.run.runs, op=np.full_like(base.run.runs.op, 50.0))
    straight, bent = relations(Baseline.of(FreeRun(base.run.model, runs)), 0)
    assert straight.shape[1] == bent.shape[1] == 0
