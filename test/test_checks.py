import math
from collections.abc import Callable
from typing import Any

import pytest

from stiction_ros import (
    ControlSettings,
    CsvColumns,
    HeStiction,
    IdentificationOptions,
    LinearOptions,
    LoopModel,
    MpcController,
    find_config,
    find_gap,
    simulate,
)
from stiction_ros.checks import LONGEST, number, one_of, shown
from stiction_ros.control.result import ControlMode
from stiction_ros.errors import InputError
from stiction_ros.identification.friction import find_law
from stiction_ros.loop.yaml_reading import Section
from stiction_ros.settings import from_mapping
from stiction_ros.signals.subspace_projection import SubspaceMethod

MODEL = LoopModel.load(find_config("example1_process.loop.yaml"))
DESIGN = ControlSettings(horizon=30).design(MODEL)

WRONG: dict[str, tuple[Any, dict[str, Any], str]] = {
    "text": ("1e-3", {}, "place: '1e-3' is no number; write 0.001"),
    "word": ("much", {}, "place: 'much' is no number"),
    "true": (True, {}, "place: True is no number"),
    "part": (1.5, {"whole": True}, "place: 1.5 is no whole number"),
    "infinite": (math.inf, {}, "place: inf is not finite; give a finite number"),
    "no number": (math.nan, {"unlimited": True}, "place: nan is out of range; use ≥ -inf"),
    "low": (-1, {"low": 0.0}, "place: -1 is out of range; use ≥ 0"),
    "high": (7, {"low": 0.0, "high": 5.0, "unit": "%"}, "place: 7 is out of range; use [0, 5] %"),
    "above": (0.0, {"above": 0.0}, "place: 0 is out of range; use > 0"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_said_with_its_place_and_its_fix(name: str) -> None:
    value, limits, said = WRONG[name]
    with pytest.raises(InputError) as error:
        number(value, "place", **limits)
    assert str(error.value) == said


def test_a_whole_number_of_any_size_is_told_not_to_fit() -> None:
    with pytest.raises(InputError, match="is not finite"):
        number(10**400, "place", whole=True)
    assert len(shown(10**400)) == LONGEST


def test_numbers_come_back_in_their_type() -> None:
    assert (type(number(2, "place")), type(number(2, "place", whole=True))) == (float, int)
    assert number(-math.inf, "place", unlimited=True) == -math.inf


def test_settings_files_and_behaviours_say_the_same_of_the_same_mistake() -> None:
    said = []
    for make in (
        lambda: HeStiction(-1.0, 0.0),
        lambda: Section({"f_s": -1.0}, "f_s").number("f_s", low=0.0),
        lambda: from_mapping(ControlSettings, {"jump_price": -1.0}, "file"),
    ):
        with pytest.raises(InputError) as error:
            make()
        said.append(error.value.what)
    assert set(said) == {"-1 is out of range"}


def test_a_choice_is_taken_by_its_word_or_refused_with_the_closest() -> None:
    assert one_of("hold", ControlMode, "mode") is ControlMode.HOLD
    assert one_of(ControlMode.HOLD, ("embedding", "hold"), "mode") == "hold"
    with pytest.raises(InputError) as error:
        one_of("Embeding", ControlMode, "mode")
    assert str(error.value) == (
        "mode: unknown value 'Embeding'; use unaware | embedding | inversion | hold | valve_test; "
        "did you mean embedding?"
    )
    many = [f"FIC{number}" for number in range(100)]
    for wrong, told in ((None, "FIC19 | and 80 more$"), (["FIC1"], "value ")):
        with pytest.raises(InputError, match=told):
            one_of(wrong, many, "op")


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: MpcController(DESIGN, "embeding"), "mode: .* did you mean embedding?"),
        (lambda: MpcController(MODEL, "embedding"), "design: LoopModel is no ControlDesign; give"),  # type: ignore[arg-type]
        (lambda: ControlSettings(observer="kalmann"), "observer: .* did you mean kalman?"),
        (lambda: ControlSettings(formulation="paper"), "formulation: unknown value 'paper'; use"),
        (lambda: IdentificationOptions(method="evidenz"), "method: .* did you mean evidence?"),
        (lambda: IdentificationOptions(kind="flo"), "kind: unknown kind 'flo'; .* mean flow?"),
        (lambda: find_law("chouhury"), "law: unknown friction law .* mean choudhury?"),
        (lambda: LinearOptions(method="pca"), "method: unknown value 'pca'; .*cva"),  # type: ignore[arg-type]
        (lambda: LinearOptions(criterion="bix"), "criterion: .* did you mean bic?"),  # type: ignore[arg-type]
        (lambda: CsvColumns(op=3), "op: int is no list; give a column, a list of them, or"),
        (lambda: simulate("flow.loop.yaml"), "model: str is no LoopModel; give LoopModel.load"),  # type: ignore[arg-type]
        (lambda: find_gap("flow.loop.yaml", []), "model: str is no LoopModel"),  # type: ignore[arg-type]
        (lambda: find_gap(MODEL, [3]), "record: int is no record; give a Record"),  # type: ignore[list-item]
    ],
)
def test_a_wrong_word_or_kind_gets_a_sentence(call: Callable[[], object], told: str) -> None:
    with pytest.raises(InputError, match=told.replace("?", r"\?")):
        call()


def test_a_choice_may_be_said_by_its_text() -> None:
    assert LinearOptions(method="n4sid").method is SubspaceMethod.N4SID  # type: ignore[arg-type]
    assert MpcController(DESIGN, "unaware").mode is ControlMode.UNAWARE
    columns = CsvColumns(op="valve", pv=["flow", "level"])
    assert (columns.op, columns.pv) == ({"V1": "valve"}, {"PV1": "flow", "PV2": "level"})
