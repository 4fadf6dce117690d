"""Worker processes of this machine: the engine that needs nothing else.

The first worker is waited for alone. One that dies takes its own loop with it, which is tried once
more, and one ends itself when its loop takes too long.
"""

import pickle
import signal
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool

from stiction_ros.errors import InputError
from stiction_ros.online.estimator.worker import FitWorker
from stiction_ros.orphans import spared
from stiction_ros.survey.assess import Assessed, assess, failed
from stiction_ros.survey.engines.engine import ATTEMPTS, Engine, Task
from stiction_ros.survey.entry import SurveyOptions

LONGEST = 600.0  # seconds that one loop may take; a usual one takes a second or two


class LocalEngine(Engine):
    """Processes of this machine."""

    name = "local"

    def __init__(self, jobs: int, longest: float = LONGEST) -> None:
        """Start no process yet; a worker that is ready may take ``longest`` seconds for a loop."""
        self.workers, self._longest = max(jobs, 1), longest
        self._started, self._idle = list[FitWorker](), list[FitWorker]()
        self._busy: dict[str, FitWorker] = {}

    def submit(self, task: Task, options: SurveyOptions) -> Future[Assessed]:
        """Hand a loop to a worker; refused if none gets ready."""
        self._busy[task.key] = worker = self._idle.pop() if self._idle else self._another(options)
        with spared():  # a process that has died is replaced
            return worker.submit(_assessed, pickle.dumps(task.loop), options, self._longest)

    def _another(self, options: SurveyOptions) -> FitWorker:
        with spared():
            worker = FitWorker((options.identification.method,))
        self._started.append(worker)
        if len(self._started) == 1 and not worker.ready():
            raise InputError(
                f"no worker process can start, the first ended with {_said(worker.ended())}",
                where="survey",
                fix="its message stands above",
            )
        return worker

    def outcome(self, task: Task, future: Future[Assessed], attempt: int) -> Assessed | None:
        """Return what a worker says of a loop; where it has died, that the loop is given up."""
        worker = self._busy.pop(task.key)
        self._idle.append(worker)
        if not isinstance(future.exception(), BrokenProcessPool):
            return future.result()
        code = worker.ended()
        if code == -signal.SIGALRM:
            return failed(task.loop, f"it took more than {self._longest:g} s and was given up")
        if attempt < ATTEMPTS:
            return None
        told = f"its worker ended {ATTEMPTS} times, the last time with {_said(code)}"
        return failed(task.loop, told, again=True)

    def close(self) -> None:
        while self._started:
            self._started.pop().close(at_once=True)


def _said(code: int | None) -> str:
    return "no answer" if code is None else f"signal {-code}" if code < 0 else f"code {code}"


def _assessed(loop: bytes, options: SurveyOptions, longest: float) -> Assessed:
    """Judge a loop; if that takes ``longest`` s, the process ends."""
    signal.setitimer(signal.ITIMER_REAL, longest)
    answer = assess(pickle.loads(loop), options)
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    return answer
