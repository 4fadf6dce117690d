"""An identification as it shows itself."""

import dataclasses
import io

import numpy as np
import pytest
from rich.console import Console

from stiction_ros.identification.answer.summary import cause_of, materiality, next_step, why
from stiction_ros.identification.result import (
    Cause,
    CauseKind,
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)

NAME = "<FV&1>[b]"


def answer(verdict: VerdictKind = VerdictKind.STICKY, valves: int = 1) -> Identification:
    estimate = ValveEstimate(
        name=NAME,
        verdict=verdict,
        law="he",
        static_friction=4.02,
        static_interval=(3.9, 4.1),
        dynamic_friction=1.52,
        dynamic_interval=(1.4, 1.6),
        jump=2.5,
        stem_start=50.0,
        moves=40,
        evidence={f"figure_{k}": float(k) for k in range(50)},
        band_share=1.02,
        experiment="Too little moved. Step OP by 5 % twice.",
    )
    cause = Cause(CauseKind.VALVE, 45.0, 7.0, 1.2, "Without the friction the cycle goes away.")
    output = OutputModel(
        "FT1", (-0.9,), {NAME: (0.08,)}, {NAME: 2}, 0.0, 0.05, 80.0, 93.2, cause=cause
    )
    return Identification(
        status=FitStatus.OK,
        reason="",
        method="evidence",
        samples=600,
        sample_time=2.0,
        seconds=1.0,
        valves=(estimate,) * valves,
        outputs=(output,),
        stem=np.zeros((600, valves)),
        notes=tuple(f"note {k} " + "of many words " * 8 for k in range(9)),
    )


def test_its_repr_is_one_line() -> None:
    assert repr(answer()) == f"<Identification ok: {NAME} sticky; 600 samples>"
    (valve,) = answer().valves
    assert repr(valve) == f"<ValveEstimate {NAME}: sticky, f_S 4.02 %, f_D 1.52 %, law he>"
    none = dataclasses.replace(answer(), valves=(), status=FitStatus.NO_MODEL, reason="OP rests")
    assert repr(none) == "<Identification no_model: OP rests; 600 samples>"


@pytest.mark.parametrize("kind", VerdictKind)
def test_its_summary_is_one_screen_of_sentences_with_units(kind: VerdictKind) -> None:
    text = answer(kind).summary()
    lines = text.splitlines()
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 80
    assert lines[0] == "600 samples of 2 s, 1200 s of operation"
    assert f"{NAME}: {kind}" in text
    assert ("f_S 4.02 % (3.90 to 4.10 %)" in text) == (kind is not VerdictKind.HEALTHY)
    assert "What to do next: " in text
    assert f"FT1: gain 0.8 per % of {NAME}, delay 4 s; fit of PV computed from OP" in text
    assert "FT1: cause of the oscillation: valve; period 45 s, amplitude 1.2 PV units." in text
    assert "6 more notes" in text


def test_an_integrator_has_no_gain_and_a_failed_fit_a_reason() -> None:
    found = answer()
    (output,) = found.outputs
    level = dataclasses.replace(output, a=(-1.0,), cause=None)
    told = dataclasses.replace(found, outputs=(level,), reason="it wanders", notes=()).summary()
    assert "The fit is not to be trusted: it wanders" in told
    assert "FT1: integrates <FV&1>[b], delay 4 s" in told


def test_its_tables_have_a_row_for_each_valve_and_escape_names() -> None:
    found = answer(valves=2)
    page = found._repr_html_()
    assert page.count("<tr>") == 3
    assert page.count("<td>&lt;FV&amp;1&gt;[b]</td><td>sticky</td><td></td><td>4.02</td>") == 2
    assert NAME not in page
    target = io.StringIO()
    Console(file=target, width=80).print(found)
    shown = target.getvalue()
    assert shown.count("3.90 to 4.10") == shown.count(NAME) == 2


STICKY, BACKLASH, HEALTHY, UNDECIDED = VerdictKind


