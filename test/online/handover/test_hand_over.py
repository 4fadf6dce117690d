import functools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control_settings import ControlSettings
from stiction_ros.effects import HeStiction
from stiction_ros.errors import InputError
from stiction_ros.loop import LoopModel
from stiction_ros.online.handover.hand_over import AtOnce, HandOver, Past

PROCESS = LoopModel.load(find_config("example1_process.loop.yaml"))
DESIGN = ControlSettings(hand_over_samples=60).design(PROCESS)
AWARE = functools.partial(
    MpcController, DESIGN, ControlMode.EMBEDDING, (HeStiction(5.0, 2.0),), (None,)
)


def past_of(samples: int) -> Past:
    """A loop whose OP swings far enough to slip, its PV missing at times."""
    past, random = Past(500, 1, 1, 0), np.random.default_rng(3)
    for k in range(samples):
        pv = 50.0 + 5.0 * np.sin(k / 20.0 - 1.0) + 0.01 * random.normal()
        missing = k % 17 == 5
        past.add(
            np.array([50.0 + 8.0 * np.sin(k / 20.0)]),
            np.array([np.nan if missing else pv]),
            np.zeros(0),
        )
    return past


def test_what_is_made_ready_early_is_brought_up_to_the_present() -> None:
    early = HandOver(0, "test", PROCESS, AWARE)
    early.prepare(AtOnce(), past_of(200))
    found = early.take(past_of(240))
    now = AWARE()
    now.take_over(past_of(240).history(), samples=100)
    assert isinstance(found, MpcController)
    assert found.stem.tolist() == now.stem.tolist()
    assert found.observer.state.tolist() == now.observer.state.tolist()
    assert found.observer.disturbance.tolist() == now.observer.disturbance.tolist()


def test_what_cannot_be_built_says_so_when_it_is_taken() -> None:
    def refuse() -> MpcController:
        raise InputError("cannot be built")

    change = HandOver(0, "test", PROCESS, refuse)
    change.prepare(AtOnce(), past_of(10))
    with pytest.raises(InputError, match="cannot be built"):
        change.take(past_of(10))


def test_a_thread_does_the_same_as_the_call() -> None:
    background = ThreadPoolExecutor(1)
    changes = [HandOver(0, "test", PROCESS, AWARE) for _ in range(2)]
    for change, where in zip(changes, (AtOnce(), background), strict=True):
        change.prepare(where, past_of(150))
    background.shutdown()
    one, other = (change.take(past_of(150)) for change in changes)
    assert isinstance(one, MpcController)
    assert isinstance(other, MpcController)
    assert one.observer.state.tolist() == other.observer.state.tolist()


def test_a_past_without_any_measurement_can_be_taken_over() -> None:
    past = Past(10, 1, 1, 0)
    past.add(np.array([50.0]), np.array([np.nan]), np.zeros(0))
    change = HandOver(0, "test", PROCESS, AWARE)
    change.prepare(AtOnce(), past)
    found = change.take(past)
    assert isinstance(found, MpcController)
    assert np.isfinite(found.observer.state).all()


@given(limit=st.integers(1, 9), samples=st.integers(0, 60), late=st.integers(0, 12))
def test_it_holds_the_last_samples_in_order(limit: int, samples: int, late: int) -> None:
    past = Past(limit, 1, 2, 0)
    for k in range(samples):
        past.add(np.array([k]), np.array([k, -k]), np.zeros(0))
    expected = list(range(max(samples - limit, 0), samples))
    assert past.count == samples
    assert len(past) == len(expected)
    assert past.history().op[:, 0].tolist() == expected
    assert past.history().pv[:, 1].tolist() == [-k for k in expected]
    since = max(samples - late, 0)
    assert past.since(since).op[:, 0].tolist() == [k for k in expected if k >= since]


def test_what_is_cleared_is_forgotten_and_the_count_goes_on() -> None:
    past = Past(3, 1, 1, 0)
    for k in range(5):
        past.add(np.array([k]), np.array([k]), np.zeros(0))
    past.clear()
    past.add(np.array([9.0]), np.array([9.0]), np.zeros(0))
    assert past.history().op.tolist() == [[9.0]]
    assert past.since(0).op.tolist() == [[9.0]]
    assert past.count == 6


def test_a_history_is_a_copy() -> None:
    past = Past(3, 1, 1, 0)
    past.add(np.zeros(1), np.zeros(1), np.zeros(0))
    past.history().op[:] = 7.0
    assert past.history().op.tolist() == [[0.0]]


def test_what_is_done_at_once_hands_over_what_it_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        AtOnce().submit(lambda: 1 // 0).result()
