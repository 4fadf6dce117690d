"""Make the known loops of the closed loop importable."""

import pathlib
import sys

folder = pathlib.Path(__file__).parents[1] / "identification" / "closed_loop"
sys.path.insert(0, str(folder))
