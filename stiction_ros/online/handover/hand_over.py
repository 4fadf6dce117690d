"""A controller that is made ready beside the loop, to take over between two samples."""

import dataclasses
from concurrent.futures import Future

from stiction_ros.control import History, MpcController
from stiction_ros.loop import LoopModel
from stiction_ros.online.handover.background import Background
from stiction_ros.online.handover.offers import Judge, Maker
from stiction_ros.online.handover.past import Past


@dataclasses.dataclass(frozen=True)
class Ready:
    """A controller that has taken in the past, or why it may not take over."""

    controller: MpcController | None  # as of ``seen``; None where there is a doubt
    seen: int  # how many samples of the loop it has taken in
    doubt: str  # why the past speaks against it; empty for nothing


@dataclasses.dataclass
class HandOver:
    """One change of controller on its way."""

    at: int  # the first sample of the new controller, if it is ready by then
    reason: str  # why it takes over
    model: LoopModel  # whose valves it knows
    make: Maker  # builds it; may raise InputError
    judge: Judge | None = None  # holds it against the past; None where it is not judged
    _work: Future[Ready] | None = None

    def prepare(self, background: Background, past: Past) -> None:
        """Begin to make it ready, from what is known of the past now."""
        self._work = background.submit(_make_ready, self, past.history(), past.count)

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

    def take(self, past: Past) -> Ready:
        """Return what was made ready, brought up to the present sample.

        Raises:
            InputError: it could not be built.
        """
        assert self._work is not None
        found = self._work.result()
        if found.controller is not None and found.seen < past.count:
            found.controller.follow(past.since(found.seen))
        return found


def _make_ready(change: HandOver, history: History, seen: int) -> Ready:
    doubt = "" if change.judge is None else change.judge.doubt(change.make, history)
    if doubt:
        return Ready(None, seen, doubt)
    controller = change.make()
    if len(history.op):
        controller.take_over(history)
    return Ready(controller, seen, "")
