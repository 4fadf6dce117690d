import sys
from pathlib import Path

# The tests of this folder share loops.py; importlib mode does not look beside them.
sys.path.insert(0, str(Path(__file__).parent))
