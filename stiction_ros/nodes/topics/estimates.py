"""How a fit is told: the message on ``stiction`` and the status in the diagnostics."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sensor_msgs.msg import JointState

from stiction_ros.control import ControlMode
from stiction_ros.identification import Identification
from stiction_ros.nodes.shared.messages import joint_state
from stiction_ros.online.estimator.live import FitUpdate
from stiction_ros.texts import json_text

if TYPE_CHECKING:
    from stiction_ros.identification.valve_test.judgement import Judgement

Rows = Mapping[str, tuple[float, float, float]]
Keys = list[tuple[str, object]]


def friction_message(stamp: int, token: str, found: Identification | None) -> JointState:
    """Return value, lower and upper end of every friction; empty for an unusable window.

    Args:
        stamp: end of the window, ns.
        token: ``valid_from`` of the loop model in force, as text.
        found: the fit, or None when the window was not usable.
    """
    return _friction(stamp, token, {} if found is None else found.rows)


def tested_message(stamp: int, valve: str, found: "Judgement") -> JointState:
    """Return what a valve test says of the friction of its valve.

    Args:
        stamp: end of the test, ns.
        valve: tag.
        found: the verdict.
    """
    rows = {
        f"{valve}.f_s": (found.f_s, *found.f_s_interval),
        f"{valve}.f_d": (found.f_d, *found.f_d_interval),
    }
    return _friction(stamp, ControlMode.VALVE_TEST, rows)


def _friction(stamp: int, by: str, rows: Rows) -> JointState:
    message = joint_state(stamp, list(rows), [value for value, _, _ in rows.values()])
    message.velocity = [low for _, low, _ in rows.values()]
    message.effort = [high for _, _, high in rows.values()]
    message.header.frame_id = by
    return message


def fit_status(stamp: int, update: FitUpdate) -> tuple[str, str, Keys]:
    """Return task, message and key-values of one fit, which is told once."""
    keys: Keys = [("window_end", stamp)]
    for name, friction in update.trusted.items():
        keys.append((f"{name}.trusted_law", friction.law))
        keys += [(f"{name}.trusted_{key}", value) for key, value in friction.figures().items()]
    keys.append(("identification", json_text(update.identification.to_dict(), indent=None)))
    return "fit", verdicts_of(update), keys


def verdicts_of(update: FitUpdate) -> str:
    """Return the verdicts of one fit in one line."""
    return ", ".join(f"{v.name} {v.verdict}" for v in update.identification.valves)


def figures_of(update: FitUpdate) -> str:
    """Return verdicts and frictions of one fit in one line, % of travel."""
    frictions = [
        f"{v.name}.f_s {v.static_friction:.3g}, {v.name}.f_d {v.dynamic_friction:.3g}"
        for v in update.identification.valves
    ]
    return f"{verdicts_of(update)}; {', '.join(frictions)}"
