"""Workers of a Dask cluster that someone runs: here loops are only handed in and taken out.

It runs whatever it is sent, so it belongs into a closed network, or behind TLS in Dask's settings.
"""

from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.survey.assess import Assessed, assess, failed
from stiction_ros.survey.engines.engine import ATTEMPTS, Engine, Task
from stiction_ros.survey.entry import SurveyOptions

SCHEME = "dask://"

AHEAD = 3  # loops handed over for each thread of the cluster
PATIENCE = 15.0  # seconds within which a scheduler must answer


class DaskEngine(Engine):
    """A scheduler and its workers."""

    def __init__(self, address: str) -> None:
        """Connect to ``dask://HOST:PORT``; refused without Dask, an answer or a worker."""
        place = address.removeprefix(SCHEME)
        host, _, port = place.rpartition(":")
        if place == address or not host or not port.isdigit():
            raise InputError(
                f"unknown engine {address!r}",
                where="--engine",
                fix=f"use local, or {SCHEME}HOST:PORT",
            )
        try:
            import dask
            import distributed
        except ImportError:
            raise InputError(
                "a cluster needs Dask",
                where="--engine",
                fix="install the extra: pip install 'stiction_ros[dask]'",
            ) from None
        secure = bool(dask.config.get("distributed.comm.require-encryption", False))
        url = f"{'tls' if secure else 'tcp'}://{place}"
        self.name = address
        try:
            connect: Any = distributed.Client
            self._client: Any = connect(url, timeout=PATIENCE, set_as_default=False)
        except (OSError, TimeoutError) as error:
            raise InputError(
                f"no scheduler answers at {url} ({error})",
                where="--engine",
                fix="start it with dask scheduler, and workers with dask worker",
            ) from None
        self.workers = self._threads()
        if not self.workers:
            self.close()
            raise InputError(
                f"the scheduler at {url} has no workers",
                where="--engine",
                fix=f"start some with dask worker {url} --nthreads 1",
            )

    @property
    def room(self) -> int:
        """One at work for each thread, others on their way."""
        return AHEAD * max(self._threads(), 1)

    def _threads(self) -> int:
        return sum(self._client.nthreads().values())

    def submit(self, task: Task, options: SurveyOptions) -> Any:
        """Hand over a loop, which the cluster tries again where a worker is lost."""
        name = f"stiction-{task.key}-{self._client.id}"  # results of others are not ours
        return self._client.submit(assess, task.loop, options, key=name, retries=ATTEMPTS)

    def outcome(self, task: Task, future: Any, attempt: int) -> Assessed:
        """Return what the cluster says of a loop, or that it gave it up."""
        failure = future.exception()  # waits where an answer was lost: it is made once more
        if failure is not None or future.cancelled():
            reason = failure or future.status
            return failed(task.loop, f"the cluster gave it up: {reason}", again=True)
        answer = future.result()
        assert isinstance(answer, Assessed)
        return answer

    def close(self) -> None:
        """Leave the cluster; what was handed in and not taken out is dropped there."""
        self._client.close()
