"""Where the slow work of a live loop is done: at once, or beside it."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, Protocol, TypeVar

T = TypeVar("T")


class Background(Protocol):
    """Runs what would make a step long: reading a model, building and judging a controller."""

    ahead: bool  # whether work is begun as soon as it is known, or when its result is due

    def submit(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        """Return a future of ``work(*arguments)``; it may hold what the work raised."""
        ...

    def close(self) -> None:
        """Drop what is queued and wait for what runs."""
        ...


class AtOnce:
    """Does the work within the call, so that a run in lockstep does not depend on speed."""

    ahead = False

    def submit(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(work(*arguments))
        except Exception as error:  # as an executor does: the future hands it on
            future.set_exception(error)
        return future

    def close(self) -> None:
        return


class Beside:
    """Does the work in one thread, in order, while the loop goes on."""

    ahead = True

    def __init__(self) -> None:
        """Start without work."""
        self._pool = ThreadPoolExecutor(1, thread_name_prefix="beside")

    def submit(self, work: Callable[..., T], *arguments: Any) -> Future[T]:
        return self._pool.submit(work, *arguments)

    def close(self) -> None:
        self._pool.shutdown(wait=True, cancel_futures=True)
