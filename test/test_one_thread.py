"""Linear algebra on one thread, and as many as before afterwards."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from stiction_ros.one_thread import VARIABLE, one_thread


def threads() -> set[int]:
    np.linalg.qr(np.eye(3))
    return {entry["num_threads"] for entry in threadpool_info() if entry["user_api"] == "blas"}


def test_a_call_has_one_thread_and_leaves_the_caller_his(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        with one_thread():
            assert threads() == {1}
        assert threads() == before == {2}


def test_the_environment_decides_where_it_says_something(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "2")
    with threadpool_limits(limits=2, user_api="blas"), one_thread():
        assert threads() == {2}


def test_threads_come_back_after_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    with threadpool_limits(limits=2, user_api="blas"):
        with pytest.raises(ValueError, match="lost"), one_thread():
            raise ValueError("lost")
        assert threads() == {2}
