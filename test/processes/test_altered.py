"""A process with effects behind its outputs."""

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.effects import ExtraDelay, ExtraPole, HeStiction, Leak, ProcessGain
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.processes import AlteredProcess, Process

EFFECTS = (ProcessGain(1.4), ExtraDelay(2.5), ExtraPole(90.0))


def process(name: str) -> Process:
    return LoopModel.load(find_config(name)).process


def altered(name: str, *effects: object) -> AlteredProcess:
    inner = process(name)
    rest = ((),) * (len(inner.outputs) - 1)
    return AlteredProcess(inner, (tuple(effects), *rest), 60.0)  # type: ignore[arg-type]


def run(of: Process, state: np.ndarray, stems: np.ndarray) -> np.ndarray:
    nothing, out = np.zeros(len(of.upsets)), []
    for stem in stems:
        out.append(of.output(state))
        state = of.advance(state, stem, nothing, np.zeros(len(of.outputs)))
    return np.array(out)


def stems(of: Process, spread: float = 20.0) -> np.ndarray:
    point = of.linear(60.0).stem0
    return point + np.random.default_rng(3).uniform(-spread, spread, (80, len(point)))


@pytest.mark.parametrize("name", ["example1.loop.yaml", "tank.loop.yaml", "tank_linear.loop.yaml"])
def test_each_effect_acts_on_the_deviation_of_its_output(name: str) -> None:
    inner, outer = process(name), altered(name, *EFFECTS)
    point = inner.linear(60.0).pv0
    moves = stems(inner)
    plain = run(inner, inner.rest(moves[0] * 0 + inner.linear(60.0).stem0, point), moves)
    found = run(outer, outer.rest(outer.linear(60.0).stem0, point), moves)
    expected = plain[:, 0] - point[0]
    for effect in EFFECTS:
        expected = effect.simulate(expected, 0.0, 60.0)
    assert found[:, 0] - point[0] == pytest.approx(expected, abs=1e-6)
    assert found[:, 1:] == pytest.approx(plain[:, 1:], abs=1e-12)


@pytest.mark.parametrize("effects", [EFFECTS, (Leak(1e-3),), (ExtraPole(60.0), Leak(1e-3))])
@pytest.mark.parametrize("name", ["example1.loop.yaml", "tank.loop.yaml", "tank_linear.loop.yaml"])
def test_it_starts_at_the_outputs_asked(name: str, effects: tuple[object, ...]) -> None:
    outer = altered(name, *effects)
    linear = outer.linear(60.0)
    wanted = linear.pv0 + 0.3
    assert outer.output(outer.rest(linear.stem0, wanted)) == pytest.approx(wanted)


def test_it_rests_where_it_is_at_rest() -> None:
    outer = altered("example1.loop.yaml", *EFFECTS)
    linear = outer.linear(60.0)
    at = outer.rest(linear.stem0 + 5.0, linear.pv0 + outer.linear(60.0).gain @ np.array([5.0]))
    held = run(outer, at, np.tile(linear.stem0 + 5.0, (40, 1)))
    assert held == pytest.approx(np.tile(held[0], (40, 1)))


@pytest.mark.parametrize("name", ["example1.loop.yaml", "tank_linear.loop.yaml"])
def test_its_linear_model_is_the_process_itself(name: str) -> None:
    outer = altered(name, *EFFECTS)
    linear = outer.linear(60.0)
    state, moves = outer.rest(linear.stem0, linear.pv0), stems(outer)
    expected, xi = [], state
    for stem in moves:
        expected.append(linear.c @ xi + linear.pv0)
        xi = linear.a @ xi + linear.b @ (stem - linear.stem0) + linear.constant
    assert run(outer, state, moves) == pytest.approx(np.array(expected), abs=1e-9)


def test_the_gain_of_the_linear_model_is_scaled() -> None:
    plain, outer = process("tank.loop.yaml").linear(60.0), altered("tank.loop.yaml", *EFFECTS)
    assert outer.linear(60.0).gain == pytest.approx(plain.gain * [[1.4], [1.0]])


def test_what_is_not_linear_is_refused() -> None:
    with pytest.raises(InputError, match="not linear"):
        altered("example1.loop.yaml", HeStiction(1.0, 0.5))


def test_every_output_needs_its_list() -> None:
    with pytest.raises(InputError, match="2 outputs"):
        AlteredProcess(process("tank.loop.yaml"), ((),), 60.0)
