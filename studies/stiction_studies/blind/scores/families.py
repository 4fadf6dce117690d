"""Which effects no record of OP and PV can tell from each other."""

import numpy as np

from stiction_ros.loop import LoopModel

Name = tuple[str, str]  # place and effect
# What the values of PV, or OP recomputed from them, show without any free run.
SHOWN_BY_DATA = ("freeze", "clip", "quantisation", "tuning", "time_shift")
_NOTHING = 1e-6


def family_of(name: Name, model: LoopModel) -> frozenset[Name]:
    """Return the effect and those that leave the same traces in this loop.

    - Lags: of the sensor, of the process, and of a valve that is alone with this output.
    - A step: of the sensor, or as a disturbance of the output; of the load, or an offset of
      its valve.
    - A drift: the same, and of the load where the process settles, as its response is a drift.
    - A sine: on the output, or as the load of a valve that moves nothing else.
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
    if (kind, effect) in (("load", "step"), ("valve", "offset")):
        return frozenset({(f"load:{tag}", "step"), (f"valve:{tag}", "offset")})
    if effect in ("drift", "sine") and kind != "load":
        same = {(f"disturbance:{tag}", effect)} | {(v, effect) for v in _loads(model, tag, effect)}
        return frozenset(same | ({(f"sensor:{tag}", effect)} if effect == "drift" else set()))
    if effect in ("drift", "sine"):
        alone = outputs_of(model, tag)
        if len(alone) == 1 and place in _loads(model, alone[0], effect):
            return family_of((f"disturbance:{alone[0]}", effect), model)
        return frozenset({name})
    if effect in ("step", "bias_step"):
        return frozenset({(f"disturbance:{tag}", "step"), (f"sensor:{tag}", "bias_step")})
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


def _loads(model: LoopModel, output: str, effect: str) -> tuple[str, ...]:
    """Return the loads whose drift or sine shows as one of this output, and nowhere else."""
    linear = model.process.linear(model.sample_time)
    settles = float(np.abs(np.linalg.eigvals(linear.a)).max(initial=0.0)) < 1.0 - 1e-9
    if model.process.kind == "stirred_tank" or (effect == "drift" and not settles):
        return ()
    return tuple(f"load:{v}" for v in model.valve_names if outputs_of(model, v) == (output,))


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
