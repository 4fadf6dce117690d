"""Changes outside the catalogue: nothing before they begin, and what they say after."""

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.processes import Process, StirredTank
from stiction_studies.blind.loops.outside import AgeingTank, ChangingGain

ONSET = 30


def run(of: Process, stems: np.ndarray) -> np.ndarray:
    linear = of.linear(60.0)
    state, out = of.rest(linear.stem0, linear.pv0), []
    for stem in stems:
        out.append(of.output(state))
        state = of.advance(state, stem, np.zeros(len(of.upsets)), np.zeros(len(of.outputs)))
    return np.array(out)


def process(name: str) -> Process:
    return LoopModel.load(find_config(name)).process


@pytest.fixture
def tank() -> StirredTank:
    found = process("tank.loop.yaml")
    assert isinstance(found, StirredTank)
    return found


def test_a_gain_changes_at_its_onset_and_not_before() -> None:
    inner = process("example1_process.loop.yaml")
    stems = np.full((200, 1), 52.0)
    plain, changed = run(inner, stems), run(ChangingGain(inner, 2.0, ONSET), stems)
    assert np.array_equal(changed[: ONSET + 1], plain[: ONSET + 1])
    assert changed[-1, 0] - 50.0 == pytest.approx(2.0 * (plain[-1, 0] - 50.0), rel=0.02)


def test_at_the_operating_point_a_gain_changes_nothing() -> None:
    inner = process("example1_process.loop.yaml")
    held = run(ChangingGain(inner, 2.0, 5), np.full((50, 1), 50.0))
    assert held == pytest.approx(np.full((50, 1), 50.0))


def test_a_tank_that_does_not_age_is_the_tank(tank: StirredTank) -> None:
    stems = np.random.default_rng(1).uniform(40.0, 60.0, (50, 2))
    assert np.array_equal(run(AgeingTank(tank, 0.0, 0.0), stems), run(tank, stems))


@pytest.mark.parametrize(("loss", "fouling"), [(1e-4, 0.0), (0.0, 1e-3)])
def test_an_ageing_tank_grows_colder_and_keeps_its_concentration(
    tank: StirredTank, loss: float, fouling: float
) -> None:
    stems = np.full((150, 2), 50.0)
    aged, plain = run(AgeingTank(tank, loss, fouling), stems), run(tank, stems)
    assert aged[:, 0] == pytest.approx(plain[:, 0])
    colder = plain[:, 1] - aged[:, 1]
    assert colder[0] == 0.0
    assert np.all(np.diff(colder[5:]) > 0.0)
    assert colder[-1] > 0.5
