import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from made import unreadable

from stiction_ros.errors import InputError
from stiction_ros.survey.engines.dask import DaskEngine
from stiction_ros.survey.engines.engine import Task
from stiction_ros.survey.entry import SurveyOptions
from stiction_ros.survey.survey import Plan, survey

distributed = pytest.importorskip("distributed")

OPTIONS = SurveyOptions(pages=False)


def _until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


class Cluster:
    """A scheduler and workers as users start them."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.processes = [
            self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        ]
        _until(self.file.exists)
        self.address = json.loads(self.file.read_text())["address"].replace("tcp://", "dask://")

    def work(self) -> subprocess.Popen[bytes]:
        worker = self._start("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard")
        self.processes.append(worker)
        return worker

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--scheduler-file", str(self.file)],
            cwd=self.file.parent,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def end(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    cluster = Cluster(tmp_path)
    yield cluster
    cluster.end()


def _engine(cluster: Cluster, workers: int) -> DaskEngine:
    found: list[DaskEngine] = []

    def ready() -> bool:
        try:
            found.append(DaskEngine(cluster.address))
        except InputError:
            return False
        if found[-1].workers < workers:
            found.pop().close()
            return False
        return True

    _until(ready)
    return found[0]


@pytest.mark.trial
def test_a_lost_worker_loses_no_loop(cluster: Cluster, tmp_path: Path) -> None:
    first, _ = cluster.work(), cluster.work()
    engine = _engine(cluster, 2)
    count = 60
    keys = []
    for task, found in engine.run((Task(str(k), unreadable(k)) for k in range(count)), OPTIONS):
        keys.append(task.key)
        assert found.entry.reason == "has no column OP"
        if len(keys) == 10:
            os.kill(first.pid, signal.SIGKILL)
    engine.close()
    assert sorted(keys) == sorted(map(str, range(count)))
    once = survey(map(unreadable, range(5)), Plan(OPTIONS, tmp_path / "out"), _engine(cluster, 1))
    assert once.engine == cluster.address
    assert len(once.entries) == 5


@pytest.mark.trial
def test_an_answer_lost_before_it_is_fetched_is_made_once_more(cluster: Cluster) -> None:
    first = cluster.work()
    engine = _engine(cluster, 1)
    with distributed.Client(
        cluster.address.replace("dask://", "tcp://"), set_as_default=False
    ) as watcher:
        run = engine.run((Task(str(k), unreadable(k)) for k in range(3)), OPTIONS)
        reasons = [next(run).assessed.entry.reason]
        _until(lambda: sum(map(bool, watcher.who_has().values())) == 3)
        os.kill(first.pid, signal.SIGKILL)
        _until(lambda: not watcher.nthreads())
        cluster.work()
        reasons += [found.entry.reason for _, found in run]
    engine.close()
    assert reasons == ["has no column OP"] * 3


def test_a_scheduler_without_workers_is_said(cluster: Cluster) -> None:
    with pytest.raises(InputError, match="dask worker"):
        DaskEngine(cluster.address)


@pytest.mark.parametrize("address", ["dask://", "dask://host", "dask://:x"])
def test_an_address_that_names_nothing_is_said(address: str) -> None:
    with pytest.raises(InputError, match="dask://HOST:PORT"):
        DaskEngine(address)
