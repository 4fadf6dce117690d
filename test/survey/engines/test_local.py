import dataclasses
import multiprocessing
import os
import time
import types
from typing import Any

import pytest
from made import unreadable

from stiction_ros.errors import InputError
from stiction_ros.intake.loop import Loop
from stiction_ros.survey.engines.engine import Task
from stiction_ros.survey.engines.local import LocalEngine
from stiction_ros.survey.entry import Status, SurveyOptions

OPTIONS = SurveyOptions(pages=False)


class _Then:
    """What does something to the process that receives it."""

    def __init__(self, function: Any, *arguments: Any) -> None:
        self._does = function, arguments

    def __reduce__(self) -> Any:
        return self._does


def _bad(then: _Then) -> Task:
    return Task("bad", Loop("BAD", (), (then,)))  # type: ignore[arg-type]


def _tasks(count: int) -> list[Task]:
    return [Task(str(k), unreadable(k)) for k in range(count)]


@pytest.mark.trial
def test_every_loop_comes_back_with_its_reason_and_is_drawn_no_faster() -> None:
    drawn = 0

    def tasks() -> Any:
        nonlocal drawn
        for task in _tasks(40):
            drawn += 1
            yield task

    done = []
    for one in LocalEngine(2).run(tasks(), OPTIONS):
        done.append(one)
        assert drawn <= len(done) + 1  # one is with each of the two workers
    assert sorted(task.key for task, _ in done) == sorted(str(k) for k in range(40))
    assert {found.entry.status for _, found in done} == {Status.FAILED}
    assert {found.entry.reason for _, found in done} == {"has no column OP"}


@pytest.mark.trial
def test_killed_workers_are_replaced_and_no_loop_is_lost() -> None:
    engine = LocalEngine(2)
    keys, killed = [], 0
    for task, found in engine.run(_tasks(30), OPTIONS):
        keys.append(task.key)
        assert found.entry.reason == "has no column OP"
        if len(keys) in (1, 10):
            for process in multiprocessing.active_children():
                process.kill()
                killed += 1
    assert killed >= 2
    assert sorted(keys) == sorted(str(k) for k in range(30))


@pytest.mark.trial
def test_a_loop_that_kills_its_workers_fails_alone() -> None:
    tasks = [_bad(_Then(os._exit, 9)), *_tasks(5)]
    done = {task.key: found.entry for task, found in LocalEngine(1).run(tasks, OPTIONS)}
    assert len(done) == 6
    assert "worker ended 3 times" in done["bad"].reason
    assert done["4"].reason == "has no column OP"


@pytest.mark.trial
def test_a_loop_that_takes_too_long_is_given_up() -> None:
    tasks = [_bad(_Then(time.sleep, 300.0)), *_tasks(2)]
    begun = time.monotonic()
    done = {
        task.key: found.entry for task, found in LocalEngine(1, longest=1.5).run(tasks, OPTIONS)
    }
    assert "more than 1.5 s" in done["bad"].reason
    assert done["1"].reason == "has no column OP"
    assert time.monotonic() - begun < 100.0


@pytest.mark.trial
def test_the_time_of_a_loop_begins_when_its_worker_is_ready() -> None:
    slow = dataclasses.replace(OPTIONS, read_by=_Then(time.sleep, 2.5))  # unpickled by the worker
    done = list(LocalEngine(1, longest=1.5).run(_tasks(3), slow))
    assert {found.entry.reason for _, found in done} == {"has no column OP"}
    assert len(done) == 3


def test_where_no_worker_can_start_that_is_said_once() -> None:
    method = types.SimpleNamespace(method=_Then(os._exit, 3))  # unpickled by the worker
    broken = types.SimpleNamespace(identification=method)
    engine = LocalEngine(4)
    with pytest.raises(
        InputError, match="no worker process can start, the first ended with code 3"
    ):
        list(engine.run(_tasks(9), broken))
    assert not multiprocessing.active_children()


@pytest.mark.trial
def test_a_loop_whose_worker_died_may_be_tried_again_and_one_that_was_judged_not() -> None:
    tasks = [*_tasks(1), _bad(_Then(os._exit, 9))]
    again = {task.key: found.again for task, found in LocalEngine(1).run(tasks, OPTIONS)}
    assert again == {"0": False, "bad": True}


@pytest.mark.trial
def test_workers_end_when_the_survey_is_broken_off() -> None:
    engine = LocalEngine(2)
    run = engine.run(_tasks(50), OPTIONS)
    next(run)
    assert multiprocessing.active_children()
    run.close()  # type: ignore[attr-defined]
    assert not multiprocessing.active_children()
