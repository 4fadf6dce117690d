from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.config_files import find_config
from stiction_ros.errors import InputError
from stiction_ros.loop import SetPoints

TWO: dict[str, Any] = {
    "repeat": 100.0,
    "moves": [
        {"time": 0.0, "A": 1.0, "B": 5.0},
        {"time": 20.0, "A": 2.0},
        {"time": 70.0, "B": 6.0},
    ],
}


def read(document: Any, outputs: tuple[str, ...] = ("A", "B")) -> SetPoints:
    return SetPoints.from_mapping(document, outputs, "x.set_points.yaml")


@pytest.mark.parametrize(
    ("time", "expected"),
    [(0.0, [1, 5]), (19.9, [1, 5]), (20.0, [2, 5]), (69.9, [2, 5]), (70.0, [2, 6]), (99.9, [2, 6])],
)
def test_each_value_holds_until_its_next_move(time: float, expected: list[float]) -> None:
    assert read(TWO).at(time).tolist() == expected


@given(st.integers(0, 99), st.integers(0, 50))
def test_it_repeats(time: int, rounds: int) -> None:
    points = read(TWO)
    assert np.array_equal(points.at(time + 100.0 * rounds), points.at(float(time)))


def test_without_repeat_the_last_move_holds() -> None:
    points = read({"moves": TWO["moves"]})
    assert points.at(1e9).tolist() == [2.0, 6.0]


@given(st.sampled_from([0.1, 0.2, 0.3, 0.7, 1.1, 60.0]), st.integers(2, 400))
def test_rounding_of_the_clock_shifts_no_move(sample_time: float, count: int) -> None:
    repeat = round(count * sample_time, 9)
    points = read({"repeat": repeat, "moves": [{"time": 0.0, "A": 1.0, "B": 1.0},
                                               {"time": repeat / 2, "A": 2.0}]})  # fmt: skip
    for rounds in (1, 3, 7):
        assert points.at(rounds * count * sample_time)[0] == 1.0


@pytest.mark.parametrize(
    ("name", "outputs"), [("siso.set_points.yaml", ("PV1",)), ("tank.set_points.yaml", ("C", "T"))]
)
def test_the_schedules_that_come_along_are_read(name: str, outputs: tuple[str, ...]) -> None:
    points = SetPoints.load(find_config(name), outputs)
    assert np.array_equal(points.at(points.repeat), points.values[0])


def test_the_schedule_of_example_2_is_that_of_facts() -> None:
    points = SetPoints.load(find_config("tank.set_points.yaml"), ("C", "T"))
    seen = {minute: points.at(60.0 * minute).tolist() for minute in (0, 20, 140, 260, 380, 500)}
    assert seen == {
        0: [7.5, 42.324],
        20: [7.7, 42.324],
        140: [7.7, 45.0],
        260: [7.62, 45.0],
        380: [7.35, 41.0],
        500: [7.38, 41.0],
    }


WRONG = {
    "a stranger": ({"moves": [{"time": 0.0, "A": 1.0, "B": 1.0, "Z": 1.0}]}, "'Z'"),
    "a tag without a value": ({"moves": [{"time": 0.0, "A": 1.0}]}, "'B'"),
    "a late start": ({"moves": [{"time": 1.0, "A": 1.0, "B": 1.0}]}, "time 0"),
    "no moves": ({"moves": []}, "time 0"),
    "moves missing": ({}, "lacks 'moves'"),
    "times that fall": (
        {"moves": [{"time": 0.0, "A": 1.0, "B": 1.0}, {"time": 0.0, "A": 2.0}]},
        "increase",
    ),
    "a move after repeat": (TWO | {"repeat": 70.0}, "before repeat"),
    "repeat zero": (TWO | {"repeat": 0.0}, "out of range"),
    "not finite": ({"moves": [{"time": 0.0, "A": float("nan"), "B": 1.0}]}, "not finite"),
    "an unknown key": (TWO | {"repeet": 1.0}, "'repeet'"),
    "a list": ([1], "expected keys"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_schedule_gets_one_line(case: str) -> None:
    document, said = WRONG[case]
    with pytest.raises(InputError) as caught:
        read(document)
    assert said in str(caught.value)
    assert str(caught.value).startswith("x.set_points.yaml")
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        SetPoints.load(tmp_path / "none.yaml", ("A",))


@pytest.mark.parametrize("repeat", [{"repeat": 100.0}, {}])
def test_a_schedule_comes_back_from_its_mapping(repeat: dict[str, float]) -> None:
    schedule = read({"moves": TWO["moves"]} | repeat)
    again = read(schedule.to_mapping())
    assert again.repeat == schedule.repeat
    np.testing.assert_array_equal(again.times, schedule.times)
    np.testing.assert_array_equal(again.values, schedule.values)
