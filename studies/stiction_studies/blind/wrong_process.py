"""Loops whose model has one figure of the process wrong: ``bench world --family process``.

A loop of one or two lags with a dead time, exactly sampled, under a PI controller; white noise.
"""

import argparse
import dataclasses
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from stiction_ros.cli.shared.as_json import hand_over
from stiction_ros.effects import FloatArray
from stiction_ros.records import Record
from stiction_studies.seeds import run_each

SAMPLES, MOVES, REST = 900, 12, 50.0
CASES: Mapping[str, tuple[str, float]] = {
    "nothing": ("", 0.0),
    "gain x .5": ("gain", 0.5),
    "gain x 2": ("gain", 2.0),
    "time constant x .5": ("time_constant", 0.5),
    "time constant x 2": ("time_constant", 2.0),
    "dead time - 1": ("delay", -1.0),
    "dead time + 1": ("delay", 1.0),
    "dead time - 3": ("delay", -3.0),
    "dead time + 3": ("delay", 3.0),
    "order too high": ("order", 1.0),
    "order too low": ("order", -1.0),
}
"""What of the model is wrong, and by how much it is more than the plant's."""
LAGS = {("valve:V1", "lag"), ("process:PV1", "pole"), ("sensor:PV1", "lag")}
NEAR = 0.2  # of the error, by which the size that is told may miss


@dataclasses.dataclass(frozen=True)
class Plant:
    """Gain, dead time and one or two different time constants, both in samples."""

    gain: float
    dead_time: int
    lags: tuple[float, ...]

    def shares(self) -> tuple[FloatArray, FloatArray]:
        """Return poles and gains of the lags side by side that are these lags in series."""
        lags = np.array(self.lags)
        parts = [own ** (len(lags) - 1) / np.prod(own - lags[lags != own]) for own in lags]
        return np.exp(-1.0 / lags), self.gain * np.array(parts)

    def model(
        self, sample_time: float, noise: float, tuning: tuple[float, float]
    ) -> dict[str, Any]:
        """Return the mapping of the loop model."""
        poles, gains = self.shares()
        others = [np.atleast_1d(np.poly(np.delete(poles, k))) for k in range(len(poles))]
        b = sum(g * (1.0 - p) * o for g, p, o in zip(gains, poles, others, strict=True))
        output = {"name": "PV1", "a": np.poly(poles)[1:].tolist(), "b": {"V1": list(map(float, b))}}
        output |= {"delay": {"V1": self.dead_time}}
        output |= {"noise": {"std": noise, "enters": "measurement"}}
        return {
            "loop": "process",
            "sample_time": sample_time,
            "valves": [{"name": "V1", "limits": [0.0, 100.0], "effects": []}],
            "process": {"kind": "arx", "outputs": [output]},
            "operating_point": {"op": {"V1": REST}, "pv": {"PV1": REST}},
            "controller": {"kind": "pi", "gain": tuning[0], "integral_time": tuning[1]},
        }


