"""What is known of a loop from what it controls, held against the process that was found.

It decides nothing about the valve: a process that a loop of this kind cannot have says that
something else than the valve was fitted, and is told as a note.
"""

import dataclasses
import enum
from collections.abc import Mapping

from stiction_ros.identification.answer.step_answer import StepAnswer


class LoopKind(enum.StrEnum):
    """What a loop controls."""

    FLOW = "flow"
    PRESSURE = "pressure"
    LEVEL = "level"
    TEMPERATURE = "temperature"
    ANALYSER = "analyser"


@dataclasses.dataclass(frozen=True)
class Expected:
    """How a PV of one kind answers its valve."""

    fastest: float  # fastest, slowest: s until 63 % of the answer, dead time included
    slowest: float
    settles: bool | None  # whether it settles; None where both occur
    why: str  # half a sentence


EXPECTED: Mapping[LoopKind, Expected] = {
    LoopKind.FLOW: Expected(
        0.0, 60.0, True, "a flow follows its valve and a damped transmitter within a minute"
    ),
    LoopKind.PRESSURE: Expected(
        0.0, 3600.0, None, "a liquid's pressure follows within seconds, a gas is stored"
    ),
    LoopKind.LEVEL: Expected(10.0, float("inf"), None, "a vessel takes its time to fill"),
    LoopKind.TEMPERATURE: Expected(
        5.0, 7200.0, None, "a thermowell alone takes 5 s and more, a furnace up to two hours"
    ),
    LoopKind.ANALYSER: Expected(
        10.0, 14400.0, None, "a sample line and a mixed vessel take from 10 s to hours"
    ),
}
"""Limits that hold for nearly all loops of a kind: qualities after the guidelines of Seborg, Edgar,
Mellichamp, Process Dynamics and Control, chapter 12 (flow and liquid pressure fast and settling;
level and gas pressure integrating; temperature and composition slow); the figures are decades
beyond what is usual, so that only what cannot be is contradicted."""


def judged_by_kind(kind: LoopKind, answer: StepAnswer) -> tuple[bool | None, str]:
    """Return whether a process is one of this kind, and a sentence.

    Args:
        kind: of the loop.
        answer: of its PV to its valve.

    Returns:
        None where the sample time is too long to tell.
    """
    expected = EXPECTED[kind]
    if answer.lag is None:
        said = f"{answer.output} does not settle within the record"
        if expected.settles:
            return False, _against(kind, said, expected)
        return True, f"{said}, as a {kind} may"
    seconds = answer.dead_time + answer.lag
    said = f"{answer.output} answers its valve within {seconds:.3g} s"
    if seconds > expected.slowest:
        return False, _against(kind, said, expected)
    if seconds < expected.fastest:
        if expected.fastest <= 2.0 * answer.sample_time:
            return None, f"{said}, which samples of {answer.sample_time:g} s do not tell from more"
        return False, _against(kind, said, expected)
    return True, f"{said}, as a {kind} may"


def _against(kind: LoopKind, said: str, expected: Expected) -> str:
    return (
        f"{said}, which no {kind} does ({expected.why}): the model may have fitted a load or a "
        f"filter, and the friction with it"
    )
