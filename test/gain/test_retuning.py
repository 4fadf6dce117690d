import numpy as np

from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control_settings import ControlSettings
from stiction_ros.gain.retuning import SHIFTS, predictive_response
from stiction_ros.loop import LoopModel

MODEL = {
    "loop": "FIC1",
    "sample_time": 1.0,
    "valves": [{"name": "V1", "effects": []}],
    "process": {
        "kind": "arx",
        "outputs": [{"name": "PV1", "a": [-0.8], "b": {"V1": [0.3]}, "delay": {"V1": 2}}],
    },
}


def test_the_response_is_that_of_the_controller() -> None:
    """Of a pulse of PV: what OP changes by from sample to sample, turned and summed."""
    settings = ControlSettings(
        horizon=30,
        look_ahead=0,
        move_weights=(0.2,),
        embedding_move_weights=(0.2,),
        measurement_noise=(0.1,),
        disturbance_noise=(0.01,),
    )
    design = settings.design(LoopModel.from_mapping(MODEL))
    control = MpcController(design, ControlMode.UNAWARE)
    control.start(np.zeros(1), np.zeros(1))
    op, ops = np.zeros(1), []
    for k in range(600):
        op = control.step(np.array([1.0 if k == 5 else 0.0]), np.zeros(1), np.zeros(0), op).op
        ops.append(float(op[0]))
    turn = SHIFTS[100::20]
    moves = np.diff(ops[4:])
    summed = np.array([np.sum(moves * q ** np.arange(len(moves))) for q in turn])
    told = -predictive_response(design)[100::20] * (1.0 - turn)
    np.testing.assert_allclose(told, summed, rtol=1e-4, atol=1e-6)
