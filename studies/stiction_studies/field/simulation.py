"""A loop put together, and run."""

import dataclasses

import numpy as np

from stiction_studies.field import kernels
from stiction_studies.field.kernels import FlagArray, FloatArray
from stiction_studies.field.plants import Process
from stiction_studies.field.valves import Law, Valve

FRICTIONLESS = Valve(Law.BACKLASH, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Controller:
    """PI or PID controller with limits and anti-windup.

    Attributes:
        gain: K_c, % per engineering unit.
        integral: T_i, s.
        derivative: T_d, s; on PV alone.
        pv_filter: time constant of the filter on PV, s.
        derivative_filter: that of the derivative, s.
        low, high: limits of OP, %.
        weight: of the set-point in the proportional part, 1 or 0.
        velocity: whether OP is summed up and cut at its limits; else the integral part is
            calculated back from the limited OP.
    """

    gain: float
    integral: float
    derivative: float = 0.0
    pv_filter: float = 0.0
    derivative_filter: float = 0.0
    low: float = 0.0
    high: float = 100.0
    weight: float = 1.0
    velocity: bool = True

    def scaled(self, factor: float) -> "Controller":
        """Return the controller with another gain."""
        return dataclasses.replace(self, gain=factor * self.gain)

    def parameters(self, op: float) -> FloatArray:
        """Return the kernel's array; ``op`` is where it begins, %."""
        numbers = dataclasses.astuple(self)
        return np.array([*map(float, numbers), op])


@dataclasses.dataclass(frozen=True)
class Clock:
    """Times of a simulation.

    Attributes:
        step: of integration, s.
        scan: steps between two moves of the controller.
        sample: steps between two samples of the record.
    """

    step: float
    scan: int
    sample: int


@dataclasses.dataclass(frozen=True)
class Loop:
    """A valve, a plant and a controller.

    Attributes:
        process: the plant.
        valve: what moves its stream.
        controller: what moves the valve.
        clock: steps of time.
        state: of the plant at rest with the stem at ``process.stem``, read-only.
    """

    process: Process
    valve: Valve
    controller: Controller
    clock: Clock
    state: FloatArray

    @property
    def rest(self) -> float:
        """What the transmitter shows at rest, engineering units."""
        return float(kernels.plant_output(self.process.code, self.state))


@dataclasses.dataclass(frozen=True)
class Signals:
    """What acts on a loop at each step of integration, shape (K,) each.

    Attributes:
        set_point: engineering units.
        load: behind the valve, as a share of the plant's other stream.
        noise: of the transmitter, engineering units.
        manual: whether the loop is in manual.
        by_hand: how far OP is then from where it was found, %.
    """

    set_point: FloatArray
    load: FloatArray
    noise: FloatArray
    manual: FlagArray
    by_hand: FloatArray

    @staticmethod
    def quiet(count: int, set_point: float, by_hand: float | None = None) -> "Signals":
        """Return signals that nothing moves in; in manual with OP moved if that is given."""
        zeros = np.zeros(count)
        manual = np.full(count, by_hand is not None)
        hand = np.full(count, 0.0 if by_hand is None else by_hand)
        return Signals(np.full(count, set_point), zeros, zeros, manual, hand)


@dataclasses.dataclass(frozen=True)
class Run:
    """What happened at each step, shape (K,) each.

    Attributes:
        op: controller output, %.
        pv: process variable as the controller reads it, engineering units.
        stem: position of the stem, %.
        clean: process variable without noise, engineering units.
        state: of the plant at the end.
    """

    op: FloatArray
    pv: FloatArray
    stem: FloatArray
    clean: FloatArray
    state: FloatArray


def run(loop: Loop, signals: Signals) -> Run:
    """Run a loop from rest."""
    process, clock = loop.process, loop.clock
    state = loop.state.copy()
    out = kernels.run_loop(
        (loop.valve.law.value, loop.valve.parameters(), loop.valve.rest(process.stem)),
        (process.code, process.parameters, state),
        loop.controller.parameters(process.stem),
        (
            clock.step,
            clock.scan,
            round(process.dead_time / clock.step),
            max(1, round(process.cycle / clock.step)),
        ),
        signals.set_point,
        signals.load,
        signals.noise,
        signals.manual,
        signals.by_hand,
    )
    return Run(out[0], out[1], out[2], out[3], state)