def wrong_process(seed: int, case: str) -> tuple[dict[str, Any], Record, float]:
    """Return the model that is wrong, the record, and the lag that the model lacks, s."""
    random = np.random.default_rng([seed, 60])
    what, size = CASES[case]
    gain, lag = random.uniform(0.7, 2.5), float(np.exp(random.uniform(np.log(6.0), np.log(25.0))))
    second = lag * random.uniform(0.25, 0.6)
    true = known = Plant(gain, int(random.integers(4, 10)), (lag,))
    if what == "gain":
        known = dataclasses.replace(true, gain=size * gain)
    elif what == "time_constant":
        known = dataclasses.replace(true, lags=(size * lag,))
    elif what == "delay":
        known = dataclasses.replace(true, dead_time=true.dead_time + int(size))
    elif what == "order":
        two = dataclasses.replace(true, lags=(lag, second))
        true, known = (true, two) if size > 0.0 else (two, true)
    step = float(random.choice([0.5, 1.0, 2.0, 5.0]))
    slow = random.uniform(1.0, 2.5) * (true.dead_time + 1) + true.dead_time + 1
    tuning = (lag / (gain * slow), min(lag, 4.0 * slow))
    noise = float(np.exp(random.uniform(np.log(0.04), np.log(0.15))))
    levels = REST + random.uniform(1.5, 4.0, MOVES) * (-1.0) ** np.arange(MOVES)
    sp = np.repeat(levels, SAMPLES // MOVES)
    op, pv = _run(true, tuning, sp, noise * random.standard_normal(SAMPLES))
    columns = op[:, None], pv[:, None], sp[:, None]
    record = Record(f"process_{seed}", step, ("V1",), ("PV1",), *columns)
    model = known.model(step, noise, (tuning[0], tuning[1] * step))
    return model, record, second * step


def _run(
    plant: Plant, tuning: tuple[float, float], sp: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return OP and PV of the closed loop."""
    poles, gains = plant.shares()
    op, pv, state = np.full(len(sp), REST), np.empty(len(sp)), np.zeros(len(poles))
    before, out = 0.0, REST
    for k in range(len(sp)):
        late = op[k - 1 - plant.dead_time] if k > plant.dead_time else REST
        state = poles * state + (1.0 - poles) * gains * (late - REST)
        pv[k] = REST + state.sum() + noise[k]
        error = sp[k] - pv[k]
        out = float(np.clip(out + tuning[0] * (error - before + error / tuning[1]), 0.0, 100.0))
        op[k], before = out, error
    return op, pv


@dataclasses.dataclass(frozen=True)
class Told:
    """What was said of one loop."""

    seed: int
    case: str
    named: bool  # the one thing that is wrong, with its size, and nothing else
    worse: bool  # whether a gap of the model with what was found is larger than before
    said: str
    seconds: float  # of the processor


def tell(case: tuple[int, str]) -> Told:
    """Ask the workflow about one loop; it sees model and record alone."""
    from stiction_ros.discrepancy import GapOptions, find_discrepancy
    from stiction_ros.loop import LoopModel

    model, record, lag = wrong_process(*case)
    begun = time.process_time()
    found = find_discrepancy(LoopModel.from_mapping(model), [record], GapOptions(quick=True))
    seconds, answer = time.process_time() - begun, found.to_dict()
    before, after = (answer["gap"][when]["PV1"] for when in ("before", "after"))
    worse = any(after[key] > before[key] for key in ("free_run_rmse", "one_step_rmse"))
    told = [f"{each['what']} {each['value']:.3g}" for each in answer["process_changes"]]
    told += [f"{e['effect']} {list(e['parameters'].values())}" for e in answer["effects"]]
    said = " ".join([answer["verdict"], *told])
    return Told(*case, is_named(answer, case[1], record.sample_time, lag), worse, said, seconds)


def is_named(answer: Mapping[str, Any], case: str, sample_time: float, lag: float) -> bool:
    """Tell whether an answer (``gap --json``) names what is wrong, its size, and nothing else."""
    what, size = CASES[case]
    changes, effects = answer["process_changes"], answer["effects"]
    if not what:
        return answer["verdict"] == "none" and not changes
    if answer["verdict"] != "named" or len(changes) + len(effects) != 1:
        return False
    if effects:
        places = {(e["place"], e["effect"]) for e in (*effects, *effects[0]["alternatives"])}
        value, effect = next(iter(effects[0]["parameters"].values())), effects[0]["effect"]
        if (what, size) == ("order", -1.0):
            return places <= LAGS and abs(value - lag) < NEAR * lag
    else:
        value, effect = changes[0]["value"], changes[0]["what"]
        value /= sample_time if effect == "delay" else 1.0
        if what == "order":
            return bool(effect == "time_constant" and size > 0.0 and value < NEAR)
    due = -size if what == "delay" else 1.0 / size
    most = NEAR * max(abs(size), 1.0) if what == "delay" else NEAR * abs(due - 1.0)
    return bool(effect == what and abs(value - due) <= most)


def run(first: int, loops: int, options: argparse.Namespace) -> int:
    """Run the family and print the table by case."""
    todo = [(seed, case) for case in CASES for seed in range(first, first + loops)]
    rows = run_each(tell, todo, options.jobs or 1, f"{len(todo)} loops")
    document = {"name": "process", "rows": [dataclasses.asdict(row) for row in rows]}
    hand_over(options.json, document, lambda: _show(rows))
    return 0


def _show(rows: list[Told]) -> None:
    table = Table("wrong", "loops", "named as such", "after worse", "median s")
    for case in (*CASES, "all"):
        part = [row for row in rows if case in (row.case, "all")]
        counts = len(part), sum(row.named for row in part), sum(row.worse for row in part)
        middle = np.median([row.seconds for row in part])
        table.add_row(case, *map(str, counts), f"{middle:.2f}")
    console = Console()
    console.print(table)
    for row in rows:
        if not row.named or row.worse:
            console.print(f"{row.seed}, {row.case}: {row.said}")
