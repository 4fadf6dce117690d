import math

import pytest

from stiction_ros.errors import InputError, is_finite


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (InputError("is wrong"), "is wrong"),
        (InputError("is wrong", where="a.yaml"), "a.yaml: is wrong"),
        (InputError("is wrong", fix="mend it"), "is wrong; mend it"),
        (InputError("is wrong", where="a.yaml", fix="mend it"), "a.yaml: is wrong; mend it"),
    ],
)
def test_an_error_is_one_line(error: InputError, line: str) -> None:
    assert str(error) == line


def test_within_puts_a_place_before_the_place() -> None:
    inner = InputError("is wrong", where="key", fix="mend it")
    assert str(inner.within("a.yaml")) == "a.yaml: key: is wrong; mend it"
    assert InputError("is wrong").within("a.yaml").where == "a.yaml"


@pytest.mark.parametrize(
    ("value", "finite"),
    [(1.0, True), (-1e308, True), (10**300, True), (10**400, False), (-(10**400), False),
     (math.nan, False), (math.inf, False), (-math.inf, False)],
)  # fmt: skip
def test_finite_numbers_are_told_from_others(value: float, finite: bool) -> None:
    assert is_finite(value) is finite
