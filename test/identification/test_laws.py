"""The exact search with every friction law, on loops whose valve follows that law."""

import math

import numpy as np
import pytest
import simulated_loops as loops

from stiction_ros.effects import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions, VerdictKind, identify
from stiction_ros.identification.friction import behaviour_of, find_law, laws, simulate
from stiction_ros.identification.result import Identification, ValveEstimate

LAWS = ("kano", "choudhury", "xch")


def options(law: str) -> IdentificationOptions:
    return IdentificationOptions("exact", output_order=3, input_order=3, law=law)


class Results(dict[str, tuple[Identification, FloatArray]]):
    """By law, what is identified of a loop with that law, and its true stem."""

    def __missing__(self, law: str) -> tuple[Identification, FloatArray]:
        record = loops.example1(2, samples=1000, valve=behaviour_of(law, (5.0, 2.0), {}))
        assert record.stem is not None
        self[law] = identify(record, options(law)), record.stem
        return self[law]


@pytest.fixture(scope="module")
def found() -> Results:
    return Results()


def valve_of(found: dict[str, tuple[Identification, FloatArray]], law: str) -> ValveEstimate:
    return found[law][0].valves[0]


@pytest.mark.parametrize("law", LAWS)
def test_true_friction_is_found(
    found: dict[str, tuple[Identification, FloatArray]], law: str
) -> None:
    valve, output = valve_of(found, law), found[law][0].outputs[0]
    assert valve.law == law
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_friction == pytest.approx(5.0, abs=0.05)
    assert valve.dynamic_friction == pytest.approx(2.0, abs=0.02)
    assert output.delay == {"V1": 5}
    assert output.noise_std == pytest.approx(0.01, rel=0.06)


@pytest.mark.parametrize("law", LAWS)
def test_stem_follows_the_true_one(
    found: dict[str, tuple[Identification, FloatArray]], law: str
) -> None:
    result, stem = found[law]
    assert np.sqrt(np.mean((result.stem - stem) ** 2)) < 0.05


@pytest.mark.parametrize("law", LAWS)
def test_a_note_tells_what_is_exact(
    found: dict[str, tuple[Identification, FloatArray]], law: str
) -> None:
    result, valve = found[law][0], valve_of(found, law)
    assert valve.evidence["patterns"] > 1
    assert valve.evidence["patterns_closed"] == 1.0
    (note,) = [note for note in result.notes if "switching patterns" in note]
    assert f"(law {law})" in note
    assert note.endswith("all at their edge are rejected")


def test_kano_and_xch_give_the_same_numbers(
    found: dict[str, tuple[Identification, FloatArray]],
) -> None:
    kano, xch = (valve_of(found, law) for law in ("kano", "xch"))
    assert (kano.static_friction, *kano.static_interval) == pytest.approx(
        (xch.static_friction, *xch.static_interval), abs=1e-6
    )
    assert (kano.dynamic_friction, *kano.dynamic_interval) == pytest.approx(
        (xch.dynamic_friction, *xch.dynamic_interval), abs=1e-6
    )


def test_where_op_rests_after_every_move_he_and_kano_give_the_same_numbers() -> None:
    record = loops.compensated(0).part(0, 1000)
    he, kano = (identify(record, options(law)).valves[0] for law in ("he", "kano"))
    assert he.static_interval == pytest.approx(kano.static_interval, abs=1e-6)
    assert he.dynamic_friction == pytest.approx(kano.dynamic_friction, abs=1e-6)
    assert he.evidence["delta_bic"] == pytest.approx(kano.evidence["delta_bic"])


@pytest.mark.parametrize("law", laws())
def test_rows_of_every_law_are_static_and_dynamic_friction(law: str) -> None:
    u = 8.0 * np.sin(np.arange(200) / 9.0)
    rows = np.array([[5.0, 2.0], [3.0, 3.0], [1.5, 0.25]])
    stems = simulate(find_law(law), rows, u, 0.5)
    alone = [behaviour_of(law, (s, d), {}).simulate(u, 0.5) for s, d in rows.tolist()]
    assert stems == pytest.approx(np.stack(alone, axis=1), abs=1e-12)


def test_equal_frictions_are_the_same_deadband_for_he_kano_and_xch() -> None:
    u = np.random.default_rng(0).standard_normal(300).cumsum()
    he, kano, xch = (
        simulate(find_law(law), np.array([[1.5, 1.5]]), u, 0.0) for law in ("he", "kano", "xch")
    )
    assert kano == pytest.approx(he)
    assert xch == pytest.approx(he)


def test_unknown_law_lists_all() -> None:
    with pytest.raises(InputError) as caught:
        find_law("nobody")
    assert all(law in str(caught.value) for law in laws())
    assert set(laws()) == {"he", "semi_physical", "kano", "choudhury", "xch"}


def test_a_law_whose_patterns_are_not_known_is_refused() -> None:
    with pytest.raises(InputError, match=r"law: .*'semi_physical'.*evidence"):
        identify(loops.example1(1, samples=500), options("semi_physical"))


def test_valve_without_friction_is_not_sticky() -> None:
    record = loops.example1(1, friction=(0.0, 0.0), samples=500)
    valve = identify(record, options("kano")).valves[0]
    assert valve.verdict is not VerdictKind.STICKY
    assert math.isfinite(valve.static_interval[1])
