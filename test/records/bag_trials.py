"""How many random trials a test makes: few in every run, all when asked.

``STICTION_ALL_TRIALS=1 pytest test/records/bag/test_bag_damage.py
test/nodes/test_recorder_kill.py`` makes the numbers that studies/reports/ holds.
"""

import os


def trials(few: int, every: int) -> int:
    return every if os.environ.get("STICTION_ALL_TRIALS") == "1" else few
