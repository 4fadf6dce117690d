"""Writes the report of a run into its folder."""

import dataclasses
from pathlib import Path
from typing import Any

from stiction_ros.online.session import Scenario
from stiction_ros.records.run.log import read_run
from stiction_ros.report.page import page_file
from stiction_ros.report.run.page import run_page
from stiction_ros.report.run.story import Story, tell
from stiction_ros.report.run.summary import summary, write_json


@dataclasses.dataclass(frozen=True)
class RunReport:
    """What was written: the story of the run, ``summary.json``, the page, and all files."""

    story: Story
    summary: dict[str, Any]
    page: Path
    files: tuple[Path, ...]


def report_run(
    bag: str | Path,
    out: str | Path,
    *,
    scenario: Scenario | None = None,
    name: str | None = None,
    seconds: float | None = None,
    load: float | None = None,
    namespace: str | None = None,
) -> RunReport:
    """Read a bag of a live loop and write ``summary.json`` and ``report.html``.

    Args:
        bag: a rosbag2 directory or a ``.mcap`` file.
        out: folder, made when missing; or the ``.html`` file alone.
        scenario: that was run, for the comparison with a loop without friction.
        name: of the loop in the report; the scenario's or the bag's when not given.
        seconds, load: wall time of the run, and of the machine before it, where known.
        namespace: of the loop's topics, for a bag that holds several loops.
    """
    log = read_run(bag, namespace=namespace)
    return write_run(tell(log, scenario=scenario, name=name), out, seconds, load)


def write_run(
    story: Story, out: str | Path, seconds: float | None = None, load: float | None = None
) -> RunReport:
    """Write what :func:`report_run` writes of a run that has been scored."""
    target, folder = page_file(out)
    target.write_text(run_page(story), encoding="utf-8")
    figures = summary(story, seconds, load)
    files = [target]
    if folder is not None:
        write_json(figures, folder / "summary.json")
        files.append(folder / "summary.json")
    return RunReport(story, figures, target, tuple(files))
