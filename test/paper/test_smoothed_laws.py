"""Smoothed laws equal the hard ones, and every method of the paper takes them."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.effects import KanoStiction
from stiction_ros.errors import InputError
from stiction_ros.paper.methods import identify
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.paper.smoothed_laws import SMOOTH_LAWS, smooth_law

TAU = np.array([1e4])
FRICTION = np.array([[5.0037, 2.0011]])


@pytest.mark.parametrize("name", sorted(SMOOTH_LAWS))
def test_a_smoothed_law_has_the_signature_of_the_hard_one(name: str) -> None:
    law = smooth_law(name)
    # OP moves by 0.01 % and more or rests; no error of such an OP is within 10 / τ of f_S.
    op = np.round(loops.example1(3, samples=900).op, 2)
    smoothed, hard = law.stems(op, FRICTION, TAU), law.hard_stems(op, FRICTION)
    assert np.abs(smoothed - hard).max() < 1e-6
    assert np.ptp(hard) > 1.0


@pytest.mark.parametrize("name", sorted(SMOOTH_LAWS))
def test_a_step_is_the_simulated_law(name: str) -> None:
    law = smooth_law(name)
    op = loops.example1(3, samples=60).op
    state, made = [op[0, 0], *[0.0] * (law.states - 1)], []
    for value, last in zip(op[:, 0], np.append(op[0, 0], op[:-1, 0]), strict=True):
        state = law.step(state, (value, last), (*FRICTION[0], 7.0), np.tanh)
        made.append(state[0])
    assert made == pytest.approx(law.stems(op, FRICTION, np.array([7.0]))[0], abs=1e-9)


def test_a_law_without_a_smoothed_form_is_refused() -> None:
    with pytest.raises(InputError, match="smoothed form"):
        smooth_law("choudhury")


@pytest.mark.trial
@pytest.mark.parametrize("method", ["nlp", "grid"])
def test_kano_is_found_by_its_own_law(method: str) -> None:
    record = loops.example1(2, samples=1200, valve=KanoStiction(7.0, 3.0))
    own = PaperOptions(
        method=method,
        law="kano",
        delay=(5, 5),
        output_order=3,
        input_order=3,
        starts=4,
        grid_step=0.5,
        friction_limit=8.0,
    )
    found = identify(record, own)
    valve = found.valves[0]
    assert valve.law == "kano"
    assert valve.static_friction == pytest.approx(5.0, abs=0.15)
    assert valve.dynamic_friction == pytest.approx(2.0, abs=0.15)
    other = identify(record, dataclasses.replace(own, law="he"))
    assert found.search.squared_error < other.search.squared_error


@pytest.mark.trial
@pytest.mark.parametrize("method", ["nlp", "nlp_printed", "grid"])
def test_orders_may_differ_by_channel(method: str) -> None:
    record = loops.tank(1, samples=300)
    options = PaperOptions(
        method=method,
        delay=(0, 0),
        output_order=(1, 2),
        input_order=((1, 2), (2, 1)),
        starts=1,
        grid_step=4.0,
        friction_limit=10.0,
    )
    found = identify(record, options)
    first, second = found.outputs
    assert [len(first.a), len(second.a)] == [1, 2]
    assert [len(row) for row in first.b.values()] == [1, 2]
    assert [len(row) for row in second.b.values()] == [2, 1]
    alike = identify(record, dataclasses.replace(options, output_order=2, input_order=2))
    if method == "grid":  # a richer model of the same points never fits worse
        assert alike.search.objective <= found.search.objective


@pytest.mark.parametrize("wrong", [{"output_order": (1, 2, 3)}, {"input_order": ((1,), (2,))}])
def test_orders_that_do_not_fit_the_record_are_refused(wrong: dict[str, object]) -> None:
    options = PaperOptions(method="grid", **wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="orders"):
        identify(loops.tank(1, samples=300), options)
