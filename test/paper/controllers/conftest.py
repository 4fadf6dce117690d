"""Make the small models of the tests of control importable, and the sticky loops beside this."""

import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parents[2] / "control"))
sys.path.insert(0, str(pathlib.Path(__file__).parent))
