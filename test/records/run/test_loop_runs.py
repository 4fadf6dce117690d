"""The law of the bag reader: what it calls good was sent, for that sample, by that run."""

import types
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import BagMessage
from stiction_ros.records.quality import Quality
from stiction_ros.records.run.bag_reader import bag_source
from stiction_ros.records.run.loop_runs import LoopRun, loop_runs
from stiction_ros.records.run.loop_signals import JOINT_STATE, LoopSignals

STEP = 10**8  # ns between two samples
RUN = 100_000.0  # what a value of the next run is larger by


class Message(NamedTuple):
    """One message: its topic, sample and value, or a fault."""

    topic: str
    sample: int
    value: float
    fault: str = ""


def of(message: Message) -> BagMessage:
    names, values = ["X"], [message.value]
    if message.fault == "empty":
        names, values = [], []
    elif message.fault == "nan":
        values = [float("nan")]
    elif message.fault == "short":
        values = []
    stamp = message.sample * STEP
    time = types.SimpleNamespace(sec=stamp // 10**9, nanosec=stamp % 10**9)
    state = types.SimpleNamespace(
        header=types.SimpleNamespace(stamp=time), name=names, position=values
    )
    return BagMessage(f"/{message.topic}", JOINT_STATE, 0, 0, state)


def sent(number: int, first: int, count: int) -> Iterator[Message]:
    """Give what a run sends: PV of a sample is its number, OP a half more, SP a quarter."""
    for k in range(first, first + count):
        value = RUN * number + k
        yield Message("sp", k, value + 0.25)
        yield Message("pv", k, value)
        yield Message("op", k, value + 0.5)


def read(messages: list[Message]) -> tuple[LoopRun, ...]:
    signals = LoopSignals("bag")
    for number, message in enumerate(messages):
        signals.add(of(message), number)
    return loop_runs(signals, bag_source("bag"), None, [])


@st.composite
def logs(draw: st.DrawFn) -> list[Message]:
    """Draw what is left of up to three runs of a plant."""
    log: list[Message] = []
    begun = draw(st.integers(0, 500))
    for number in range(draw(st.integers(1, 3))):
        first = max(begun - draw(st.integers(0, 300)), 0) if number else begun
        begun = first
        run = list(sent(number, first, draw(st.integers(60, 120))))
        if draw(st.booleans()):  # a pause
            begin = draw(st.integers(90, len(run) - 1))  # its beginning tells that it is new
            left = run[:begin] + run[begin + draw(st.integers(1, 200)) :]
            run = left if len(left) >= 120 else run
        for _ in range(draw(st.integers(0, 4))):
            if not run:
                break
            place = draw(st.integers(0, len(run) - 1))
            what = draw(st.sampled_from(["empty", "nan", "short", "lost", "again", "late"]))
            if what == "lost":
                run.pop(place)
            elif what == "again":
                run.insert(place, run[place])
            elif what == "late":
                run.insert(min(place + draw(st.integers(1, 6)), len(run) - 1), run.pop(place))
            else:
                run[place] = run[place]._replace(fault=what)
        if log and draw(st.booleans()):  # the last messages of the run before come late
            late = [log.pop() for _ in range(draw(st.integers(0, 6))) if len(log) > 1][::-1]
            for message in late:
                run.insert(draw(st.integers(0, min(12, len(run)))), message)
        log += run
    return log


@given(logs())
def test_what_is_good_was_sent_for_that_sample_by_that_run(log: list[Message]) -> None:
    try:
        runs = read(log)
    except InputError:
        return
    for run in runs:
        for part in run.parts:
            sample = np.rint((part.start + part.time) / (STEP / 1e9))
            good = part.quality == Quality.GOOD
            of_run = np.round((part.pv[:, 0] - sample) / RUN)
            assert len(set(of_run[good])) == 1
            np.testing.assert_array_equal((part.pv[:, 0] - RUN * of_run)[good], sample[good])
            np.testing.assert_array_equal((part.op - part.pv)[good], 0.5)
            assert np.isfinite(part.pv).all()
            assert part.sample_time == pytest.approx(STEP / 1e9)


@given(st.integers(1, 3), st.integers(0, 500), st.integers(30, 150))
def test_of_whole_runs_nothing_is_lost(count: int, first: int, samples: int) -> None:
    log = [m for number in range(count) for m in sent(number, max(first - number, 0), samples)]
    runs = read(log)
    assert [len(run) for run in runs] == [samples] * count
    for number, run in enumerate(runs):
        (part,) = run.parts
        assert part.mask is None
        assert part.pv[0, 0] == RUN * number + max(first - number, 0)
        assert part.sp is not None
        np.testing.assert_array_equal(part.sp - part.pv, 0.25)
