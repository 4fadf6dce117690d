"""One case: a loop is started, a fault put into it, and what happens is noted."""

import dataclasses
import time
from pathlib import Path

from stiction_studies.faults.fault import Fault
from stiction_studies.faults.judgement.bag_check import check_bag
from stiction_studies.faults.judgement.flow import CALM, new_ops, recovered
from stiction_studies.faults.judgement.judge import LOOP, Outcome, judge
from stiction_studies.faults.judgement.notices import (
    GONE_WITHIN,
    SHOWN_WITHIN,
    changes_told,
    level_at,
    look_for,
)
from stiction_studies.faults.loop.reference import allowed_move
from stiction_studies.faults.loop.running import RunningLoop
from stiction_studies.faults.loop.setting_up import HAND_OVER, SETTLING, WARM_UP
from stiction_studies.faults.neighbour import Neighbour
from stiction_studies.faults.observation import BagFound, Ended, Known, Observation
from stiction_studies.faults.terms import Bag, Pace, Phase

START = 90.0  # s until the first samples; a first start compiles
SWAP = 20.0  # s until the controller has taken the prepared model
AGAIN = 5.0  # s after which it is offered again
QUIET = 20.0  # s until what the start has brought is no longer shown, at most
LOOK = 2.5  # s that every loop is looked at after its fault, at least
ENDING = 30.0  # s until a node that was killed is no longer seen in the graph
AWARE = ("embedding", "inversion")


@dataclasses.dataclass(frozen=True)
class Options:
    """How cases are run."""

    seed: int = 1  # of the plant's noise
    speed: float = 25.0  # simulated seconds per second of realtime pace
    two: bool = False  # whether a second loop runs beside it, which the fault must not reach


def run_case(
    fault: Fault, pace: Pace, phase: Phase, directory: Path, options: Options = Options()
) -> Outcome:
    """Run and judge one case.

    Args:
        fault, pace, phase: which.
        directory: an empty one, for parameters, logs and the bag.
        options: how.
    """
    started = time.monotonic()
    allowed = allowed_move(Phase.AFTER if fault.swaps else phase, options.seed)
    loop = RunningLoop(fault, pace, phase, options.seed, options.speed, directory)
    watched = _Watched(loop, fault)
    second = Neighbour(loop, options.seed, options.speed) if options.two else None
    try:
        if second is not None:
            second.start(START)
        loop.start()
        watched.run()
        seen = watched.observation(time.monotonic())
        if second is not None:
            second.compare()
    finally:
        if second is not None:
            second.end()
        loop.stop()
    # Where the suite stands between the nodes nobody waits for the recorder at the start.
    since = seen.begun if fault.relayed else 0.0
    heard = {
        topic: [one for one in taken if one.wall >= since]
        for topic, taken in loop.probe.heard.items()
    }
    bag = BagFound() if fault.bag is Bag.LOST else check_bag(loop.bag, heard)
    seen = dataclasses.replace(
        seen,
        bag=bag,
        logs={name: node.log for name, node in loop.nodes.items()},
        remarks=tuple(loop.remarks),
    )
    _tell(seen, directory / "statuses.txt")
    outcome = judge(fault, pace, seen, allowed)
    return dataclasses.replace(outcome, seconds=time.monotonic() - started)


def _tell(seen: Observation, path: Path) -> None:
    """Write every change of a status, in seconds after the fault began."""
    lines = [f"the fault was over after {seen.over - seen.begun:.2f} s"]
    lines += changes_told(seen.statuses, seen.begun)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


class _Watched:
    """One loop on its way through a case."""

    def __init__(self, loop: RunningLoop, fault: Fault) -> None:
        self._loop, self._fault = loop, fault
        self._over = time.monotonic()
        self._before = Known()
        self._written: dict[str, int] = {}  # characters in the logs when the fault began

    def run(self) -> None:
        """Start the loop, put the fault into it, look at what becomes of it."""
        loop, fault = self._loop, self._fault
        if not fault.from_start:
            if not self._ready():
                self._over = time.monotonic()
                loop.begins()
                return
            self._before = loop.known
        self._written = {name: len(node.log) for name, node in loop.nodes.items()}
        loop.begins()
        fault.put(loop)
        if fault.from_start:
            self._ready()
            self._before = loop.known
        self._over = time.monotonic()
        notices = fault.noticed_in(loop.pace)
        bound = max(fault.recovery, GONE_WITHIN + SHOWN_WITHIN if notices else 0.0, LOOK) + CALM
        if loop.pace in fault.ends:
            bound = ENDING
        loop.wait_until(self._settled, bound)
        for topic in loop.probe.unheard:
            loop.remark(f"nobody heard what was said on {topic}")

    def observation(self, until: float) -> Observation:
        """Return what was seen so far."""
        loop = self._loop
        ended = {
            name: Ended(node.code, node.log[self._written.get(name, 0) :], node.by_fault)
            for name, node in loop.nodes.items()
            if node.code is not None
        }
        heard = {topic: tuple(taken) for topic, taken in loop.probe.heard.items()}
        return Observation(
            loop.phase,
            loop.period,
            loop.step,
            loop.begun,
            self._over,
            until,
            heard["op_applied"],
            heard["op"],
            heard["pv"],
            tuple(loop.probe.statuses),
            self._before,
            loop.known,
            ended,
        )

    def _ready(self) -> bool:
        """Wait until the loop runs, in the phase that is asked for."""
        loop = self._loop
        taken = loop.heard("pv")
        if not loop.wait_until(lambda: len(taken) >= WARM_UP or self._ended(), START):
            loop.remark(f"only {len(taken)} samples came within {START:g} s of the start")
            return False
        if self._ended():
            loop.remark(f"{', '.join(self._ended())} ended at the start")
            return False
        if loop.phase is Phase.AFTER and not self._swapped():
            return False
        loop.wait_until(self._quiet, QUIET)
        return True

    def _swapped(self) -> bool:
        loop = self._loop
        taken = loop.heard("pv")
        loop.wait_until(lambda: len(taken) >= HAND_OVER + WARM_UP, START)
        for _ in range(round(SWAP / AGAIN)):  # a controller that came late knows too little yet
            loop.offer(loop.model)
            if loop.wait_until(lambda: loop.known.mode in AWARE or self._ended(), AGAIN):
                return loop.wait_samples(SETTLING)
        loop.remark(f"the prepared model was not taken within {SWAP:g} s")
        return False

    def _quiet(self) -> bool:
        now = time.monotonic()
        statuses = tuple(self._loop.probe.statuses)
        heard = bool(self._loop.known.mode)
        return heard and all(level_at(statuses, name, now) == "ok" for name in LOOP)

    def _ended(self) -> list[str]:
        return [name for name, node in self._loop.nodes.items() if node.code is not None]

    def _settled(self) -> bool:
        """Return whether nothing more is to be expected: to wait longer would tell no more."""
        now = time.monotonic()
        loop, fault = self._loop, self._fault
        if loop.pace in fault.ends:
            return all(loop.nodes[name].code is not None for name in LOOP)
        if now - self._over < LOOK:
            return False
        seen = self.observation(now)
        back = recovered(seen, new_ops(seen))
        known = fault.forgets or loop.known == self._before
        shown = all(not look_for(one, seen).reason for one in fault.noticed_in(loop.pace))
        return back is not None and known and shown
