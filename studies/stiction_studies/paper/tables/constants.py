"""Table A.3: variables and parameters of the stirred tank."""

from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_ros.online.session import Scenario
from stiction_ros.processes import StirredTank
from stiction_studies.paper.exhibit import Exhibit, Row
from stiction_studies.paper.sources import Sources

# Attribute of TankParameters: symbol with unit, and the printed value.
PRINTED = {
    "volume": ("V, m³", 10.0),
    "density": ("ρ, kg/m³", 1100.0),
    "heat_capacity": ("c_p, kJ/(kg K)", 4.180),
    "latent_heat": ("λ, kJ/kg", 2272.0),
    "concentration_a": ("C_A, kg/m³", 10.0),
    "concentration_b": ("C_B, kg/m³", 5.0),
    "temperature_a": ("T_A, °C", 25.0),
    "temperature_b": ("T_B, °C", 30.0),
    "flow_a_max": ("largest F_A, m³/min; K(1) = a hundredth of it", 1.0),
    "flow_b": ("F_B, m³/min", 0.5),
    "steam_max": ("largest W, kg/min; K(2) = a hundredth of it", 60.0),
}
LIMITS = (("C_out, kg/m³", "0 to 20"), ("T_out, °C", "0 to 100"))


def table_a3(sources: Sources) -> Exhibit:
    """Return every entry beside what the simulated tank has."""
    model = LoopModel.load(find_config("tank.loop.yaml"))
    process = model.process
    assert isinstance(process, StirredTank)
    rows = [
        Row(name, f"{printed:g}", f"{getattr(process.parameters, key):g}")
        for key, (name, printed) in PRINTED.items()
    ]
    rows += [
        Row(f"u and χ of {valve.name}, %", "0 to 100", "{:g} to {:g}".format(*valve.limits))
        for valve in model.valves
        if valve.limits is not None
    ]
    scenario = Scenario.load(find_config("tank.scenario.yaml"))
    bounds = scenario.controller.design(scenario.process).limits.output
    rows += [
        Row(
            name,
            printed,
            "{:g} to {:g}".format(*bound),
            "soft bounds of every controller; no run of the paper's set-points comes near them",
        )
        for (name, printed), bound in zip(LIMITS, bounds, strict=True)
    ]
    remark = "The table is in minutes, loop models are in seconds: sample_time 60 is the paper's 1."
    title = "Table A.3: variables and parameters of the stirred tank"
    return Exhibit("tableA.3", title, tuple(rows), remark=remark)
