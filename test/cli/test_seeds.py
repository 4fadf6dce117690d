from __future__ import annotations

import contextlib
import os
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from stiction_ros.cli.runs import seeds
from stiction_ros.cli.runs.seeds import run_each

COUNT = 60


def traces(folder: Path) -> list[list[str]]:
    """Return commands that take a moment and leave a file each: work that can be counted."""
    return [["sh", "-c", f"sleep 0.05; touch {folder}/{k}"] for k in range(COUNT)]


@pytest.mark.parametrize("jobs", [1, 2])
def test_results_come_in_the_order_of_the_items(jobs: int) -> None:
    assert run_each(abs, [-3, 1, -2], jobs, "three") == [3, 1, 2]


def test_one_job_works_in_this_process_and_two_do_not() -> None:
    told = ["__import__('os').getpid()"] * 2
    assert run_each(eval, told, 1, "two") == [os.getpid()] * 2
    assert os.getpid() not in run_each(eval, told, 2, "two")


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupt_leaves_what_has_not_begun(
    jobs: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextlib.contextmanager
    def interrupted(_text: str) -> Iterator[Callable[[float], None]]:
        def show(_share: float) -> None:
            raise KeyboardInterrupt

        yield show

    monkeypatch.setattr(seeds, "bar", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_each(subprocess.call, traces(tmp_path), jobs, "sixty")
    assert len(list(tmp_path.iterdir())) < COUNT / 2
