import numpy as np
import pytest
from loops import first_order

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control.observer import ObserverKind
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.paper.controllers.embedding import PrintedEmbeddingMpc
from stiction_ros.paper.controllers.weights import (
    WarmStart,
    WeightPreset,
    augmented_weights,
    unaware_weights,
)

TANK = LoopModel.load(find_config("tank_linear.loop.yaml"))
MODEL = TANK.process.linear(60.0)


@pytest.mark.parametrize(
    ("preset", "largest"), [(WeightPreset.PRINTED, 11.0733**2), (WeightPreset.CORRECTED, 1.1241**2)]
)
def test_q_of_unaware_control(preset: WeightPreset, largest: float) -> None:
    weights = unaware_weights(preset, MODEL, 50)
    assert weights.state == pytest.approx(MODEL.c.T @ MODEL.c / largest + 0.01 * np.eye(5))
    assert np.diag(weights.move).tolist() == [10.0, 100.0]
    assert weights.terminal.tolist() == (1e3 * np.eye(5)).tolist()


@pytest.mark.parametrize(
    ("preset", "entries"),
    [
        (WeightPreset.PRINTED, [1e3, 1e3, 1.0, 1.0, 1.0, 1.0, 0.0]),
        (WeightPreset.CORRECTED, [1e3, 1e3, 1.0, 1.0, 1.0, 1.0, 1.0]),
    ],
)
def test_q_z_of_embedding(preset: WeightPreset, entries: list[float]) -> None:
    weights = augmented_weights(preset, MODEL, 50)
    assert [*np.diag(weights.stem), *np.diag(weights.state)] == entries
    assert np.diag(weights.move).tolist() == [1.0, 1.0]
    assert np.diag(weights.op).tolist() == [10.0, 10.0]


def test_s_is_printed_for_two_valves_only() -> None:
    with pytest.raises(InputError, match="the loop has 1") as caught:
        unaware_weights(WeightPreset.PRINTED, first_order(), 10)
    assert caught.value.where == "preset"


def test_settings_choose_the_preset() -> None:
    own = ControlSettings(output_weights=(7.0,), target_weights=(2.0,))
    assert own.design(TANK).others is None
    printed = ControlSettings(
        output_weights=(7.0,), target_weights=(2.0,), preset="printed"
    ).design(TANK)
    wanted = unaware_weights(WeightPreset.PRINTED, MODEL, 50)
    assert printed.unaware.state == pytest.approx(wanted.state)
    assert printed.target_weights.tolist() == [1.0, 1.0]
    assert printed.observer.kind is ObserverKind.LUENBERGER


def test_settings_choose_the_formulation() -> None:
    design = ControlSettings(formulation="printed", warm_start="search", first_move=1.5).design(
        TANK
    )
    controller = MpcController(design, ControlMode.EMBEDDING, (HeStiction(8.0, 1.0), None))
    assert isinstance(controller._formulation, PrintedEmbeddingMpc)
    tuning = controller._formulation.tuning
    assert (tuning.warm_start, tuning.first_move) == (WarmStart.SEARCH, 1.5)
