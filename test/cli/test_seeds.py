import contextlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from stiction_studies import seeds
from stiction_studies.seeds import run_each

COUNT = 60

TWO_RANGES = """
from stiction_studies.seeds import run_each, seed_range
if __name__ == "__main__":
    print(run_each(seed_range, ["1:2", "3"], 2, "two"))
"""


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


def test_workers_take_no_folder_of_the_name_of_the_package_for_it(tmp_path: Path) -> None:
    (tmp_path / "stiction_ros").mkdir()
    script = tmp_path / "elsewhere" / "two_ranges.py"
    script.parent.mkdir()
    script.write_text(TWO_RANGES)
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.stdout.strip() == "[(1, 2), (3, 3)]", done.stderr[-2000:]
