from typing import Any

import numpy as np
import pytest

from stiction_ros.errors import InputError
from stiction_ros.processes import LinearModel

GOOD: dict[str, Any] = {
    "a": np.diag([0.5, 0.8]),
    "b": np.ones((2, 1)),
    "c": np.ones((1, 2)),
    "e": np.zeros((2, 0)),
    "constant": np.zeros(2),
    "stem0": np.zeros(1),
    "pv0": np.zeros(1),
}


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("a", np.ones((2, 3))),
        ("b", np.ones((2, 2))),
        ("b", np.ones((3, 1))),
        ("c", np.ones((1, 3))),
        ("c", np.ones((2, 2))),
        ("e", np.ones((1, 1))),
        ("constant", np.zeros(3)),
    ],
)
def test_a_shape_that_does_not_fit_is_named(key: str, value: np.ndarray) -> None:
    with pytest.raises(InputError) as caught:
        LinearModel(**GOOD | {key: value})
    assert (caught.value.where, bool(caught.value.fix)) == (key, True)


@pytest.mark.parametrize("key", ["a", "b", "c", "constant", "stem0", "pv0"])
def test_a_value_that_is_not_finite_is_named(key: str) -> None:
    values = np.array(GOOD[key], dtype=float)
    values.flat[0] = np.nan
    with pytest.raises(InputError) as caught:
        LinearModel(**GOOD | {key: values})
    assert caught.value.where == key


def test_arrays_are_read_only_copies() -> None:
    mine = np.diag([0.5, 0.8])
    model = LinearModel(**GOOD | {"a": mine})
    mine[0, 0] = 9.0
    assert model.a[0, 0] == 0.5
    with pytest.raises(ValueError):
        model.a[0, 0] = 1.0


def test_gain_is_the_limit_of_the_step_response() -> None:
    model = LinearModel(**GOOD)
    x = np.zeros(2)
    for _ in range(400):
        x = model.a @ x + model.b @ np.ones(1)
    assert model.gain == pytest.approx((model.c @ x)[None])


def test_gain_of_an_integrator_is_infinite() -> None:
    model = LinearModel(**GOOD | {"a": np.eye(2)})
    assert np.isinf(model.gain).all()
