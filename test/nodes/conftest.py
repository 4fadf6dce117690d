"""Makes the helpers of this folder importable; a graph of nodes for each test."""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from graph import Graph

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def graph() -> Iterator["Graph"]:
    from graph import Graph  # needs ROS, without which the tests are skipped

    built = Graph()
    yield built
    built.close()
