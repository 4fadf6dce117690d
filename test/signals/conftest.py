"""Make the known loops importable."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "identification" / "closed_loop"))
