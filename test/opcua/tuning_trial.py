"""The controller of docs/connect.md on config/flow.loop.yaml, with and without its tuning.

``python test/opcua/tuning_trial.py`` prints the table of that page.
"""

import re
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from stiction_ros import Scenario, find_config, run_live

PAGE = Path(__file__).parents[2] / "docs" / "connect.md"
SAMPLES, FIRST, LAST = 700, 200, 690
TUNING = ("move_worth",)
CASES = {
    "`mode: unaware`": ("unaware", ()),
    "`mode: inversion`": ("inversion", ()),
    "embedding, without `move_worth`": ("embedding", ()),
    "embedding": ("embedding", TUNING),
}


class Figures(NamedTuple):
    """Moves and travel (%) of the stem per hour, mean absolute error in PV units."""

    moves: float
    travel: float
    error: float


def scenario_of_the_page() -> str:
    """Return the text of ``fic101.scenario.yaml`` in docs/connect.md."""
    found = re.search(
        r"```yaml\n(# fic101\.scenario\.yaml\n.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL
    )
    assert found is not None
    return found[1]


def tried(directory: Path, mode: str, keep: tuple[str, ...]) -> Figures:
    """Run the scenario of the page on the flow loop, whose friction its model knows.

    Args:
        directory: where the files go.
        mode: of the controller.
        keep: which entries of ``TUNING`` stay.
    """
    nodes: dict[str, Any] = yaml.safe_load(scenario_of_the_page())
    model = str(find_config("flow.loop.yaml").resolve())
    controller = nodes["/**/controller"]["ros__parameters"]
    controller.update(model=model, mode=mode, pace="lockstep")
    for key in set(TUNING) - set(keep):
        del controller[key]
    estimator = nodes["/**/estimator"]["ros__parameters"]
    estimator.update(pace="lockstep", window=600)
    for one in (controller, estimator):
        one.update(fit_first=SAMPLES - 1, fit_every=500, fit_latency=10)
    moves = str(find_config("flow.set_points.yaml").resolve())
    plant = {"model": model, "set_points": moves, "samples": SAMPLES, "pace": "lockstep"}
    nodes["/**/plant"] = {"ros__parameters": plant}
    path = directory / "try.scenario.yaml"
    path.write_text(yaml.safe_dump(nodes), encoding="utf-8")
    record = run_live(Scenario.load(path), seed=7).run.record
    assert record.sp is not None
    assert record.stem is not None
    part = slice(FIRST, LAST)
    steps = np.abs(np.diff(record.stem[part, 0]))
    error = np.abs(record.pv[part, 0] - record.sp[part, 0])
    return Figures(
        3600.0 * float(np.mean(steps > 1e-9)), 3600.0 * float(steps.mean()), float(error.mean())
    )


def main() -> None:
    """Print the table."""
    print("| | moves per h | travel, %/h | mean absolute error |\n|---|---|---|---|")
    for name, (mode, keep) in CASES.items():
        with tempfile.TemporaryDirectory() as directory:
            found = tried(Path(directory), mode, keep)
        print(f"| {name} | {found.moves:.0f} | {found.travel:.0f} | {found.error:.2f} |")


if __name__ == "__main__":
    main()
