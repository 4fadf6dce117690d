"""The simulated plant as these tests run it, and how they wait for it."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stiction_studies.control_system import process
from stiction_studies.control_system.process import ACCOUNTS, PlantOptions

BUDGET = 60.0  # s for anything to happen, on a busy machine
USERS = tuple(ACCOUNTS)
START = PlantOptions().start


def wait_until(condition: Callable[[], Any], what: str, pause: float = 0.01) -> Any:
    end = time.monotonic() + BUDGET
    while not (found := condition()):
        assert time.monotonic() < end, f"waited {BUDGET:g} s for {what}"
        time.sleep(pause)
    return found


class PlantProcess(process.PlantProcess):
    """The simulated plant with all accounts and a low rate of remote OPs."""

    def __init__(self, folder: Path, **options: Any) -> None:
        super().__init__(folder, PlantOptions(**{"watchdog": 2.0, "rate": 0.1, **options}))

    @property
    def speed(self) -> float:
        return self.options.speed

    def word(self, user: str) -> str:
        """Return the file of a user's password."""
        return str(self.password_file(user))

    def parameters(self) -> dict[str, Any]:
        """Return the parameters of a node that bridges the plant, without writing."""
        return self.node_parameters()
