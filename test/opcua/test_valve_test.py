"""A valve test through the bridge: OP is moved while the operator grants it, and no longer."""

import numpy as np
import pytest
from small_maps import ALIVE, OP, PV, SP, good
from test_loop_bridge import SENDER, Plant

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.settings import LiveControllerSettings
from stiction_ros.online.controller.testing import ValveTestingController

SETTINGS = LiveControllerSettings(
    mode="valve_test", horizon=40, move_weights=(0.1,), measurement_noise=(2.5e-3,)
)


class Loop(Plant):
    """A plant whose controller wants to test the valve; PV rests."""

    def __init__(self) -> None:
        self.live = ValveTestingController(
            SETTINGS, LoopModel.load(find_config("flow.loop.yaml")).with_ideal_valves()
        )
        super().__init__()

    def run(self, seconds: int, wanted: float | None = None, sender: str = SENDER) -> None:
        for _ in range(seconds):
            self.now, self.alive = self.now + 1.0, self.alive + 1
            for tag, value in ((ALIVE, self.alive), (PV, self.pv), (SP, self.pv), (OP, self.op)):
                self.hear(tag, good(float(value), self.now))
            self.do(self.bridge.linked(self.linked, self.now))
            for sample in self.bridge.samples(self.now):
                self.live.applied(sample.op_before, ours=self.bridge.grant.may_write)
                op = self.live.step(sample.pv, sample.sp).op
                self.do(self.bridge.command(sender, sample.stamp, np.array(op), self.now)[1])
            self.do(self.bridge.look(self.now))


def test_a_test_waits_for_the_grant_and_moves_op_under_it() -> None:
    plant = Loop()
    plant.run(40)
    assert plant.ops() == []
    assert plant.live.test is None
    plant.set_mode("ROUT")
    plant.run(300)
    assert plant.live.test is not None
    assert plant.live.test.moves > 1
    assert len(set(plant.ops())) > 2
    assert plant.bridge.grant.may_write


@pytest.mark.parametrize("seconds", [3, 40, 90])
def test_a_take_over_ends_the_test_at_once_and_op_stays_where_the_operator_puts_it(
    seconds: int,
) -> None:
    plant = Loop()
    plant.granted()
    plant.run(seconds)
    assert plant.live.mode is ControlMode.VALVE_TEST
    written = len(plant.ops())
    plant.set_mode("AUTO")
    plant.op = 63.0
    plant.run(1)
    assert plant.live.mode is ControlMode.UNAWARE
    assert plant.live.changes[-1].reason == "valve test: someone else has OP"
    plant.run(60)
    assert len(plant.ops()) == written
    assert plant.op == 63.0
    plant.set_mode("ROUT")  # the grant is not asked for again
    plant.run(10)
    assert len(plant.ops()) == written
