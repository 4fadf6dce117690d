"""The parameters of the nodes that neither identify nor control: plant, recorder, player.

With the schedule of fits they stand apart, so that these nodes load nothing of control and
identification.
"""

import dataclasses

from stiction_ros.errors import InputError
from stiction_ros.settings import setting


@dataclasses.dataclass(frozen=True)
class NodeSettings:
    """Start-up, the same for every node."""

    autostart: bool = setting(True, "configure and activate without being told", once=True)
    wait_for: tuple[str, ...] = setting(
        (),
        "nodes of this package that must be ready, and topics (/pv, topic:pv) that must be "
        "there, before this one begins",
        fixed=True,
    )


@dataclasses.dataclass(frozen=True)
class PacedSettings(NodeSettings):
    """By what a node of a running loop goes on from one sample to the next."""

    pace: str = setting(
        "lockstep",
        "lockstep waits for what a sample needs, its op or an awaited fit, and ends with the "
        "plant; realtime waits for nobody",
        choices=("lockstep", "realtime"),
        fixed=True,
    )
    speed: float = setting(
        1.0,
        "simulated seconds per second of realtime pace, as of the plant",
        low=1e-3,
        high=1e6,
        beside=("pace", "realtime"),
    )


@dataclasses.dataclass(frozen=True)
class PlantNodeSettings(PacedSettings):
    """What the plant simulates, how long and how fast."""

    model: str = setting("", "loop model file, *.loop.yaml", fixed=True)
    set_points: str = setting(
        "", "set-point schedule file; empty when sp comes from elsewhere", fixed=True
    )
    seed: int = setting(0, "seed of the noise", low=0, fixed=True)
    samples: int = setting(0, "samples to run; 0 runs until stopped", low=0, fixed=True)
    valve_changes: str = setting(
        "",
        "valves that change in mid-run: YAML text [{time: s, valve: TAG, effects: [...]}]; "
        "empty for none",
        fixed=True,
    )
    loops: tuple[str, ...] = setting(
        (),
        "several loops on one plant, each in the namespace of its name: NAME: VALVE -> OUTPUT; the "
        "valve TAG.SP is the set-point of output TAG; empty for one loop of all tags",
        fixed=True,
    )
    commander: str = setting(
        "controller",
        "the only node whose op is taken, as it names itself in frame_id; without a leading "
        "slash in the plant's namespace; empty for the first that commands",
        fixed=True,
    )
    op_timeout: float = setting(
        120.0,
        "s to wait for op in lockstep before the run is given up",
        low=0.1,
        high=1e5,
        beside=("pace", "lockstep"),
    )


@dataclasses.dataclass(frozen=True)
class RecorderNodeSettings(NodeSettings):
    """What is recorded, and where."""

    directory: str = setting("bag", "the bag, a directory that holds nothing yet", fixed=True)
    topics: tuple[str, ...] = setting(
        (), "names of topics to record, beside those that regex fits", fixed=True
    )
    regex: str = setting(
        "own",
        "regular expression of the full names of topics to record; own: all in the recorder's "
        "namespace and /clock, /diagnostics, /rosout, /parameter_events; empty for none",
        fixed=True,
    )
    exclude_regex: str = setting(
        "", "regular expression of the full names of topics to leave out", fixed=True
    )
    compression: str = setting(
        "zstd", "of the finished bag", choices=("zstd", "lz4", "none"), fixed=True
    )
    max_bag_size: int = setting(
        0,
        "bytes of messages after which the bag goes on in its next file; 0 for never",
        low=0,
        fixed=True,
    )
    max_bag_duration: float = setting(
        0.0,
        "s of log time after which the bag goes on in its next file; 0 for never",
        low=0.0,
        high=1e9,
        fixed=True,
    )


@dataclasses.dataclass(frozen=True)
class PlayerNodeSettings(NodeSettings):
    """What is played, how fast and from where."""

    bag: str = setting("", "rosbag2 directory or .mcap file", fixed=True)
    rate: float = setting(1.0, "recorded seconds per second", low=1e-3, high=1e6)
    start: float = setting(0.0, "seconds of the bag that are passed over", low=0.0, fixed=True)
    loop: bool = setting(False, "begin again at the end", fixed=True)
    paused: bool = setting(False, "wait for ~/resume or ~/step at the beginning", fixed=True)
    topics: str = setting(
        "(?!/(rosout|parameter_events)$).*",
        "regular expression of the full names of the topics to play",
        fixed=True,
    )
    clock: str = setting(
        "auto",
        "auto: the recorded /clock, or the player's own where there is none; "
        "own: the player's own; none: no /clock",
        choices=("auto", "own", "none"),
        fixed=True,
    )
    clock_rate: float = setting(
        40.0, "messages per second of the player's own /clock", low=0.1, high=1000.0, fixed=True
    )


@dataclasses.dataclass(frozen=True)
class FitSchedule:
    """Shared by estimator and controller, so that a run does not depend on speed.

    Sample numbers count from 0 at the first measurement. A window that ends at sample k is
    fitted for k + 1 = ``fit_first``, ``fit_first`` + ``fit_every``, …; its result takes effect
    at sample k + ``fit_latency``.
    """

    fit_first: int = setting(1000, "samples before the first fit", low=1)
    fit_every: int = setting(250, "samples between two fits", low=1)
    fit_latency: int = setting(5, "samples from the end of a window to its effect", low=1)

    def check_latency(self) -> None:
        """Raise InputError where the next window ends before a fit takes effect."""
        if self.fit_every < self.fit_latency:
            raise InputError(
                f"{self.fit_every} is less than fit_latency = {self.fit_latency}",
                where="fit_every",
                fix="a fit must take effect before the next window ends",
            )

    def due(self, sample: int) -> bool:
        """Return whether the window that ends at ``sample`` is fitted."""
        beyond = sample + 1 - self.fit_first
        return beyond >= 0 and beyond % self.fit_every == 0

    def awaited(self, sample: int) -> int | None:
        """Return the last sample of the window whose result takes effect at ``sample``."""
        end = sample - self.fit_latency
        return end if self.due(end) else None
