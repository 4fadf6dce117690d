"""Worker processes of this machine: the engine that needs nothing else.

Workers are forked from one process that has imported what they need, the first of them alone. One
that is killed is replaced and its loop tried once more. A worker takes its loop when it is ready,
and ends itself when the loop takes too long.
"""

import contextlib
import dataclasses
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterable, Iterator
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from stiction_ros.errors import InputError
from stiction_ros.identification.warm_up import compile_loops
from stiction_ros.orphans import spared
from stiction_ros.survey.assess import Assessed, assess
from stiction_ros.survey.engines.engine import ATTEMPTS, Done, Task, lost
from stiction_ros.survey.entry import SurveyOptions

LONGEST = 600.0  # seconds that one loop may take; a usual one takes a second or two
READY = "ready"  # what a worker says once, before its first loop
ENDS_WITHIN = 2.0  # seconds that a worker is given to end by itself


@dataclasses.dataclass
class _Worker:
    process: BaseProcess
    pipe: Connection
    task: Task | None = None
    attempt: int = 1

    def give(self, task: Task, attempt: int) -> None:
        """Hand over a loop."""
        self.task, self.attempt = task, attempt
        with contextlib.suppress(OSError):  # it has died; that shows when it is waited for
            self.pipe.send(task.loop)


class LocalEngine:
    """Processes of this machine."""

    name = "local"

    def __init__(self, jobs: int, longest: float = LONGEST) -> None:
        """Start no process yet; a worker that is ready may take ``longest`` seconds for a loop."""
        self._jobs, self._longest = max(jobs, 1), longest
        self._workers: list[_Worker] = []
        self._proven = False

    @property
    def workers(self) -> int:
        """How many processes work."""
        return self._jobs

    def run(self, tasks: Iterable[Task], options: SurveyOptions) -> Iterator[Done]:
        """Yield what is said of each loop as it comes; refused if no worker gets ready."""
        waiting = iter(tasks)
        try:
            while True:
                most = self._jobs if self._proven else 1
                while len(self._busy) < most and (task := next(waiting, None)) is not None:
                    self._free(options).give(task, 1)
                if not self._busy:
                    return
                yield from self._gathered(options)
        finally:
            self.close()

    @property
    def _busy(self) -> list[_Worker]:
        return [worker for worker in self._workers if worker.task is not None]

    def _free(self, options: SurveyOptions) -> _Worker:
        for worker in [one for one in self._workers if one.task is None]:
            if worker.process.is_alive():
                return worker
            self._drop(worker)  # killed while it had nothing to do: no loop's fault
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([__name__])
        here, there = context.Pipe()
        work = (there, options, self._longest)
        process = context.Process(target=_work, args=work, daemon=True)
        with same_imports(), spared():
            process.start()
        there.close()
        worker = _Worker(process, here)
        self._workers.append(worker)
        return worker

    def _gathered(self, options: SurveyOptions) -> Iterator[Done]:
        """Wait for a worker to be ready, to answer, or to end."""
        speaking = wait([worker.pipe for worker in self._busy])
        for worker in [one for one in self._busy if one.pipe in speaking]:
            answer, task = _answer(worker.pipe), worker.task
            assert task is not None
            if answer == READY:
                self._proven = True
            elif isinstance(answer, Assessed):
                worker.task = None
                yield Done(task, answer)
            else:
                yield from self._ended(worker, task, options)

    def _ended(self, worker: _Worker, task: Task, options: SurveyOptions) -> Iterator[Done]:
        """Try the loop of a worker that has ended once more, or yield that it is given up."""
        code = self._drop(worker)
        said = "no answer" if code is None else f"signal {-code}" if code < 0 else f"code {code}"
        if code == -signal.SIGALRM:
            yield lost(task, f"it took more than {self._longest:g} s and was given up")
        elif not self._proven and (code is None or code >= 0):  # nobody killed it
            raise InputError(
                f"no worker process can start, the first ended with {said}",
                where="survey",
                fix="its message stands above",
            )
        elif worker.attempt < ATTEMPTS:
            self._free(options).give(task, worker.attempt + 1)
        else:
            told = f"its worker ended {ATTEMPTS} times, the last time with {said}"
            yield lost(task, told, again=True)

    def _drop(self, worker: _Worker) -> int | None:
        """End a worker and return how it ended; None where it did not by itself."""
        self._workers.remove(worker)
        worker.process.join(timeout=ENDS_WITHIN)
        code = worker.process.exitcode
        _end(worker)
        return code

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            _end(worker)
        self._workers.clear()


def _end(worker: _Worker) -> None:
    worker.pipe.close()
    if worker.process.is_alive():
        worker.process.kill()
    worker.process.join()


def _answer(pipe: Connection) -> Assessed | str | None:
    """Return what a worker says; None where it has died."""
    try:
        answer: object = pipe.recv()
    except (EOFError, OSError):
        return None
    assert isinstance(answer, Assessed | str)
    return answer


def _work(pipe: Connection, options: SurveyOptions, longest: float) -> None:
    """Judge loops until the pipe closes; one that takes ``longest`` s ends the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one who asked
    compile_loops((options.identification.method,))
    with contextlib.suppress(EOFError, OSError):  # the other side has gone
        pipe.send(READY)
        while pipe.poll(None):
            signal.setitimer(signal.ITIMER_REAL, longest)
            answer = assess(pipe.recv(), options)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            pipe.send(answer)


@contextlib.contextmanager
def same_imports() -> Iterator[None]:
    """Let interpreters that are started inside look for modules where this one does, nowhere else.

    ``multiprocessing`` tells that to a worker, but not to the server that workers are forked from.
    """
    here = os.getcwd()
    told = {"PYTHONPATH": os.pathsep.join(path or here for path in sys.path), "PYTHONSAFEPATH": "1"}
    before = {name: os.environ.get(name) for name in told}
    os.environ.update(told)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
