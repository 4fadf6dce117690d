"""Which effects no record of OP and PV can tell from each other."""

from __future__ import annotations

from stiction_ros.loop import LoopModel

Name = tuple[str, str]  # place and effect
# What the values of PV, or OP recomputed from them, show without any free run.
SHOWN_BY_DATA = ("freeze", "clip", "quantisation", "tuning", "time_shift")
_NOTHING = 1e-6


def family_of(name: Name, model: LoopModel) -> frozenset[Name]:
    """Return the effect and those that leave the same traces in this loop.

    - Lags: of the sensor, of the process, and of a valve that is alone with this output.
    - A step or a drift: of the sensor, or as a disturbance of the output.
    - Friction of a valve: stiction with a jump of nearly nothing is backlash.
    - A longer delay: a shift of the record's clock, where no controller shows which.

    Args:
        name: place and effect, such as ``("valve:V1", "lag")``.
        model: of the loop.
    """
    place, effect = name
    kind, _, tag = place.partition(":")
    if effect in ("lag", "pole"):
        if kind == "valve":
            families = (_lags(model, output) for output in outputs_of(model, tag))
            return next((family for family in families if name in family), frozenset({name}))
        return _lags(model, tag)
    if effect in ("step", "bias_step"):
        return frozenset({(f"disturbance:{tag}", "step"), (f"sensor:{tag}", "bias_step")})
    if effect == "drift":
        return frozenset({(f"disturbance:{tag}", effect), (f"sensor:{tag}", effect)})
    if effect in ("stiction", "backlash"):
        return frozenset({(place, "stiction"), (place, "backlash")})
    if effect == "delay" and model.controller is None:
        return frozenset({name, ("data", "time_shift")})
    return frozenset({name})


def outputs_of(model: LoopModel, valve: str) -> tuple[str, ...]:
    """Return the outputs that a valve moves."""
    gain = model.process.linear(model.sample_time).gain
    column = abs(gain[:, model.valve_names.index(valve)])
    moved = column > _NOTHING * column.max()
    return tuple(name for name, moves in zip(model.outputs, moved, strict=True) if moves)


def _lags(model: LoopModel, output: str) -> frozenset[Name]:
    """Return the lags that slow all that this output sees, and nothing else."""
    movers = [valve for valve in model.valve_names if output in outputs_of(model, valve)]
    valves = [f"valve:{v}" for v in movers if len(movers) == len(outputs_of(model, v)) == 1]
    return frozenset(
        {
            (f"process:{output}", "pole"),
            (f"sensor:{output}", "lag"),
            *((valve, "lag") for valve in valves),
        }
    )
