"""Controllers of a running loop, made from a loop model."""

import dataclasses

from stiction_ros.control import ControlDesign, ControlMode, MpcController
from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.controller.settings import AUTO, LiveControllerSettings
from stiction_ros.online.handover.known_friction import frictions_of, spreads_of


def controller_of(
    valves: tuple[str, ...],
    design: ControlDesign,
    model: LoopModel,
    mode: str,
    raised: tuple[Behaviour | None, ...] | None = None,
) -> MpcController:
    """Return a controller that knows the friction of ``model``.

    Args:
        valves: names of the m valves, in their order.
        design: of the loop.
        model: what is known of the valves.
        mode: that is asked for; ``auto`` embeds where a valve sticks, as ``valve_test`` does before
            and after its test.
        raised: frictions that the slip check has raised, per valve, in place of those of ``model``.

    Raises:
        InputError: the controller cannot be built for these frictions.
    """
    frictions = raised or frictions_of(model, valves)
    spreads = None if raised else spreads_of(model, valves)
    sticky = any(friction is not None for friction in frictions)
    if mode in (AUTO, ControlMode.VALVE_TEST):
        chosen = ControlMode.EMBEDDING if sticky else ControlMode.UNAWARE
    else:
        chosen = ControlMode(mode)
    if chosen is ControlMode.EMBEDDING and not sticky:
        chosen = ControlMode.UNAWARE  # without friction the two are the same problem
    return MpcController(design, chosen, frictions, spreads)


def design_for(
    offered: LoopModel, loop: LoopModel, settings: LiveControllerSettings, design: ControlDesign
) -> ControlDesign:
    """Return ``design``, or that of the process of ``offered`` where it is to be adopted.

    Raises:
        InputError: ``offered`` is the model of another loop.
    """
    for name in loop.valve_names:
        if name not in offered.valve_names:
            raise InputError(f"says nothing of valve {name}", where=offered.name)
    if not settings.adopt_process:
        return design
    if (offered.valve_names, offered.outputs) != (loop.valve_names, loop.outputs):
        raise InputError("is the process of another loop", where=offered.name)
    adopted = settings.design(offered)
    # What is identified knows no limits: those of the valves stay.
    limits = dataclasses.replace(adopted.limits, stem=design.limits.stem)
    return dataclasses.replace(adopted, limits=limits)
