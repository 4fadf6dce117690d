"""One case: a bridged loop under control, a fault, control once more; and the verdict."""

import dataclasses
import math
import re
import time
from pathlib import Path

from stiction_studies.control_system.control_system import AUTO
from stiction_studies.control_system.journal import Written
from stiction_studies.faults.bridge.bridge_fault import BridgeFault
from stiction_studies.faults.bridge.bridged_loop import WATCHDOG, BridgedLoop, NotSeenError
from stiction_studies.faults.judgement.bag_check import check_bag
from stiction_studies.faults.judgement.judge import Verdict, wrong_in_logs
from stiction_studies.faults.judgement.notices import changes_told
from stiction_studies.faults.observation import BagFound, Shown

SMOOTH = 1.0  # %: what OP may step by at a transfer of control
SCANS = 3  # of the plant, beside the watchdog's time: it looks once a scan
TAKING_OVER = 4 * WATCHDOG  # s for which it is waited for


@dataclasses.dataclass(frozen=True)
class Seen:
    """Everything that is judged of one case."""

    # begun, mended: wall times of the fault and of its end, s; nan when it was never reached
    begun: float
    mended: float
    period: float  # wall time of a sample, s
    written: Written  # by the plant's own journal
    statuses: tuple[Shown, ...]  # of all nodes
    bag: BagFound  # of the run
    logs: dict[str, str]  # of all nodes
    ended: dict[str, int]  # exit code of nodes that ended though no fault ended them
    limited: int  # OPs before the fault that the bridge had to limit
    remarks: tuple[str, ...] = ()  # what the case itself found wrong


@dataclasses.dataclass(frozen=True)
class BridgeOutcome(Verdict):
    """The verdict of one case."""

    fault: str  # its name
    ops: int  # that were written
    limited: int  # of those before the fault, that limits or rate had changed
    ungranted: int  # of these, while no mode granted them
    refused: int  # that the plant refused
    beyond: float  # furthest that one was beyond limits or rate, %
    in_charge: float | None  # s from the fault until the plant's own controllers had the valves
    step: float  # largest step of OP at a transfer of control, %
    transfers: int  # of control
    noticed: float | None  # s from the fault until ``/diagnostics`` said so
    said: str  # what they said
    back: float | None  # s from the end of the fault until OPs were written again
    bag: BagFound  # messages that were heard, and those missing in the bag


def run_case(fault: BridgeFault, directory: Path, seed: int) -> BridgeOutcome:
    """Run and judge one case below ``directory``, which is empty."""
    started = time.monotonic()
    loop = BridgedLoop(directory, seed, fault.rests)
    mended = math.nan
    try:
        loop.start()
        loop.begins()
        fault.put(loop)
        if fault.taken_over:
            loop.wait_until(lambda: loop.mode == AUTO, TAKING_OVER)
            loop.wait_until(lambda: _said(fault, loop)[0] is not None, fault.within)
        fault.mend(loop)
        mended = time.monotonic()
        if fault.taken_over:
            loop.obtain()
        loop.take_back()
    except NotSeenError as missing:
        loop.remark(str(missing))
    finally:
        loop.stop()
    _look_for_secrets(loop)
    seen = Seen(
        loop.begun or math.nan,
        mended,
        loop.period,
        loop.written(),
        _statuses(loop),
        check_bag(loop.bag, loop.probe.heard),
        {name: node.log for name, node in loop.nodes.items()},
        {n: node.code for n, node in loop.nodes.items() if node.code and not node.by_fault},
        loop.limited,
        tuple(loop.remarks),
    )
    _tell(seen, directory / "statuses.txt")
    return dataclasses.replace(judge(fault, seen), seconds=time.monotonic() - started)


def _look_for_secrets(loop: BridgedLoop) -> None:
    """Remark a password in a log or on the diagnostics."""
    told = [node.log for node in loop.nodes.values()]
    told += [one.text for one in _statuses(loop)]
    for user in loop.plant.users:
        word = loop.plant.password_file(user).read_text(encoding="utf-8")
        if any(word in text for text in told):
            loop.remark(f"the password of {user} is told")


def _said(fault: BridgeFault, loop: BridgedLoop) -> tuple[float | None, str]:
    return _noticed(fault, _statuses(loop), loop.begun)


