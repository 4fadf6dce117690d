"""How fits and the monitor are told: messages on ``stiction``, statuses in the diagnostics."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from sensor_msgs.msg import JointState

from stiction_ros.control import ControlMode
from stiction_ros.nodes.shared.messages import joint_state
from stiction_ros.online.estimator.live import FitUpdate
from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapLook
from stiction_ros.online.monitor.monitoring import Monitoring
from stiction_ros.texts import json_text

if TYPE_CHECKING:
    from stiction_ros.identification.valve_test.judgement import Judgement

Rows = Mapping[str, tuple[float, float, float]]
Keys = list[tuple[str, object]]
FIGURES = ("gap", "baseline", "growth", "limit", "free_run_rmse", "noise_floor")  # of an output


def friction_message(stamp: int, by: str, rows: Rows) -> JointState:
    """Return value, lower and upper end of every friction; empty for an unusable window.

    The ``stamp`` is the end of the window, ns; ``by`` is ``valid_from`` of the loop model in force.
    """
    message = joint_state(stamp, list(rows), [value for value, _, _ in rows.values()])
    message.velocity = [low for _, low, _ in rows.values()]
    message.effort = [high for _, _, high in rows.values()]
    message.header.frame_id = by
    return message


def tested_message(stamp: int, valve: str, found: "Judgement") -> JointState:
    """Return what a valve test that ended at ``stamp``, ns, says of the friction of its valve."""
    rows = {
        f"{valve}.f_s": (found.f_s, *found.f_s_interval),
        f"{valve}.f_d": (found.f_d, *found.f_d_interval),
    }
    return friction_message(stamp, ControlMode.VALVE_TEST, rows)


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


def monitor_status(
    monitoring: Monitoring, stamp_of: Callable[[int], int]
) -> tuple[str, str, str, Keys]:
    """Return level, task, message and key-values of the monitor's own status.

    Args:
        monitoring: of the node.
        stamp_of: gives the stamp of a sample, ns.
    """
    look, finding = monitoring.look, monitoring.finding
    keys: Keys = [
        ("looks", monitoring.looks),
        ("grown_looks", monitoring.grown),
        ("runs", monitoring.runs),
        ("running", monitoring.running),
    ]
    if look is not None:
        keys.append(("window_end", stamp_of(look.end)))
        for output in look.outputs:
            keys += [(f"{output.name}.{key}", getattr(output, key)) for key in FIGURES]
    if finding is not None:
        keys += [
            ("verdict", finding.word),
            ("effects", "; ".join(finding.effects)),
            ("experiment", finding.document.get("experiment", "")),
            ("verdict_window_end", stamp_of(finding.end)),
        ]
    troubled = look is not None and (look.grown or bool(look.failure))
    return "warn" if troubled else "ok", "monitor", monitoring.text, keys


def look_status(look: GapLook, stamp_of: Callable[[int], int]) -> tuple[str, str, Keys]:
    """Return task, message and key-values of one measurement, which is told once."""
    keys: Keys = [("window_end", stamp_of(look.end))]
    return "gap", look.text, [*keys, ("look", json_text(look.to_dict(), indent=None))]


def finding_status(found: GapFinding, stamp_of: Callable[[int], int]) -> tuple[str, str, Keys]:
    """Return task, message and key-values of what was found, which is told once."""
    keys: Keys = [("window_begin", stamp_of(found.begin)), ("window_end", stamp_of(found.end))]
    return "finding", found.text, [*keys, ("finding", json_text(found.to_dict(), indent=None))]
