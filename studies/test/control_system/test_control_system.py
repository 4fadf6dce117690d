"""The control system of the simulated plant: it grants, watches, and takes over without a bump."""

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel, PiTuning, SetPoints
from stiction_studies.control_system.control_system import AUTO, REMOTE, ControlSystem, Tunings

TUNINGS = Tunings((PiTuning(40.0, 900.0), PiTuning(3.0, 600.0)), watchdog=5.0)


class Clock:
    """A system that is scanned once a second of the wall clock, with a beat before each scan."""

    def __init__(self, moves: bool = False) -> None:
        model = LoopModel.load(find_config("tank.loop.yaml"))
        moved = SetPoints.load(find_config("tank.set_points.yaml"), model.outputs)
        self.system = ControlSystem(model, moved if moves else None, TUNINGS, seed=3)
        self.now, self.beats = 0.0, True

    def run(self, scans: int, op: tuple[float, float] | None = None) -> None:
        for _ in range(scans):
            self.now += 1.0
            if self.beats:
                self.system.beat(self.now, self.now)
            self.system.scan(self.now)
            if op is not None:
                self.system.write((0, 1), op)
            self.system.half_over()

    def granted(self) -> "Clock":
        self.run(20)
        self.system.ask(True)
        assert self.system.target(REMOTE, self.now) == ""
        return self


def test_nothing_is_granted_that_nobody_asks_for_or_that_does_not_live() -> None:
    clock = Clock()
    clock.run(5)
    assert clock.system.target(REMOTE, clock.now) == "nobody asks for it"
    clock.system.ask(True)
    assert "no beat" in clock.system.target(REMOTE, clock.now + 60.0)
    assert clock.system.mode == AUTO
    assert "unknown" in clock.system.target("MANUAL", clock.now)


def test_remote_op_is_taken_only_while_it_is_granted() -> None:
    clock = Clock()
    clock.run(5)
    before = clock.system.out.copy()
    assert not clock.system.write((0, 1), (70.0, 30.0))
    np.testing.assert_array_equal(clock.system.out, before)
    clock.granted().run(1, (70.0, 130.0))
    np.testing.assert_array_equal(clock.system.out, [70.0, 100.0])


@pytest.mark.parametrize("how", ["operator", "watchdog", "request"])
def test_every_way_back_is_bumpless(how: str) -> None:
    clock = Clock().granted()
    clock.run(40, (52.0, 47.0))
    before = clock.system.out.copy()
    if how == "operator":
        clock.system.target(AUTO, clock.now)
    elif how == "request":
        clock.system.ask(False)
    else:
        clock.beats = False
        clock.run(5, (52.0, 47.0))
        assert clock.system.mode == REMOTE
    clock.run(1)
    assert clock.system.mode == AUTO
    assert clock.system.alarm
    assert np.abs(clock.system.out - before).max() < 1.0
    assert not (clock.system.out == before).all()  # its PIs act again


def test_its_pis_make_the_sticky_loop_cycle() -> None:
    clock = Clock(moves=True)
    found = []
    for _ in range(560):
        clock.run(1)
        found.append((clock.system.sp[0] - clock.system.pv[0], clock.system.out[0]))
    error, op = np.array(found[360:]).T  # three holds of the set-point of C near 7.36
    assert np.ptp(op) > 8.0  # the valve's stiction must be overcome again and again
    assert np.ptp(error) > 0.1
    signs = np.sign(error[np.abs(error) > 0.03])
    assert (np.diff(signs) != 0).sum() >= 4
