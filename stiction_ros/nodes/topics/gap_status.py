"""What the diagnostics of the estimator say of its monitor."""

from collections.abc import Callable

from stiction_ros.online.monitor.gap_finding import GapFinding
from stiction_ros.online.monitor.gap_monitor import GapLook
from stiction_ros.online.monitor.monitoring import Monitoring
from stiction_ros.texts import json_text

Keys = list[tuple[str, object]]


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
            keys += [
                (f"{output.name}.gap", output.gap),
                (f"{output.name}.baseline", output.baseline),
                (f"{output.name}.growth", output.growth),
                (f"{output.name}.limit", output.limit),
                (f"{output.name}.free_run_rmse", output.free_run_rmse),
                (f"{output.name}.noise_floor", output.noise_floor),
            ]
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
