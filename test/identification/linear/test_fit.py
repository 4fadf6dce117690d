"""The linear model of a record; the experiment of Appendix A."""

import functools
import json

import linear_systems as systems
import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.identification.linear.data import LinearStatus, nrmse_fit, prepare_linear
from stiction_ros.identification.linear.fit import LinearOptions, fit_linear
from stiction_ros.identification.linear.result import LinearIdentification
from stiction_ros.loop import LoopModel, prbs_experiment
from stiction_ros.records.record import Record
from stiction_ros.signals.subspace_projection import SubspaceMethod
from stiction_ros.signals.tracking import explained

TANK = LoopModel.load(find_config("tank.loop.yaml")).with_ideal_valves()
LINEAR_TANK = LoopModel.load(find_config("tank_linear.loop.yaml"))
PAPER_GAIN = np.array([[0.02424, -0.00054], [-0.19005, 0.29754]])


def tank_gains(model: LoopModel, samples: int, order: int, seeds: range) -> np.ndarray:
    """Return the gains of stable models, one per seed, shape (seeds, 2, 2)."""
    options = LinearOptions(order=order, method=SubspaceMethod.N4SID)
    fits = [fit_linear(prbs_experiment(model, samples, seed), options) for seed in seeds]
    assert {fit.status for fit in fits} == {LinearStatus.OK}
    return np.array([fit.gain for fit in fits])


@pytest.mark.trial
@pytest.mark.parametrize("order", [2, 5])
def test_gains_of_the_paper_are_one_draw_of_a_short_experiment(order: int) -> None:
    gains = tank_gains(TANK, 300, order, range(40)).reshape(40, 4)
    centred = np.linalg.inv(np.cov(gains.T))
    distances = [d @ centred @ d for d in gains - gains.mean(axis=0)]
    paper = PAPER_GAIN.ravel() - gains.mean(axis=0)
    assert paper @ centred @ paper < np.max(distances)


@pytest.mark.trial
def test_long_experiments_give_the_gains_of_the_tank() -> None:
    gains = tank_gains(TANK, 3000, 2, range(6))
    truth = TANK.process.linear(60.0).gain
    assert gains.mean(axis=0) == pytest.approx(truth, rel=0.03, abs=2e-4)


@pytest.mark.trial
def test_experiment_on_the_linear_model_gives_its_gains() -> None:
    gains = tank_gains(LINEAR_TANK, 3000, 5, range(4))
    truth = LINEAR_TANK.process.linear(60.0).gain
    assert truth == pytest.approx(PAPER_GAIN, abs=1e-5)
    assert gains.mean(axis=0) == pytest.approx(truth, rel=0.02, abs=2e-4)


def open_loop(order: int, noise: float) -> tuple[Record, systems.System]:
    random = np.random.default_rng(12)
    system = systems.random_system(random, order, 2, 2)
    return systems.experiment(system, random, 1500, noise), system


@functools.cache
def fitted() -> LinearIdentification:
    """What is found of the second-order system."""
    return fit_linear(open_loop(2, 0.05)[0])


def simulated(found: LinearIdentification, record: Record) -> np.ndarray:
    """Return the free run of the process from rest, shape (N, p)."""
    process = found.loop_model("found").process
    state = process.rest(record.op[0], record.pv[0])
    none = np.zeros(0), np.zeros(len(record.outputs))
    out = np.empty_like(record.pv)
    for k, op in enumerate(record.op):
        out[k] = process.output(state)
        state = process.advance(state, op, *none)
    return out


def test_gains_fits_and_a_process_are_given() -> None:
    record, system = open_loop(2, 0.05)
    found = fitted()
    truth = system.c @ np.linalg.solve(np.eye(2) - system.a, system.b)
    assert found.status is LinearStatus.OK
    assert found.gain == pytest.approx(truth, abs=0.06 * np.abs(truth).max())
    assert found.linear_model.gain == pytest.approx(found.gain)
    assert np.abs(found.poles).max() < 1.0
    free = simulated(found, record)
    for i in range(2):
        seen = nrmse_fit(record.pv[200:, i], free[200:, i])
        assert seen == pytest.approx(found.fit_free_run[i], abs=1.0)


def test_loop_model_is_the_process_that_was_found() -> None:
    record, _ = open_loop(2, 0.05)
    found = fit_linear(record, LinearOptions(order=2, delay=(1, 1)))
    text = found.loop_model("mine", (0.0, 100.0)).to_yaml()
    loop = LoopModel.from_yaml(text)
    assert loop.name == "mine"
    assert loop.limits.tolist() == [[0.0, 100.0]] * 2
    assert loop.outputs == record.outputs
    for key in ("a", "b", "c", "constant", "stem0", "pv0"):
        ours, read = getattr(found.linear_model, key), getattr(loop.process.linear(1.0), key)
        assert np.array_equal(ours, read)
    (entry,) = loop.provenance
    assert (entry["record"], entry["samples"], entry["method"]) == ("system", 1500, "cva")
    assert set(entry["fit_free_run"]) == set(record.outputs)


