"""The continuous stirred tank mixer of Appendix A, equation (A.1) and Table A.3."""

import dataclasses

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.processes.process import LinearModel, Noise, Process
from stiction_ros.processes.sampled import transition


@dataclasses.dataclass(frozen=True)
class TankParameters:
    """Table A.3, times in minutes."""

    volume: float = 10.0  # m³
    density: float = 1100.0  # kg/m³
    heat_capacity: float = 4.180  # kJ/(kg K)
    latent_heat: float = 2272.0  # kJ/kg
    concentration_a: float = 10.0  # kg/m³
    concentration_b: float = 5.0  # kg/m³
    temperature_a: float = 25.0  # °C
    temperature_b: float = 30.0  # °C
    flow_a_max: float = 1.0  # m³/min at 100 % of valve 1
    flow_b: float = 0.5  # m³/min
    steam_max: float = 60.0  # kg/min at 100 % of valve 2

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"{value!r} is not a positive number", where=field.name)


class StirredTank(Process):
    """Concentration and temperature of a mixer fed by valve 1 (stream A) and valve 2 (steam).

    The state is (C in kg/m³, T in °C), in absolute units. The further inputs C_A, C_B,
    T_A, T_B and F_B are given in deviations from :class:`TankParameters`.
    """

    kind = "stirred_tank"
    upsets = ("C_A", "C_B", "T_A", "T_B", "F_B")

    def __init__(
        self,
        valves: tuple[str, ...],
        outputs: tuple[str, ...] = ("C", "T"),
        noise: tuple[Noise, ...] = (Noise(), Noise()),
        parameters: TankParameters | None = None,
        sample_time: float = 60.0,
        measured_disturbances: tuple[str, ...] = (),
    ) -> None:
        """Build a tank stepped by ``sample_time`` seconds."""
        if len(valves) != 2 or len(outputs) != 2:
            raise InputError("a stirred tank has two valves and two outputs", where="process")
        for name in measured_disturbances:
            if name not in self.upsets:
                raise InputError(
                    f"unknown disturbance {name!r}",
                    where="measured_disturbances",
                    fix=f"known: {', '.join(self.upsets)}",
                )
        self.valves, self.outputs, self.noise = valves, outputs, noise
        self.parameters = parameters or TankParameters()
        self.sample_time = sample_time
        self.measured_disturbances = measured_disturbances

    def steady_state(self, stem: FloatArray) -> FloatArray:
        """Return (C, T) at rest with the valves at ``stem`` (%, %)."""
        zero = np.zeros(len(self.upsets))
        at_zero = self._rate(np.zeros(2), stem, zero)
        slope = np.array([self._rate(np.eye(2)[i], stem, zero)[i] for i in range(2)]) - at_zero
        return np.asarray(-at_zero / slope)

    def rest(self, stem: FloatArray, pv: FloatArray) -> FloatArray:
        return np.array(pv, dtype=float)

    def advance(
        self, state: FloatArray, stem: FloatArray, upset: FloatArray, noise: FloatArray
    ) -> FloatArray:
        """Integrate (A.1) over one sample by the classical Runge-Kutta method."""
        h = self.sample_time / 60.0
        k1 = self._rate(state, stem, upset)
        k2 = self._rate(state + 0.5 * h * k1, stem, upset)
        k3 = self._rate(state + 0.5 * h * k2, stem, upset)
        k4 = self._rate(state + h * k3, stem, upset)
        return np.asarray(state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4) + noise)

    def output(self, state: FloatArray) -> FloatArray:
        return state

    def linear(self, sample_time: float) -> LinearModel:
        """Return the tank linearised about the valves at (50, 50) %, zero-order hold."""
        stem0 = np.array([50.0, 50.0])
        pv0 = self.steady_state(stem0)
        names = self.measured_disturbances
        point = np.concatenate([pv0, stem0, np.zeros(len(names))])

        def rate(x: FloatArray) -> FloatArray:
            upset = np.zeros(len(self.upsets))
            upset[[self.upsets.index(name) for name in names]] = x[4:]
            return self._rate(x[:2], x[2:4], upset)

        size = len(point)
        steps = np.eye(size) * 1e-5
        jacobian = np.array([(rate(point + s) - rate(point - s)) / 2e-5 for s in steps]).T
        a, held = transition(jacobian[:, :2], jacobian[:, 2:], sample_time / 60.0)
        return LinearModel(a, held[:, :2], np.eye(2), held[:, 2:], np.zeros(2), stem0, pv0)

    def _rate(self, state: FloatArray, stem: FloatArray, upset: FloatArray) -> FloatArray:
        """Return (dC/dt, dT/dt) per minute by (A.1)."""
        p = self.parameters
        flow_a = p.flow_a_max * stem[0] / 100.0
        steam = p.steam_max * stem[1] / 100.0
        flow_b = p.flow_b + upset[4]
        out = flow_a + flow_b
        solute = flow_a * (p.concentration_a + upset[0]) + flow_b * (p.concentration_b + upset[1])
        heat = flow_a * (p.temperature_a + upset[2]) + flow_b * (p.temperature_b + upset[3])
        heat += steam * p.latent_heat / (p.density * p.heat_capacity)
        return np.array([solute - out * state[0], heat - out * state[1]]) / p.volume
