"""An identification as it shows itself."""

import dataclasses
import io

import numpy as np
import pytest
from rich.console import Console

from stiction_ros.identification.result.cause import Cause, CauseKind
from stiction_ros.identification.result.identification import (
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
        profile=tuple((float(k), 1.0) for k in range(500)),
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
