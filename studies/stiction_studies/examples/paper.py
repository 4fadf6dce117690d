"""The records of the paper's Examples 1 and 2 (Section 4), one per seed."""

import dataclasses

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions
from stiction_ros.identification.friction import behaviour_of, laws
from stiction_ros.loop import LoopModel, SetPoints
from stiction_ros.online.session import Scenario, run_live
from stiction_ros.processes import NoiseEntry
from stiction_ros.records import Record
from stiction_studies.examples.example import Example

NOISES = tuple(entry.value for entry in NoiseEntry)
PLANTS = ("linear", "tank")
EXAMPLE1_SAMPLES = 2500
EXAMPLE2_ROUND = 620
EXAMPLE2_SAMPLES = 2 * EXAMPLE2_ROUND


def example1(
    seed: int, noise: str = "measurement", samples: int = EXAMPLE1_SAMPLES, law: str = "he"
) -> Example:
    """Return Example 1: process (18), He's valve with f_S = 5 and f_D = 2, 2500 samples of 1 s.

    The stiction-unaware MPC (19) controls; the set-point moves every 250 s, as the cycle
    may stop by itself. Orders are known, n_a = n_b = 3, the delay is one of 0 to 10.

    Args:
        seed: of the white noise, σ = 0.01.
        noise: ``measurement`` adds it to PV as in (2), ``equation`` is v of (9).
        samples: N; a longer record repeats the set-points every 2500 s.
        law: of the valve, one that is given by f_S and f_D.

    Raises:
        InputError: unknown ``noise`` or ``law``.
    """
    _check(noise, NOISES, "noise")
    scenario = Scenario.load(find_config("siso.scenario.yaml"))
    document = scenario.plant.to_mapping()
    document["process"]["outputs"][0]["noise"]["enters"] = noise
    plant = LoopModel.from_mapping(document)
    if law != "he":
        _check(law, tuple(laws()), "law")
        plant = plant.with_valve_effects({"V1": [behaviour_of(law, (5.0, 2.0), {})]})
    schedule = SetPoints.load(find_config("example1.set_points.yaml"), plant.outputs)
    schedule = dataclasses.replace(schedule, repeat=EXAMPLE1_SAMPLES * plant.sample_time)
    scenario = dataclasses.replace(scenario, plant=plant, set_points=schedule)
    record = _record(scenario, seed, samples)
    options = IdentificationOptions("exact", output_order=3, input_order=3, delay=(0, 10))
    return Example("example1", noise, seed, record, plant, options)


def example2(seed: int, plant: str = "linear", samples: int = EXAMPLE2_SAMPLES) -> Example:
    """Return Example 2: two valves, V1 with f_S = 8 and f_D = 1, 1240 samples of 1 min.

    The stiction-unaware MPC on (A.3) controls, with set-point moves of both outputs and
    white noise of variance 1e-4 on both. Delays are known to be 0, orders are left to BIC.
    The schedule of set-points lasts 620 min and is gone through twice: in a few of 100 records
    of one round the valve never slips twice in the same direction, and J = f_S − f_D stays open.

    Args:
        seed: of the noise.
        plant: ``linear`` is (A.3), ``tank`` the nonlinear tank (A.1).
        samples: N; a longer record repeats the set-points every 620 min.

    Raises:
        InputError: unknown ``plant``.
    """
    _check(plant, PLANTS, "plant")
    scenario = Scenario.load(find_config("tank.scenario.yaml"))
    model = scenario.plant
    if plant == "linear":
        frictions = {valve.name: valve.effects for valve in model.valves}
        model = scenario.process.with_valve_effects(frictions)
    schedule = dataclasses.replace(scenario.set_points, repeat=EXAMPLE2_ROUND * model.sample_time)
    scenario = dataclasses.replace(scenario, plant=model, set_points=schedule)
    record = _record(scenario, seed, samples)
    return Example(
        "example2", plant, seed, record, model, IdentificationOptions("exact", delay=(0, 0))
    )


def example2_of_one_round(seed: int, plant: str = "linear") -> Example:
    """Return Example 2 with the schedule gone through once, 620 samples; see :func:`example2`."""
    return example2(seed, plant, EXAMPLE2_ROUND)


def _record(scenario: Scenario, seed: int, samples: int) -> Record:
    run = run_live(scenario, seed=seed, samples=samples, identify=False)
    return run.run.record


def _check(value: str, known: tuple[str, ...], where: str) -> None:
    if value not in known:
        raise InputError(f"unknown value {value!r}", where=where, fix=f"use {' or '.join(known)}")
