"""The first steps of a controller before it counts."""

import dataclasses

from stiction_ros.control import ControlMode
from stiction_ros.effects import from_mapping
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.controller.settings import LiveControllerSettings

STEPS = 3
MODES = (ControlMode.UNAWARE, ControlMode.EMBEDDING)
FRICTION = {"effect": "stiction", "law": "he", "f_s": 5.0, "f_d": 2.0}


def rehearse(settings: LiveControllerSettings, model: LoopModel) -> None:
    """Load and warm what a step needs, before and after a swap; nothing is left of it.

    The first step of a process takes ten times as long as those that follow: solvers are
    loaded, and memory is laid out.
    """
    sticky = model.with_valve_effects(
        {name: [from_mapping(FRICTION)] for name in model.valve_names}
    )
    for mode in MODES:
        try:
            live = LiveController(dataclasses.replace(settings, mode=mode.value), sticky)
        except InputError:  # these settings know this friction only; the swap would say why
            continue
        for k in range(STEPS):
            result = live.step(model.pv0, model.pv0 + 0.01 * k)
        live.prediction(result, 2)
        live.close()
