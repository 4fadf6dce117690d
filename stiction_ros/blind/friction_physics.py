"""Valves by the mechanics of the stem: what the catalogue calls stiction by another physics."""

from __future__ import annotations

import dataclasses
import math
from typing import ClassVar

from stiction_ros.effects import Memory
from stiction_ros.effects.friction_parameters import FrictionPair

STEPS = 100  # of integration per sample
MASS = 0.01  # of force per acceleration, in samples: the stem swings within half a sample
VISCOUS = 0.2  # critical damping of mass and spring
STANDS = 0.5  # %/sample: slower than this the stem is taken to stand
BRISTLE_STIFFNESS = 100.0
BRISTLE_DAMPING = 1.0
STRIBECK_SPEED = 1.0  # %/sample


@dataclasses.dataclass(frozen=True)
class KarnoppValve(FrictionPair):
    r"""Balance of forces of the stem with a band of zero speed.

    .. math::
        m \ddot x &= u - x - F, \quad F = f_D \operatorname{sign} v + c v \;\; (|v| > D_v) \\
        \dot x &= 0 \;\; (|v| \le D_v, |u - x| \le f_S)

    Force is counted in % of travel by the spring of the actuator, time in samples. The memory
    is (x, v).

    References:
        D. Karnopp: Computer simulation of stick-slip friction in mechanical dynamic systems.
        Journal of Dynamic Systems, Measurement, and Control 107, 1985, 100-103.
    """

    law: ClassVar[str | None] = "karnopp"

    def rest(self, value: float) -> Memory:
        return (value, 0.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        """Return the memory (x, v) at the end of the sample and x."""
        assert isinstance(memory, tuple)
        x, v = memory
        h = 1.0 / STEPS
        for _ in range(STEPS):
            drive = value - x
            if abs(v) <= STANDS:
                if abs(drive) <= self.static_friction:
                    return (x, 0.0), x
                direction = math.copysign(1.0, drive)
            else:
                direction = math.copysign(1.0, v)
            push = drive - direction * self.dynamic_friction
            after = (v + h * push / MASS) / (1.0 + h * VISCOUS / MASS)
            # A stem that reverses passes through standing still.
            v = 0.0 if v * after < 0.0 else after
            x += h * v
        return (x, v), x


@dataclasses.dataclass(frozen=True)
class LuGreValve(FrictionPair):
    r"""Balance of forces of the stem with bristles that bend and slide.

    .. math::
        m \dot v &= u - x - \sigma_0 z - \sigma_1 \dot z - c v \\
        \dot z &= v - \sigma_0 |v| z / g(v), \quad
        g(v) = f_D + (f_S - f_D) e^{-(v/v_s)^2}

    Force is counted in % of travel by the spring of the actuator, time in samples. The memory
    is (x, v, z).

    References:
        C. Canudas de Wit, H. Olsson, K. J. Åström, P. Lischinsky: A new model for control of
        systems with friction. IEEE Transactions on Automatic Control 40, 1995, 419-425.
    """

    law: ClassVar[str | None] = "lugre"

    def rest(self, value: float) -> Memory:
        return (value, 0.0, 0.0)

    def step(self, memory: Memory, value: float, time: float = 0.0) -> tuple[Memory, float]:
        """Return the memory (x, v, z) at the end of the sample and x."""
        assert isinstance(memory, tuple)
        x, v, z = memory
        h = 0.5 / STEPS
        band = self.static_friction - self.dynamic_friction
        for _ in range(2 * STEPS):
            g = self.dynamic_friction + band * math.exp(-((v / STRIBECK_SPEED) ** 2))
            # The bristle for this speed, exactly: it relaxes towards g sign(v)/σ₀.
            if v == 0.0 or g <= 0.0:
                bent = z
            else:
                rest = math.copysign(g, v) / BRISTLE_STIFFNESS
                bent = rest + (z - rest) * math.exp(-BRISTLE_STIFFNESS * abs(v) / g * h)
            force = value - x - BRISTLE_STIFFNESS * bent - BRISTLE_DAMPING * (bent - z) / h
            v = (v + h * force / MASS) / (1.0 + h * VISCOUS / MASS)
            z = bent
            x += h * v
        return (x, v, z), x