def test_what_the_process_cannot_hold_is_in_the_provenance() -> None:
    record, _ = open_loop(1, 0.05)
    space = fit_linear(record, LinearOptions(order=2))
    assert np.shape(space.loop_model("x").provenance[0]["kalman_gain"]) == (2, 2)


def test_json_is_json_and_holds_every_rival() -> None:
    document = json.loads(json.dumps(fitted().to_dict()))
    assert [entry["name"] for entry in document["outputs"]] == list(open_loop(2, 0.05)[0].outputs)
    for entry in document["outputs"]:
        assert {"delay", "gain", "noise_std", "fit_one_step", "fit_free_run"} <= entry.keys()
    rivals = document["model"]["rivals"]
    assert len(rivals) > 2
    assert {"aic", "bic", "fit_one_step", "fit_free_run"} <= rivals[0].keys()


@pytest.mark.trial
def test_state_space_takes_the_delay_of_the_valve() -> None:
    random = np.random.default_rng(3)
    a, b = (-1.5, 0.7), ((0.05, 0.03),)
    record = systems.armax_record(random, 2000, a, b, a, (5,), 0.02)
    found = fit_linear(record, LinearOptions(delay=(0, 8)))
    assert found.delay.tolist() == [[5]]
    assert len(found.poles) == 2


def test_stems_of_the_record_beat_op() -> None:
    record = loops.example1(1, samples=1500)
    options = LinearOptions(order=3, delay=(5, 5))
    aware, unaware = fit_linear(record, options, record.stem), fit_linear(record, options)
    assert aware.fit_free_run[0] > unaware.fit_free_run[0] + 10.0


def test_records_with_set_points_get_a_word_of_caution() -> None:
    record = loops.example1(1, samples=800)
    options = LinearOptions(order=2, method=SubspaceMethod.PREDICTOR)
    assert any("predictor" in note for note in fit_linear(record, LinearOptions(order=2)).notes)
    assert fit_linear(record, options).notes == ()


@pytest.mark.parametrize(("excitation", "said"), [(0.0, True), (0.5, False)])
def test_record_that_only_shows_its_controller_is_named(excitation: float, said: bool) -> None:
    random = np.random.default_rng(1)
    extra = excitation * random.standard_normal(800)
    op, pv, state, upset = np.zeros(800), np.zeros(800), 0.0, 0.0
    for k in range(1, 800):
        upset = 0.97 * upset + 0.1 * random.standard_normal()
        pv[k] = state + upset
        op[k] = op[k - 1] - 1.5 * (pv[k] - pv[k - 1] + pv[k] / 20.0) + extra[k]
        state = 0.8 * state + 0.2 * op[k]
    record = Record("PI", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    notes = fit_linear(record, LinearOptions(order=1)).notes
    assert any("PI law" in note for note in notes) is said
    assert (explained(record.op[:, 0], record.pv) > 0.999) is said


def test_unstable_model_makes_no_loop() -> None:
    random = np.random.default_rng(4)
    op = systems.random_binary(random, 300, 1, 0.2, (45.0, 55.0))
    system = systems.System(np.array([[1.03]]), np.array([[0.1]]), np.ones((1, 1)))
    pv = system.run(op - 50.0, np.ones(1)) + 0.01 * random.standard_normal((300, 1))
    found = fit_linear(Record("growing", 1.0, ("V1",), ("PV1",), op, pv), LinearOptions(order=1))
    assert found.status is LinearStatus.UNSTABLE
    with pytest.raises(InputError, match="largest pole"):
        found.loop_model("x")


@pytest.mark.parametrize(
    "wrong", [{"order": 0}, {"order": 101}, {"delay": (-1, 1)}, {"delay": (3, 1)}]
)
def test_options_out_of_range_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError):
        LinearOptions(**wrong)  # type: ignore[arg-type]


def _changed(**values: np.ndarray) -> Record:
    record, _ = open_loop(1, 0.1)
    kept = {"op": record.op, "pv": record.pv} | values
    return Record("bad", 1.0, record.valves, record.outputs, kept["op"], kept["pv"])


def test_constant_signals_are_refused() -> None:
    with pytest.raises(InputError, match="op of V1 is constant"):
        prepare_linear(_changed(op=np.full((1500, 2), 50.0)))
    with pytest.raises(InputError, match="pv of PV1 is constant"):
        prepare_linear(_changed(pv=np.zeros((1500, 2))))


def test_short_records_and_strange_stems_are_refused() -> None:
    record = _changed()
    with pytest.raises(InputError, match="too few"):
        prepare_linear(record.part(0, 30))
    with pytest.raises(InputError, match="shape"):
        prepare_linear(record, record.op[:10])
    with pytest.raises(InputError, match="not finite"):
        prepare_linear(record, np.full(record.op.shape, np.nan))


def test_fit_of_a_diverging_run_is_minus_infinity() -> None:
    y = np.arange(5.0)
    assert nrmse_fit(y, y) == 100.0
    assert nrmse_fit(y, np.full(5, y.mean())) == pytest.approx(0.0)
    assert nrmse_fit(y, np.full(5, np.inf)) == -np.inf
