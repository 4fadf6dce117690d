"""The identified loop as a loop model: written, read, simulated, held against its record."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from stiction_ros import (
    HeStiction,
    Identification,
    IdentificationOptions,
    LoopModel,
    Plant,
    Record,
    find_config,
    find_gap,
    identify,
    simulate,
)
from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.identification.answer.identified_loop import _noise, identified_loop
from stiction_ros.identification.result import FitStatus, OutputModel, ValveEstimate, VerdictKind
from stiction_ros.records.csv_writer import write_csv


@pytest.fixture(scope="module")
def truth() -> LoopModel:
    return LoopModel.load(find_config("flow.loop.yaml"))


@pytest.fixture(scope="module")
def record(truth: LoopModel) -> Record:
    return simulate(truth, samples=900)


@pytest.fixture(scope="module")
def found(record: Record) -> Identification:
    return identify(record, IdentificationOptions("exact", output_order=1, delay=(0, 4)))


@pytest.fixture(scope="module")
def loop(record: Record, found: Identification) -> LoopModel:
    return identified_loop(record, found, "again")


def test_it_holds_what_was_identified(
    loop: LoopModel, found: Identification, record: Record, truth: LoopModel
) -> None:
    (valve,), (friction,) = found.valves, loop.valves[0].effects
    assert friction.to_mapping()["f_s"] == pytest.approx(valve.static_friction)
    assert friction.to_mapping()["f_d"] == pytest.approx(valve.dynamic_friction)
    assert loop.sample_time == record.sample_time
    assert loop.controller is not None
    assert truth.controller is not None
    assert loop.controller.gain == pytest.approx(truth.controller.gain, rel=1e-6)
    assert loop.controller.integral_time == pytest.approx(truth.controller.integral_time, rel=1e-6)
    assert [entry.get("valve", entry.get("what")) for entry in loop.provenance] == [
        *("process", "V1", "controller")
    ]
    assert loop.provenance[1]["verdict"] == "sticky"
    assert all(not np.isfinite([i.low, i.high]).any() for i in loop.instruments)


def test_the_process_is_that_of_the_identification(
    loop: LoopModel, found: Identification, record: Record
) -> None:
    (model,) = found.outputs
    linear, y = loop.process.linear(loop.sample_time), record.pv[:5, 0].tolist()
    state = loop.process.rest(found.stem[0], record.pv[0])
    stem = np.vstack([np.repeat(found.stem[:1], 5, axis=0), found.stem])
    y = [record.pv[0, 0]]
    shown = [float(loop.process.output(state)[0])]
    none = np.zeros(0)
    for k in range(40):
        wait = 4 - model.delay["V1"]
        y.append(-model.a[0] * y[-1] + model.b["V1"][0] * stem[k + wait + 1, 0] + model.bias)
        state = loop.process.advance(state, found.stem[k], none, np.zeros(1))
        shown.append(float(loop.process.output(state)[0]))
    assert linear.order >= 1
    late = model.delay["V1"] + 2
    assert np.diff(shown)[late:] == pytest.approx(np.diff(y)[late:], abs=0.05)


def test_it_is_read_as_it_was_written(loop: LoopModel, tmp_path: Path) -> None:
    path = tmp_path / "again.loop.yaml"
    loop.save(path)
    assert LoopModel.load(path).to_mapping() == loop.to_mapping()


def test_its_plant_cycles_as_the_record_does(loop: LoopModel, record: Record) -> None:
    again = simulate(loop, samples=len(record), seed=4)
    assert again.op.std() == pytest.approx(record.op.std(), rel=0.2)
    assert again.pv.std() == pytest.approx(record.pv.std(), rel=0.2)
    assert again.pv.mean() == pytest.approx(record.pv.mean(), abs=0.2)
    turns = [np.count_nonzero(np.diff(np.sign(r.op[:, 0] - r.op.mean()))) for r in (again, record)]
    assert turns[0] == pytest.approx(turns[1], rel=0.3)


def test_without_its_friction_it_comes_to_rest(loop: LoopModel, record: Record) -> None:
    calm = simulate(loop.with_ideal_valves(), samples=len(record), seed=4)
    assert calm.op[200:].std() < 0.3 * record.op.std()


@pytest.mark.trial
def test_the_record_shows_no_gap_to_it(loop: LoopModel, record: Record) -> None:
    assert find_gap(loop, [record]).effects == ()
    without = find_gap(loop.with_ideal_valves(), [record])
    assert [effect.effect for effect in without.effects][:1] == ["stiction"]


def test_a_plant_starts_from_it_where_the_record_did(
    loop: LoopModel, record: Record, found: Identification
) -> None:
    assert loop.op0 == pytest.approx(record.op.mean(axis=0))
    assert loop.pv0 == pytest.approx(record.pv.mean(axis=0), abs=0.5 * record.pv.std())
    plant = Plant(loop, seed=1)
    assert plant.measure().pv_clean == pytest.approx(record.pv[0])
    assert plant.apply(found.stem[0]) == pytest.approx(found.stem[0])


def test_a_process_too_slow_for_its_record_rests_at_the_mean(
    record: Record, found: Identification
) -> None:
    (model,) = found.outputs
    # A pole and a zero that all but cancel: PV would creep far away for thousands of samples.
    a, b = model.a[0], model.b["V1"][0]
    slow = dataclasses.replace(
        model, a=(a - 0.99999, -0.99999 * a), b={"V1": (b, -0.9999 * b)}, bias=1e-5 * model.bias
    )
    loop = identified_loop(record, dataclasses.replace(found, outputs=(slow,)), "slow")
    assert loop.pv0 == pytest.approx(record.pv.mean(axis=0))
    assert "initial" not in loop.to_mapping()
    plant = Plant(LoopModel.from_mapping({**loop.to_mapping(), "disturbances": []}), seed=1)
    for _ in range(200):  # at rest, and nothing creeps away
        assert plant.measure().pv_clean == pytest.approx(loop.pv0, abs=1e-6)
        plant.apply(loop.op0)


@pytest.mark.trial
def test_the_command_writes_it(record: Record, tmp_path: Path) -> None:
    source, target = tmp_path / "loop.csv", tmp_path / "FIC101.loop.yaml"
    write_csv(record, source)
    arguments = ["identify", str(source), "--na", "1", "--delay", "0:4", "--kind", "flow"]
    assert main([*arguments, "--model", str(target), "--json", str(tmp_path / "f.json")]) == 0
    model = LoopModel.load(target)
    assert model.name == "FIC101"
    assert model.controller is not None
    assert main(["simulate", str(target), "--samples", "50", "--out", str(tmp_path / "s.csv")]) == 0
    assert main([*arguments, "--model", str(tmp_path / "no" / "folder.yaml")]) == 2


def test_without_a_model_there_is_nothing_to_write(record: Record, found: Identification) -> None:
    failed = dataclasses.replace(found, status=FitStatus.NO_MODEL, reason="no output")
    with pytest.raises(InputError, match="no output"):
        identified_loop(record, failed, "none")


@pytest.mark.parametrize(("white", "std", "lag"), [(0.3, 1.0, 20.0), (1.0, 0.5, 8.0)])
def test_noise_is_split_into_what_has_memory_and_what_has_not(
    white: float, std: float, lag: float
) -> None:
    random = np.random.default_rng(5)
    keep, wave = np.exp(-1.0 / lag), np.zeros(40_000)
    for k in range(1, len(wave)):
        wave[k] = keep * wave[k - 1] + std * np.sqrt(1.0 - keep**2) * random.standard_normal()
    noise = wave + white * random.standard_normal(len(wave))
    found = _noise(noise - noise.mean())
    assert found == (
        pytest.approx(white, rel=0.15),
        pytest.approx(std, rel=0.15),
        pytest.approx(lag, rel=0.4),
    )
    assert found[0] ** 2 + found[1] ** 2 == pytest.approx(noise.var())


def test_white_noise_has_no_memory() -> None:
    noise = np.tile([1.0, -1.0], 50)
    assert _noise(noise) == (1.0, 0.0, 0.0)


def test_two_valves_are_written_without_a_controller() -> None:
    random = np.random.default_rng(2)
    op = 50.0 + np.cumsum(random.standard_normal((300, 2)), axis=0)
    law = HeStiction(2.0, 1.0)
    stem = np.column_stack([law.simulate(op[:, 0]), op[:, 1]])
    b = {"V1": (0.3,), "V2": (-0.1,)}
    delay = {"V1": 0, "V2": 3}
    models, pv = [], np.zeros((300, 2))
    for i, name in enumerate(("PV1", "PV2")):
        a = (-0.8 - 0.05 * i,)
        pv[0, i] = 10.0 / (1.0 + a[0])
        for k in range(1, 300):
            late = stem[max(k - 4, 0), 1]
            pv[k, i] = -a[0] * pv[k - 1, i] + 0.3 * stem[k - 1, 0] - 0.1 * late
        models.append(OutputModel(name, a, b, delay, 0.0, 0.1, 90.0, 80.0))
    record = Record("two", 5.0, ("V1", "V2"), ("PV1", "PV2"), op, pv)
    sticky = ValveEstimate(
        "V1", VerdictKind.UNDECIDED, "he", 2.0, (0, 3), 1.0, (0, 2), 1.0, 50.0, 9, {}
    )
    ideal = dataclasses.replace(
        sticky, name="V2", verdict=VerdictKind.HEALTHY, static_friction=0.0, dynamic_friction=0.0
    )
    found = Identification(
        FitStatus.OK, "", "exact", 300, 5.0, 0.1, (sticky, ideal), tuple(models), stem
    )
    loop = identified_loop(record, found, "two")
    assert loop.controller is None
    assert [len(valve.effects) for valve in loop.valves] == [1, 0]
    assert loop.provenance[1]["verdict"] == "undecided"
    plant = Plant(loop, seed=1)
    shown = []
    for row in op[:200]:
        shown.append(plant.measure().pv_clean)
        plant.apply(row)
    error = (np.array(shown) - pv[:200])[60:]  # where it began has decayed
    assert np.abs(error).max() < 0.02 * np.ptp(pv)
