import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.loop import LoopModel
from stiction_ros.records.record import Record
from stiction_ros.records.run.events import Fit, ModeChange, Text
from stiction_ros.records.run.log import RunLog

sys.path.insert(0, str(Path(__file__).parents[1] / "survey"))

SECOND = 10**9
SAMPLES, ROUND, SWAP = 1200, 400, 500
PLANT = """
node: /plant
seed: 7
model:
  loop: made_up
  sample_time: 1.0
  valves:
    - {name: V1, effects: [{effect: stiction, law: he, f_s: 5.0, f_d: 2.0}]}
  process:
    kind: arx
    outputs:
      - {name: PV1, a: [-0.9], b: {V1: [0.1]}, noise: {std: 0.05}}
"""


def identification(f_s: float = 5.1, verdict: str = "sticky") -> dict[str, object]:
    return {
        "samples": 400,
        "sample_time": 1.0,
        "seconds": 0.5,
        "model": {"kind": "arx", "status": "ok", "reason": "", "method": "exact", "notes": []},
        "valves": [
            {
                "name": "V1",
                "verdict": verdict,
                "law": "he",
                "f_s": f_s,
                "f_s_interval": [f_s - 0.123, f_s + 0.123],
                "f_d": 1.9,
                "f_d_interval": [1.8, None],
                "jump": f_s - 1.9,
                "evidence": {"delta_bic": 300.0},
            }
        ],
        "outputs": [
            {
                "name": "PV1",
                "a": [-0.88],
                "b": {"V1": [0.12]},
                "delay": {"V1": 3},
                "bias": 0.0,
                "noise_std": 0.05,
                "fit_one_step": 97.0,
                "fit_free_run": 88.0,
            }
        ],
    }


@pytest.fixture
def log() -> RunLog:
    """A loop that cycles until its controller is swapped, as a bag would tell it."""
    k = np.arange(SAMPLES)
    sp = np.where(k % ROUND < 200, 50.0, 52.0)[:, None]
    cycle = np.sin(2 * np.pi * k / 40.0)[:, None]
    cycle[SWAP:] *= 0.05
    noise = 0.05 * np.random.default_rng(1).standard_normal((SAMPLES, 1))
    op = 50.0 + 5.0 * cycle
    stem = 50.0 + 3.0 * np.sign(cycle)
    record = Record("made_up", 1.0, ("V1",), ("PV1",), op, sp + cycle + noise, sp, stem)
    estimate = np.where(k[:, None] < SWAP, op, stem)
    estimate[0] = np.nan
    first = 3 * SECOND
    at = [first + n * SECOND for n in (399, 495, 800)]
    known = {"V1.f_s": 5.1, "V1.f_d": 1.9}
    fits = tuple(
        Fit(stamp, identification(f_s), known if n else {})
        for n, (stamp, f_s) in enumerate(zip(at, (5.0, 5.1, 4.9), strict=True))
    )
    return RunLog(
        record,
        first,
        (
            ModeChange(first, "unaware", "made_up", "start"),
            ModeChange(first + SWAP * SECOND, "embedding", "made_up", "friction", known),
        ),
        (Text("/loop_model", first, "loop: made_up"),),
        (Text("/plant/config", first, PLANT),),
        {"/pv": SAMPLES, "/clock": 12},
        {"/pv": SAMPLES},
        ("a note <of> the reader",),
        fits,
        estimate,
        10.0,
    )


@pytest.fixture
def healthy(log: RunLog) -> RunLog:
    fits = tuple(
        dataclasses.replace(f, identification=identification(0.1, "healthy"), trusted={})
        for f in log.fits
    )
    return dataclasses.replace(log, modes=log.modes[:1], fits=fits)


@pytest.fixture
def model() -> LoopModel:
    return LoopModel.from_yaml(PLANT.partition("model:")[2].replace("\n  ", "\n"))
