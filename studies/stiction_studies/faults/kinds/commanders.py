"""Others who send OP."""

from collections.abc import Callable

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.kinds.signal_junk import MALFORMED, STAMPS, flood, said
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.terms import Notice, Pace, Phase

STRANGER = "/somebody"
COMMANDER = "/controller"
BESIDE = 6.0  # s that a second controller runs
SIGHT = 1.0  # s by which nodes of the loop may see it before the suite's own node does


def stranger(frame_id: str) -> Callable[[RunningLoop], None]:
    """Return what sends an OP of 10⁶ and a credible one under another name, or none."""

    def put(loop: RunningLoop) -> None:
        for value in (1e6, -1e6, 0.0, 100.0, 50.0):
            for _ in range(4):
                loop.say("op", value, frame_id=frame_id)
                loop.wait_samples(1, 1.0)
        loop.probe.silence("op")

    return put


def second_controller(name: str) -> Callable[[RunningLoop], None]:
    """Return what runs another controller for a while."""

    def put(loop: RunningLoop) -> None:
        loop.beside("controller", name)
        if not loop.wait_until(lambda: loop.probe.publishers("op") > 1, 30.0):
            loop.remark("the second controller did not start")
        loop.begins(earlier=SIGHT)
        loop.wait(BESIDE)
        loop.end_beside()

    return put


REFUSED = (Notice("plant", "warn"),)
TWO = (Notice("plant", "error"), Notice("controller", "error"))

FAULTS = (
    Fault(
        "op-stranger",
        "an OP under another name is refused; the sender is named",
        stranger(STRANGER),
        notices=REFUSED,
    ),
    Fault(
        "op-nameless",
        "an OP without a name is refused",
        stranger(""),
        phases=(Phase.AFTER,),
        notices=REFUSED,
    ),
    Fault(
        "op-flood",
        "thousands of OPs under another name do not stop the loop",
        flood("op", values=1e6, frame_id=STRANGER),
        notices=REFUSED,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "op-malformed",
        "an OP under the right name that cannot be read is refused",
        said("op", MALFORMED, frame_id=COMMANDER),
        notices=REFUSED,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "op-stamps",
        "an OP under the right name with a stamp of the past or the far future is refused",
        said("op", STAMPS, frame_id=COMMANDER, values=90.0),
        notices=REFUSED,
    ),
    Fault(
        "second-controller",
        "a controller of another name is not obeyed, and reported",
        second_controller("controller2"),
        (Pace.REALTIME,),
        notices=REFUSED,
        phases=(Phase.AFTER,),
    ),
    Fault(
        "second-controller-same-name",
        "two controllers of one name: both nodes that notice report it, and the first OP of a "
        "sample wins",
        second_controller("controller"),
        (Pace.REALTIME,),
        notices=TWO,
        forgets=True,
        silence=3.0,
    ),
)
