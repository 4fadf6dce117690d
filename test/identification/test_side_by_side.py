"""Two threads give what one gives, in the same order, errors included."""

import threading
from functools import partial

import pytest
from simulated_loops import example1

from stiction_ros.identification import IdentificationOptions, identify, side_by_side
from stiction_ros.identification.side_by_side import at_once, together

PATIENCE = 20.0  # s


def test_results_come_in_the_order_of_the_parts() -> None:
    assert together(*(partial(pow, base, 2) for base in range(40))) == [n * n for n in range(40)]


def test_two_parts_run_at_the_same_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "may_help", lambda: True)
    met = threading.Barrier(2)
    assert sorted(together(partial(met.wait, PATIENCE), partial(met.wait, PATIENCE))) == [0, 1]


def test_without_a_second_core_all_runs_in_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "may_help", lambda: False)
    assert set(together(*[threading.get_ident] * 9)) == {threading.get_ident()}


def test_the_first_part_runs_in_the_calling_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(side_by_side, "may_help", lambda: True)
    for _ in range(50):
        assert at_once(threading.get_ident, lambda: None)[0] == threading.get_ident()


def test_parts_may_have_parts() -> None:
    def sums(base: int) -> int:
        return sum(together(*(partial(int, base + n) for n in range(5))))

    assert together(*(partial(sums, base) for base in range(30))) == [
        5 * base + 10 for base in range(30)
    ]


def test_the_error_of_the_first_part_that_fails_is_raised_and_the_next_call_works() -> None:
    def fail(name: str) -> int:
        raise ValueError(name)

    with pytest.raises(ValueError, match="second"):
        together(lambda: 1, partial(fail, "second"), partial(fail, "third"))
    assert at_once(lambda: 1, lambda: "two") == (1, "two")


@pytest.mark.trial
def test_one_thread_identifies_what_two_do(monkeypatch: pytest.MonkeyPatch) -> None:
    record = example1(3, samples=900)
    options = IdentificationOptions(output_order=3, input_order=3, delay=(4, 6))

    def found(two: bool) -> dict[str, object]:
        monkeypatch.setattr(side_by_side, "may_help", lambda: two)
        return identify(record, options).to_dict() | {"seconds": 0.0}

    assert found(two=True) == found(two=False)
