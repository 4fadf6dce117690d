"""A controller that is made ready beside the loop on its past, to take over between two samples."""

import dataclasses
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any, TypeVar

import numpy as np

from stiction_ros.control import History, MpcController
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.loop import LoopModel
from stiction_ros.online.handover.offers import Judge, Maker

T = TypeVar("T")


class AtOnce(Executor):
    """Does the work within the call, so that a run in lockstep does not depend on speed."""

    def submit(self, work: Callable[..., T], /, *given: Any, **named: Any) -> Future[T]:
        future: Future[T] = Future()
        try:
            future.set_result(work(*given, **named))
        except Exception as error:  # as other executors do: the future hands it on
            future.set_exception(error)
        return future


class Past:
    """The last ``limit`` samples: OP as it was applied, PV, measured disturbances.

    Attributes:
        count: samples added so far, those that are forgotten included.
    """

    def __init__(self, limit: int, valves: int, outputs: int, disturbances: int) -> None:
        self.limit, self.count = limit, 0
        self._op, self._pv, self._dv = (
            np.zeros((2 * limit, width)) for width in (valves, outputs, disturbances)
        )
        self._first = self._end = 0

    def __len__(self) -> int:
        return self._end - self._first

    def add(self, op: FloatArray, pv: FloatArray, dv: FloatArray) -> None:
        """Add one sample: OP (m,), PV (p,), which is NaN where it is missing, and DV (d,)."""
        if self._end == len(self._op):
            for rows in (self._op, self._pv, self._dv):
                rows[: self.limit] = rows[self.limit :]
            self._first, self._end = self._first - self.limit, self.limit
        for rows, values in ((self._op, op), (self._pv, pv), (self._dv, dv)):
            rows[self._end] = values
        self._end += 1
        self._first = max(self._first, self._end - self.limit)
        self.count += 1

    def clear(self) -> None:
        """Forget every sample; the count goes on."""
        self._first = self._end = 0

    def history(self) -> History:
        """Return a copy of all that is remembered."""
        return self._rows(self._first)

    def since(self, count: int) -> History:
        """Return a copy of the samples added after the first ``count`` of all."""
        return self._rows(max(self._end - (self.count - count), self._first))

    def _rows(self, first: int) -> History:
        rows = slice(first, self._end)
        return History(self._op[rows].copy(), self._pv[rows].copy(), self._dv[rows].copy())


@dataclasses.dataclass
class HandOver:
    """One change of controller on its way."""

    at: int  # the first sample of the new controller, if it is ready by then
    reason: str  # why it takes over
    model: LoopModel  # whose valves it knows
    make: Maker  # builds it; may raise InputError
    judge: Judge | None = None  # holds it against the past; None where it is not judged
    _work: Future[MpcController | str] | None = None
    _seen: int = 0  # how many samples of the loop were known when the work began

    def prepare(self, background: Executor, past: Past) -> None:
        """Begin to make it ready, from what is known of the past now."""
        self._seen = past.count
        self._work = background.submit(self._made_ready, past.history())

    def _made_ready(self, history: History) -> MpcController | str:
        doubt = "" if self.judge is None else self.judge.doubt(self.make, history)
        if doubt:
            return doubt
        controller = self.make()
        if len(history.op):
            controller.take_over(history)
        return controller

    @property
    def begun(self) -> bool:
        """Whether :meth:`prepare` was called since :meth:`put_off`."""
        return self._work is not None

    @property
    def ready(self) -> bool:
        """Whether what was begun is done."""
        return self._work is not None and self._work.done()

    def put_off(self, at: int) -> None:
        """Leave it to sample ``at``; what was prepared is dropped."""
        if self._work is not None:
            self._work.cancel()
        self.at, self._work = at, None

    def take(self, past: Past) -> MpcController | str:
        """Return the controller, brought up to the present sample, or what speaks against it.

        Raises:
            InputError: it could not be built.
        """
        assert self._work is not None
        found = self._work.result()
        if not isinstance(found, str) and self._seen < past.count:
            found.follow(past.since(self._seen))
        return found
