"""What a bag of the live loop tells besides its record: fits, modes, configuration."""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.records.parts import joined, span
from stiction_ros.records.record import Record
from stiction_ros.records.run import events
from stiction_ros.records.run.loop_runs import BagLoops, LoopRun


@dataclasses.dataclass(frozen=True)
class RunLog:
    """A run of the live loop as its bag tells it."""

    record: Record  # the loop's signals, one segment; where some are missing stand bad samples
    start: int  # stamp of the record's first sample, ns
    modes: tuple[events.ModeChange, ...]  # changes of mode, model or friction, the first mode first
    loop_models: tuple[events.Text, ...]  # the YAML texts on ``loop_model``
    configs: tuple[events.Text, ...]  # what the nodes published on ``~/config``
    recorded: Mapping[str, int]  # messages in the bag by topic
    published: Mapping[str, int]  # messages by topic as the nodes counted them in ``/diagnostics``
    notes: tuple[str, ...] = ()  # what was left out while reading, one sentence each
    fits: tuple[events.Fit, ...] = ()  # in the order of their windows
    # the controller's estimate of the stem positions at the record's samples, shape (N, m), %, NaN
    # where none was published; None when there is none
    stem_estimate: FloatArray | None = None
    wall_seconds: float = float("nan")  # from first to last publication, on the publishers' clock
    gaps: events.GapLog = events.GapLog({}, {})  # what the monitor told
    # p50, p99, p999 and max of the times from PV to OP; empty in lockstep
    pv_to_op_ms: Mapping[str, float] = dataclasses.field(default_factory=dict)

    def seconds(self, stamp: int) -> float:
        """Return the time of a stamp in s since the first sample."""
        return (stamp - self.start) / 1e9

    @property
    def swap(self) -> events.ModeChange | None:
        """The first change from ``unaware`` to a mode that knows of the friction.

        A change whose first sample is not in the record, as it was cut there, is none.
        """
        end = self.start + round(len(self.record) * self.record.sample_time * 1e9)
        return events.swap_of(itertools.takewhile(lambda change: change.stamp < end, self.modes))

    @property
    def swap_sample(self) -> int | None:
        """Number of the record's sample at which the swap took place."""
        if self.swap is None:
            return None
        return round(self.seconds(self.swap.stamp) / self.record.sample_time)

    @property
    def fit_at_swap(self) -> events.Fit | None:
        """The last fit whose window ended before the swap."""
        if self.swap is None:
            return None
        return next((f for f in reversed(self.fits) if f.stamp < self.swap.stamp), None)


def read_run(path: str | Path, *, namespace: str | None = None) -> RunLog:
    """Read everything that a report needs from a bag, in one pass.

    Of several runs the longest is told, with a note on the others. Arguments and errors are those
    of :func:`stiction_ros.records.run.loop_runs.read_bag_parts`.
    """
    return _log(BagLoops.read(path, events.tells_of_run), namespace)


def read_runs(path: str | Path, namespaces: Iterable[str]) -> dict[str, RunLog]:
    """Read several loops of a bag in one pass, each as :func:`read_run`, by namespace."""
    bag = BagLoops.read(path, events.tells_of_run)
    return {namespace: _log(bag, namespace) for namespace in namespaces}


def _log(bag: BagLoops, namespace: str | None) -> RunLog:
    messages, signals = bag.others, bag.signals
    runs = bag.runs(namespace)
    run = max(runs, key=len)
    place = runs.index(run)  # what was said between the begin of the run and that of the next one
    begin = run.begin if place else 0
    end = runs[place + 1].begin if place + 1 < len(runs) else math.inf
    said = [message for number, message in messages if begin <= number < end]
    configured = [message for number, message in messages if number <= run.end or run is runs[-1]]
    if len(signals.loops) > 1:
        space = signals.loop(namespace)
        said, configured = events.of_loop(said, space), events.of_loop(configured, space)
    record = _record(run, runs)
    start = run.start + round((record.start - run.parts[0].start) * 1e9)
    configs = events.texts(configured, "config")
    if run is not runs[0]:  # what a node said when it was started again holds
        configs = tuple({text.topic: text for text in configs}.values())
    return RunLog(
        record=record,
        start=start,
        modes=events.mode_changes(said) or events.mode_texts(said),
        loop_models=events.texts(configured, "loop_model"),
        configs=configs,
        recorded=dict(bag.recorded),
        published=events.published_counts([message for _, message in messages]),
        notes=record.notes,
        fits=events.fits(said),
        stem_estimate=events.stem_estimate(said, record, start),
        wall_seconds=bag.wall_seconds,
        gaps=events.gap_log(said),
        pv_to_op_ms=events.answer_times(said),
    )


def _record(run: LoopRun, runs: Sequence[LoopRun]) -> Record:
    """Return the record of a run on one regular grid, its notes telling of gaps and other runs."""
    total = sum(len(part) for part in run.parts)
    stretches: list[list[Record]] = [[run.parts[0]]]
    for before, after in itertools.pairwise(run.parts):
        end = before.start + float(before.time[-1])
        if after.start - end > total * after.sample_time:
            stretches.append([])
        stretches[-1].append(after)
    kept = max(stretches, key=lambda parts: sum(map(len, parts)))
    record = joined(kept)
    notes = list(record.notes)
    for other in runs:
        if other is not run:
            notes.append(f"another run, {span(*other.parts)}, {len(other)} samples, is left out")
    if len(stretches) > 1:
        left_out = total - sum(map(len, kept))
        notes.append(f"{left_out} samples beyond a gap longer than the run are left out")
    filled = record.filled()
    missing = len(filled) - len(record)
    if missing:
        notes.append(f"{missing} of {len(filled)} samples are missing")
    return dataclasses.replace(filled, notes=tuple(notes))