def found(verdict: VerdictKind, kind: CauseKind | None, **changes: object) -> Identification:
    """Return an answer on one valve whose loop cycles for a reason, or was not closed."""
    valve = ValveEstimate(
        name="V1",
        verdict=verdict,
        law="he",
        static_friction=0.0 if verdict is HEALTHY else 3.0,
        static_interval=(0.0, 0.4) if verdict is HEALTHY else (2.8, 3.2),
        dynamic_friction=0.0 if verdict is HEALTHY else 1.0,
        dynamic_interval=(0.0, 0.3) if verdict is HEALTHY else (0.9, 1.1),
        jump=2.0 if verdict is STICKY else 0.0,
        stem_start=50.0,
        moves=40,
        evidence={"loop_gone": 0.8},
        band_share=0.0 if verdict is HEALTHY else 0.42,
        experiment="It is not clear. Do this. Or that." if verdict is UNDECIDED else "",
    )
    cause = None if kind is None else Cause(kind, 60.0, 2.0, 0.5, "A sentence.")
    model = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 3}, 0.0, 0.1, 90.0, 80.0, cause)
    valve = dataclasses.replace(valve, **changes)  # type: ignore[arg-type]
    return Identification(
        FitStatus.OK, "", "exact", 400, 2.0, 0.1, (valve,), (model,), np.zeros((400, 1))
    )


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        (
            STICKY,
            "When OP turns, the stem of V1 rests until OP has gone back by 4.00 %, and then jumps "
            "by 2.00 % or more.",
        ),
        (
            BACKLASH,
            "When OP turns, the stem of V1 rests until OP has gone back by 4.00 %; it then "
            "follows, without a jump that this record shows.",
        ),
        (HEALTHY, "The stem of V1 follows OP: f_S above 0.40 % is ruled out by this record."),
        (UNDECIDED, "It is not clear."),
    ],
)
def test_why(verdict: VerdictKind, said: str) -> None:
    assert why(found(verdict, CauseKind.VALVE), 0) == said


@pytest.mark.parametrize(
    ("evidence", "share", "said"),
    [
        (
            {"loop_gone": 0.8},
            0.42,
            "42 % of OP's movement; in simulation 80 % of the loop's movement",
        ),
        ({"loop_gone": 0.0}, 0.42, "in simulation the loop moves as much without it"),
        ({}, 0.42, "what goes away without it is not known"),
        ({"loop_gone": 0.8}, 1.7, "takes 100 % of OP's movement"),
    ],
)
def test_materiality(evidence: dict[str, float], share: float, said: str) -> None:
    answer = found(STICKY, CauseKind.VALVE, evidence=evidence, band_share=share)
    assert said in materiality(answer.valves[0])


def test_without_friction_nothing_is_material() -> None:
    assert materiality(found(HEALTHY, CauseKind.NONE).valves[0]) == ""


def test_an_undecided_loop_that_does_not_cycle_says_so() -> None:
    quiet, cycling = found(UNDECIDED, CauseKind.NONE), found(UNDECIDED, CauseKind.TUNING)
    assert why(quiet, 0).startswith("The loop does not oscillate: nothing to repair is visible.")
    assert "does not oscillate" not in why(cycling, 0)


@pytest.mark.parametrize(
    ("verdict", "kind", "said"),
    [
        (
            STICKY,
            CauseKind.VALVE,
            "Have V1 serviced (packing and positioner first), unless `stiction gain`",
        ),
        (BACKLASH, CauseKind.VALVE, "Have V1 serviced (linkage and positioner first"),
        (STICKY, CauseKind.TUNING, "First retune the controller: it rings with the process; then"),
        (STICKY, CauseKind.NONE, "The friction makes no cycle: have V1 serviced"),
        (STICKY, None, "The friction makes no cycle"),
        (HEALTHY, CauseKind.NONE, "Nothing is to be done about this valve."),
        (HEALTHY, CauseKind.DISTURBANCE, "Leave the valve and look upstream"),
        (HEALTHY, CauseKind.SET_POINT, "Leave the valve and look at what moves the set-point"),
        (UNDECIDED, CauseKind.VALVE, "Do this. Or that."),
        (UNDECIDED, CauseKind.NONE, "Nothing, while the loop is calm. What would decide: do this."),
    ],
)
def test_what_to_do_next(verdict: VerdictKind, kind: CauseKind | None, said: str) -> None:
    assert next_step(found(verdict, kind), 0).startswith(said)


def test_of_several_outputs_the_one_that_the_valve_makes_cycle_counts() -> None:
    answer = found(STICKY, CauseKind.TUNING)
    (model,) = answer.outputs
    made = Cause(CauseKind.VALVE, 30.0, 2.0, 0.5, "Made by it.")
    both = dataclasses.replace(
        answer, outputs=(model, dataclasses.replace(model, name="PV2", cause=made))
    )
    assert cause_of(both, 0) is made
    assert cause_of(answer, 0) is model.cause
    alone = dataclasses.replace(answer, outputs=(dataclasses.replace(model, b={"V2": (0.1,)}),))
    assert cause_of(alone, 0) is None
