"""The experiment that an ambiguous answer names, made on a loop of the world of others.

``python test/discrepancy/experiments.py LOG`` takes a log of ``stiction bench world``, makes the
experiment of each ambiguous loop, and counts how many sets it leaves with their truth alone.
"""

import dataclasses
import json
import sys
from pathlib import Path

import numpy as np
from scipy.signal import lfilter

from stiction_ros.discrepancy import Discrepancy, GapOptions, GapVerdict, find_discrepancy
from stiction_ros.effects import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record
from stiction_studies.field.hidden import HiddenLoop, hidden_loop
from stiction_studies.field.hidden.effect import LOAD, SENSOR, VALVE
from stiction_studies.field.hidden.given import given_model
from stiction_studies.field.hidden.simulation import AT_REST, LEAD, Signals, run, shape
from stiction_studies.field.loads import coloured

Name = tuple[str, str]
TRAVEL = 10.0  # of OP to either side, %: its ramp and the steps of its levels
READ = 0.01  # share of its spread, by which a flow is read wrongly


@dataclasses.dataclass(frozen=True)
class Second:
    """A second record of a loop, with all that an experiment may record."""

    record: Record  # with the stem
    other_sensor: Record  # PV by a second sensor
    flow: FloatArray  # behind the valve, %, shape (N,)


def second(loop: HiddenLoop, moves: FloatArray | None = None) -> Second:
    """Return another record: in manual where OP is given, shape (N,), else with set-points."""
    random = np.random.default_rng([loop.seed, 77])
    base, noise, every = loop.base, loop.noise, loop.every
    count = LEAD + every * len(loop.record)
    output = np.zeros(count)
    if noise.equation:
        a, _, _ = base.plant.sampled(base.sample_time)
        output = lfilter([1.0], [1.0, *a], noise.equation * random.standard_normal(count))
    if noise.coloured:
        output = noise.coloured * coloured(random, count, noise.memory / base.sample_time)
    by_hand, sp = np.full(count, np.nan), np.full(count, AT_REST)
    if moves is not None:
        by_hand = np.concatenate([np.full(LEAD, AT_REST), np.repeat(moves, every)])
    else:
        size = min(TRAVEL, 20.0 / (abs(base.tuning.gain) * loop.unit)) * loop.unit
        sp[LEAD:] += size * np.sign(np.sin(12.0 * np.pi * np.arange(count - LEAD) / count))
    reading = noise.white * random.standard_normal(count)
    out = run(base, Signals(sp, output, reading, by_hand), loop.hidden)
    rows, last = slice(LEAD, None, every), slice(LEAD + every - 1, None, every)
    time = base.sample_time * (np.arange(count) - LEAD)
    flow = out.stem.copy()
    for effect in loop.hidden:
        if effect.place == LOAD:
            flow += shape(effect, time, base.sample_time)
    flow += READ * float(np.std(flow)) * random.standard_normal(count)
    record = dataclasses.replace(
        loop.record,
        op=out.op[rows, None],
        pv=out.pv[rows, None],
        sp=sp[rows, None],
        stem=out.stem[last, None],
    )
    other = out.clean + noise.white * random.standard_normal(count)
    by_other = dataclasses.replace(record, pv=other[rows, None], stem=None)
    return Second(record, by_other, flow[last])


def ask(loop: HiddenLoop, *records: Record) -> Discrepancy:
    return find_discrepancy(LoopModel.from_mapping(loop.given), records, GapOptions(quick=True))


def told(answer: Discrepancy) -> list[set[Name]]:
    """Return every effect with what is in doubt with it."""
    return [{(e.place, e.effect), *e.alternatives} for e in answer.effects]


def left(loop: HiddenLoop, names: set[Name], experiment: str) -> set[Name]:
    """Return what of a set in doubt an experiment leaves."""
    place = np.linspace(0.0, 1.0, len(loop.record))
    if "ramp OP" in experiment:
        ramp = AT_REST + 2.0 * TRAVEL / np.pi * np.arcsin(np.sin(12.0 * np.pi * place))
        names = _narrowed(names, ask(loop, loop.record, second(loop, ramp).record))
    if "three levels" in experiment:
        levels = (
            AT_REST + 2.0 * TRAVEL * np.array([-1.0, 0.0, 1.0, 0.0])[(3.99 * place).astype(int)]
        )
        names = _narrowed(names, ask(loop, loop.record, second(loop, levels).record))
    if "second sensor" in experiment and "move the sensor" not in experiment:
        stays = any(names & each for each in told(ask(loop, second(loop).other_sensor)))
        names = {name for name in names if (name[0] == SENSOR) != stays}
    if "stem position" in experiment and any(name[0] == VALVE for name in names):
        names = _narrowed(names, ask(loop, second(loop).record))
    if "flow behind" in experiment and len(names) > 1:
        found = second(loop)
        away = found.flow - found.record.stem[:, 0]  # type: ignore[index]
        loaded = float(np.std(away)) > 3.0 * READ * float(np.std(found.flow))
        names = {name for name in names if (name[0] == LOAD) == loaded}
    if "tuning" in experiment:
        model = given_model(loop.base, loop.known, loop.noise, loop.record.sample_time, True)
        known = dataclasses.replace(loop, given=model)
        names = _narrowed(names, ask(known, second(loop).record))
    if "longer record" in experiment:
        names = _narrowed(names, ask(loop, loop.record, second(loop).record))
    return names


def _narrowed(names: set[Name], answer: Discrepancy) -> set[Name]:
    again = [names & each for each in told(answer) if names & each]
    return again[0] if again else names


def decided(loop: HiddenLoop, answer: Discrepancy) -> bool | None:
    """Tell whether the experiment leaves nothing but the truth of each set that holds one.

    Friction by the mechanics of a stem may be either law, a model that is off has another gain.
    None where no set holds a truth.
    """
    truths = {effect.key for effect in loop.hidden}
    mechanical = any(effect.mechanical for effect in loop.hidden)
    truths |= {(VALVE, "backlash")} if mechanical else set()
    sets = [each for each in told(answer) if len(each) > 1 and each & truths]
    if not sets:
        return None
    kept = [left(loop, each, answer.experiment) for each in sets]
    return all(len(each) == 1 and each <= truths for each in kept)


def main(logs: list[str]) -> None:
    count = right = 0
    for log in logs:
        for line in Path(log).read_text().splitlines():
            row = json.loads(line)
            loop = hidden_loop(row["seed"], row["family"], row["given"])
            answer = ask(loop, loop.record) if row["answer"]["verdict"] == "ambiguous" else None
            if answer is None or answer.verdict is not GapVerdict.AMBIGUOUS:
                continue
            found = decided(loop, answer)
            if found is not None:
                count, right = count + 1, right + found
                print(row["seed"], loop.cause, row["said"], found, answer.experiment, flush=True)
    print(f"decided {right} of {count}")


if __name__ == "__main__":
    main(sys.argv[1:])
