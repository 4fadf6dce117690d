"""``stiction bench own``: first-order plants as a new user writes them, under default settings."""

import argparse
import dataclasses
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import HeStiction
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel, Measurement, SetPoints, simulate_closed_loop
from stiction_ros.records.valve_work import ValveWork
from stiction_studies.seeds import run_seeds

FIRST, LAST = 1000, 1049
SAMPLES, HOLD = 800, 200
WORSE = 1.05
"""Error of the embedding over that of the inversion up to which it counts as no worse."""

FREE = "stiction-free"
MODES = (ControlMode.UNAWARE.value, ControlMode.INVERSION.value, ControlMode.EMBEDDING.value, FREE)


@dataclasses.dataclass(frozen=True)
class OwnPlant:
    """A first-order plant with dead time."""

    gain: float  # PV units per %
    time_constant: float  # samples
    delay: int  # dead time, samples
    noise: float  # standard deviation of the measurement noise, PV units
    friction: HeStiction  # of its valve
    # set-points less the first, PV units; each is held for ``HOLD`` samples
    levels: FloatArray = dataclasses.field(repr=False)

    @classmethod
    def drawn(cls, seed: int) -> "OwnPlant":
        """Draw a plant; gains, times, frictions and noises are as likely in each decade."""
        random = np.random.default_rng(seed)
        gain = float(10.0 ** random.uniform(-1.0, 1.0) * random.choice([-1.0, 1.0]))
        time_constant = float(10.0 ** random.uniform(np.log10(5.0), np.log10(50.0)))
        delay = int(random.integers(0, 11))
        static = float(10.0 ** random.uniform(0.0, 1.0))
        dynamic = float(static * random.uniform(0.0, 0.9))
        noise = float(abs(gain) * static * 10.0 ** random.uniform(-2.0, -0.5))
        levels = gain * random.uniform(-20.0, 20.0, SAMPLES // HOLD)
        return cls(gain, time_constant, delay, noise, HeStiction(static, dynamic), levels)

    def model(self, sticky: bool) -> LoopModel:
        """Return the loop, at rest at 50 %, sampled once a second."""
        a = -float(np.exp(-1.0 / self.time_constant))
        effects = [self.friction.to_mapping()] if sticky else []
        output = {"name": "PV1", "a": [a], "b": {"V1": [self.gain * (1.0 + a)]}}
        output |= {"delay": {"V1": self.delay}, "noise": {"std": self.noise}}
        point = {"op": {"V1": 50.0}, "pv": {"PV1": 50.0}}
        return LoopModel.from_mapping(
            {
                "loop": "own",
                "sample_time": 1.0,
                "valves": [{"name": "V1", "limits": [0.0, 100.0], "effects": effects}],
                "process": {"kind": "arx", "outputs": [output]},
                "operating_point": point,
            },
            "own plant",
        )


@dataclasses.dataclass(frozen=True)
class OwnRow:
    """One plant under one controller.

    Attributes:
        seed: of the plant and its noise.
        mode: of the controller, or ``stiction-free``: unaware, of a valve without friction.
        error: mean |SP − PV| without noise, % of stem that would make up for it.
        late: the same over the second half of each hold.
        moves, travel: of the stem; samples and %.
    """

    seed: int
    mode: str
    error: float
    late: float
    moves: float
    travel: float


def judge(seed: int) -> list[OwnRow]:
    """Return the rows of one plant."""
    plant = OwnPlant.drawn(seed)
    return [_row(plant, seed, mode) for mode in MODES]


def _row(plant: OwnPlant, seed: int, mode: str) -> OwnRow:
    truth = plant.model(sticky=mode != FREE)
    times = HOLD * np.arange(len(plant.levels), dtype=float)
    schedule = SetPoints(truth.outputs, times, truth.pv0 + plant.levels[:, None])
    design = ControlSettings().design(plant.model(sticky=False))
    formulation = ControlMode.UNAWARE if mode == FREE else ControlMode(mode)
    controller = MpcController(design, formulation, [plant.friction])
    controller.start(truth.stem_start, truth.pv_start)
    applied = truth.stem_start

    def step(measurement: Measurement, sp: FloatArray) -> FloatArray:
        nonlocal applied
        applied = controller.step(measurement.pv, sp, measurement.dv, applied).op
        return applied

    run = simulate_closed_loop(truth, step, schedule, SAMPLES, seed)
    assert run.record.sp is not None
    assert run.record.stem is not None
    error = np.abs(run.record.sp - run.pv_clean)[:, 0] / abs(plant.gain)
    late = error.reshape(-1, HOLD)[:, HOLD // 2 :]
    work = ValveWork.of(run.record.stem[:, 0])
    return OwnRow(seed, mode, float(error.mean()), float(late.mean()), work.moves, work.travel)


def run(options: argparse.Namespace, machine: str) -> int:
    """Run the benchmark."""
    seeds = options.seeds or (FIRST, LAST)
    found = run_seeds(judge, seeds, options.jobs or 1, "own plants")
    rows = [dataclasses.asdict(row) for plant in found for row in plant]
    document = {"name": "own", "machine": machine, "rows": rows}
    hand_over(options.json, document, lambda: _show(found))
    return 0


def _show(found: Sequence[Sequence[OwnRow]]) -> None:
    table = Table("controller", "error, %", "late error, %", "moves", "travel, %")
    for rows in zip(*found, strict=True):
        keys = ("error", "late", "moves", "travel")
        means = [float(np.mean([getattr(row, key) for row in rows])) for key in keys]
        table.add_row(rows[0].mode, *(f"{mean:.3g}" for mean in means))
    ratios = {rows[0].seed: rows[2].error / rows[1].error for rows in found}
    worse = [f"{seed} ({ratio:.2f})" for seed, ratio in ratios.items() if ratio > WORSE]
    console = Console()
    console.print(table)
    console.print(f"embedding over inversion: at most {max(ratios.values()):.2f}")
    console.print(f"worse by more than 5 %: {', '.join(worse) or 'none'} of {len(found)}")
