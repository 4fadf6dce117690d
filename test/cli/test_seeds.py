from __future__ import annotations

import contextlib
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


def test_results_come_in_the_order_of_the_items() -> None:
    assert run_each(abs, [-3, 1, -2], 2, "three") == [3, 1, 2]


def test_an_interrupt_leaves_what_has_not_begun(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    @contextlib.contextmanager
    def interrupted(_text: str) -> Iterator[Callable[[float], None]]:
        def show(_share: float) -> None:
            raise KeyboardInterrupt

        yield show

    monkeypatch.setattr(seeds, "bar", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_each(subprocess.call, traces(tmp_path), 1, "sixty")
    assert len(list(tmp_path.iterdir())) < COUNT / 2