def _statuses(loop: BridgedLoop) -> tuple[Shown, ...]:
    """Return the statuses of nodes and of their tasks, in the order in which they came."""
    return tuple(sorted((*loop.probe.statuses, *loop.probe.tasks), key=lambda one: one.wall))


def _noticed(
    fault: BridgeFault, statuses: tuple[Shown, ...], begun: float
) -> tuple[float | None, str]:
    """Return when the fault was told by its node, s after it began, and what was said."""
    for one in statuses:
        if one.wall >= begun and one.node == fault.by and re.search(fault.shown, one.text):
            return one.wall - begun, one.text
    return None, ""


def judge(fault: BridgeFault, seen: Seen) -> BridgeOutcome:
    """Hold what was seen of a case against what is expected."""
    done, reasons = seen.written, list(seen.remarks)
    reasons += _writing(fault, seen)
    in_charge = _in_charge(seen)
    reasons += _taking_over(fault, in_charge, seen.period)
    step = max(done.steps, default=0.0)
    transfers = 4 if fault.taken_over else 2
    if step > SMOOTH:
        reasons.append(f"OP steps by {step:.2f} % at a transfer of control")
    if len(done.steps) != transfers:
        reasons.append(f"control passed {len(done.steps)} times, not {transfers}")
    noticed, said = _noticed(fault, seen.statuses, seen.begun) if fault.shown else (None, "")
    if fault.shown and noticed is None:
        reasons.append(f"{fault.by} never said {fault.shown}")
    elif noticed is not None and noticed > fault.within:
        reasons.append(f"told after {noticed:.1f} s, allowed are {fault.within:g}")
    reasons += _rest(seen)
    again = [wall for mode, wall in done.modes if mode != AUTO and wall > seen.mended]
    return BridgeOutcome(
        fault.name,
        done.taken,
        seen.limited,
        done.ungranted,
        done.refused,
        done.beyond,
        in_charge if fault.taken_over else None,
        step,
        len(done.steps),
        noticed,
        said,
        again[0] - seen.mended if again else None,
        seen.bag,
        reasons=tuple(reasons),
    )


def _writing(fault: BridgeFault, seen: Seen) -> list[str]:
    done, found = seen.written, []
    if done.ungranted:
        found.append(f"{done.ungranted} OPs were written without a grant")
    if done.refused > fault.refused:
        found.append(f"{done.refused} OPs were sent that the plant refused")
    if done.beyond > 0.0:
        found.append(f"an OP was {done.beyond:.3g} % beyond limits or rate")
    if not seen.limited:
        found.append("no OP had to be limited: nothing is shown of limits and rate")
    return found


def _in_charge(seen: Seen) -> float | None:
    """Return s from the fault to the plant's own controllers; None when they did not come."""
    until = seen.mended if math.isfinite(seen.mended) else math.inf
    found = [w for mode, w in seen.written.modes if mode == AUTO and seen.begun <= w <= until]
    return found[0] - seen.begun if found else None


def _taking_over(fault: BridgeFault, in_charge: float | None, period: float) -> list[str]:
    if not fault.taken_over:
        return [] if in_charge is None else ["the plant took over though it should not"]
    if in_charge is None:
        return ["the plant did not take over"]
    allowed = WATCHDOG + SCANS * period
    if in_charge > allowed:
        return [f"the plant took over after {in_charge:.2f} s, allowed are {allowed:.2f}"]
    return []


def _rest(seen: Seen) -> list[str]:
    """Return what is wrong with bag, processes and logs."""
    found = [f"{name} ended with code {code}" for name, code in seen.ended.items()]
    if seen.bag.reason:
        found.append(f"the bag cannot be read: {seen.bag.reason}")
    elif seen.bag.missing or not seen.bag.expected:
        found.append(f"{seen.bag.missing} of {seen.bag.expected} messages are not in the bag")
    return found + wrong_in_logs(seen.logs)


def _tell(seen: Seen, path: Path) -> None:
    """Write every change of a status, in seconds after the fault began."""
    lines = changes_told(seen.statuses, seen.begun)
    lines += [f"{wall - seen.begun:8.2f} mode {mode}" for mode, wall in seen.written.modes]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
