"""Workers of a Dask cluster that someone runs: here loops are only handed in and taken out.

It runs whatever it is sent, so it belongs into a closed network, or behind TLS in Dask's settings.
"""

import queue
from collections.abc import Iterable, Iterator
from typing import Any

from stiction_ros.errors import InputError
from stiction_ros.survey.assess import Assessed, assess
from stiction_ros.survey.engines.engine import ATTEMPTS, Done, Task, lost
from stiction_ros.survey.entry import SurveyOptions

SCHEME = "dask://"

AHEAD = 3  # loops handed in for each thread of the cluster: one at work, others on their way
PATIENCE = 15.0  # seconds within which a scheduler must answer


class DaskEngine:
    """A scheduler and its workers."""

    def __init__(self, address: str) -> None:
        """Connect to ``dask://HOST:PORT``; refused without Dask, an answer or a worker."""
        try:
            import dask
            import distributed
        except ImportError:
            raise InputError(
                "a cluster needs Dask",
                where="--engine",
                fix="install the extra: pip install 'stiction_ros[dask]'",
            ) from None
        place = address.removeprefix(SCHEME)
        host, _, port = place.rpartition(":")
        if not host or not port.isdigit():
            raise InputError(
                f"{address} names no scheduler", where="--engine", fix="write dask://HOST:PORT"
            )
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
        if not self.workers:
            self.close()
            raise InputError(
                f"the scheduler at {url} has no workers",
                where="--engine",
                fix=f"start some with dask worker {url} --nthreads 1",
            )

    @property
    def workers(self) -> int:
        """Threads of all workers that are there now."""
        return sum(self._client.nthreads().values())

    def run(self, tasks: Iterable[Task], options: SurveyOptions) -> Iterator[Done]:
        """Yield what is said of each loop as it comes."""
        waiting = iter(tasks)
        given: dict[str, tuple[Task, Any]] = {}
        coming: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def hand_in() -> None:
            room = AHEAD * max(self.workers, 1) - len(given)
            for _ in range(room):
                task = next(waiting, None)
                if task is None:
                    return
                name = f"stiction-{task.key}-{self._client.id}"  # results of others are not ours
                future = self._client.submit(assess, task.loop, options, key=name, retries=ATTEMPTS)
                given[future.key] = task, future
                future.add_done_callback(coming.put)

        hand_in()
        while given:
            future = coming.get()
            task, _ = given.pop(future.key)
            failure = future.exception()  # waits where an answer was lost: it is made once more
            if failure is None and not future.cancelled():
                answer = future.result()
                assert isinstance(answer, Assessed)
                yield Done(task, answer)
            else:
                reason = failure or future.status
                yield lost(task, f"the cluster gave it up: {reason}", again=True)
            future.release()
            hand_in()

    def close(self) -> None:
        """Leave the cluster; what was handed in and not taken out is dropped there."""
        self._client.close()
