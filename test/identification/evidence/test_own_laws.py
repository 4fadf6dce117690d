"""Each valve's own law: told where the record tells it, He's where it does not."""

import dataclasses

import numpy as np
import pytest
import simulated_loops as loops
from evidence_loops import pi_loop

from stiction_ros.effects import KanoStiction
from stiction_ros.identification import Identification, IdentificationOptions, identify
from stiction_ros.identification.evidence.fit_problem import Problem
from stiction_ros.identification.evidence.laws import with_own_laws
from stiction_ros.identification.evidence.rates import looks
from stiction_ros.identification.friction import find_law
from stiction_ros.paper.paper_options import PaperOptions
from stiction_ros.records.record import Record


@pytest.fixture(scope="module")
def moving() -> Identification:
    """What is found of a loop whose valve goes on while OP goes on."""
    valve = KanoStiction(7.0, 3.0)
    return identify(loops.example1(2, samples=700, valve=valve))


@pytest.mark.trial
def test_a_law_that_explains_pv_better_is_named_and_its_figures_are_true(
    moving: Identification,
) -> None:
    (valve,) = moving.valves
    assert valve.law == "kano"
    assert valve.to_dict()["law"] == "kano"
    assert valve.static_interval[0] <= 5.0 <= valve.static_interval[1]
    assert valve.dynamic_interval[0] <= 2.0 <= valve.dynamic_interval[1]
    assert valve.jump == pytest.approx(3.0, abs=0.1)


def test_a_note_says_by_how_much_and_which_laws_cannot_be_told_apart(
    moving: Identification,
) -> None:
    (note,) = [note for note in moving.notes if "explains PV better" in note]
    assert note.startswith("friction of V1: law kano explains PV better than he by ")
    assert note.endswith("; xch cannot be told from it by this record")


def test_each_valve_of_a_problem_has_its_own_law() -> None:
    one, two = pi_loop(3.0, 1.0, samples=300), pi_loop(3.0, 1.0, samples=300, seed=1)
    op, pv = np.hstack([one.op, two.op]), np.hstack([one.pv, two.pv])
    he = Problem.of(Record("two", 1.0, ("V1", "V2"), ("PV1", "PV2"), op, pv))
    kano, friction = he.under(1, find_law("kano")), np.array([[0.1, 0.02]])
    assert [law.law for law in kano.laws] == ["he", "kano"]
    for valve, same in ((0, True), (1, False)):
        stems = [each.stems(valve, friction, 0.0) for each in (he, kano)]
        assert np.array_equal(*stems) is same


@pytest.mark.trial
def test_he_is_kept_where_no_other_law_is_better_by_more_than_chance() -> None:
    record = pi_loop(3.0, 1.0)
    own, he = (identify(record, IdentificationOptions(law=law)) for law in ("auto", "he"))
    assert own.valves[0].law == "he"
    assert dataclasses.replace(own, seconds=0.0, stem=he.stem) == dataclasses.replace(
        he, seconds=0.0
    )
    assert np.array_equal(own.stem, he.stem)


def test_a_law_that_is_given_is_kept() -> None:
    record, options = pi_loop(3.0, 1.0), IdentificationOptions(law="he")
    seen = looks(record, options)
    assert with_own_laws(seen, options) == (seen, ("",))


def test_the_other_methods_keep_he_s_law() -> None:
    options = IdentificationOptions("exact", output_order=1, delay=(0, 4))
    assert identify(pi_loop(3.0, 1.0), options).valves[0].law == "he"
    assert PaperOptions.of(options, "grid").law == "he"
