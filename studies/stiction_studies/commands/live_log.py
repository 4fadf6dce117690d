"""The log of a loop that ran without ROS, as if it had been recorded."""

from stiction_ros.online.session import LiveRun
from stiction_ros.records.run.events import Fit, ModeChange
from stiction_ros.records.run.log import RunLog


def log_of(live: LiveRun) -> RunLog:
    """Return the log of ``live``; without messages, so nothing was counted."""
    record = live.run.record
    step = round(record.sample_time * 1e9)
    fits = tuple(
        Fit(
            update.end * step,
            update.identification.to_dict(),
            {
                f"{valve}.{key}": value
                for valve, f in update.trusted.items()
                for key, value in (("f_s", f.static_friction), ("f_d", f.dynamic_friction))
            },
        )
        for update in live.fits
    )
    modes = tuple(
        ModeChange(
            change.sample * step,
            change.mode.value,
            change.model,
            change.reason,
            next((f.trusted for f in reversed(fits) if f.stamp < change.sample * step), {}),
        )
        for change in live.changes
    )
    return RunLog(record, 0, modes, (), (), {}, {}, (), fits, live.stem_estimate)
