import sys
from pathlib import Path

import pytest

# The tests of this folder share bag_making.py; importlib mode does not look beside them.
sys.path.insert(0, str(Path(__file__).parent))

from bag_making import Bag

from stiction_ros.records.bag.writer import BagWriter


@pytest.fixture
def bag(tmp_path: Path) -> Bag:
    return Bag(BagWriter(tmp_path / "run"))
