"""What options of the studies may be, as words; studies/test/commands/test_choices.py checks them.

The modules that give these words their meaning load slowly, and a mistyped option should be told
at once.
"""

from stiction_ros.cli.shared.searches import METHODS

COUNTED = METHODS  # methods that ``stiction paper --success`` counts
FIGURES = (2, 3, 5, 6)  # 1 and 4 are schemes
# exhibits of the paper
TABLES = (
    *("1", "2", "A.3", "times", "wells", "success", "laws", "retuning", "ablation", "identified"),
)
NOISES = ("measurement", "equation")  # where noise enters Example 1
PLANTS = ("linear", "tank")  # plants of Example 2
HEALTHY = ("tight", "sine", "coloured")  # why a loop without friction oscillates
PRESETS = ("own", "corrected", "printed")
WARM_STARTS = ("compensation", "search", "none")
PROGRAMME_COSTS = ("revised", "plain")
PRINTED_LAWS = ("he", "kano", "xch")
SCHEDULES = ("held-out", "scenario")
BLIND_FAMILIES = ("single", "two", "outside")
# the family of loops of the field whose friction is by the mechanics of the stem
PHYSICS = "physics"
PROCESS = "process"  # the family of loops whose model has one figure of the process wrong
GIVEN = ("exact", "off")

# what is not as known in ``study-control``
CONTROL_CASES = (
    *("nominal", "own_weights", "both_20_low", "both_20_high", "low_and_high"),
    *("high_and_low", "true_50_more", "known_50_more", "C_B", "T_A", "F_B", "two_valves"),
)
MANY = 6  # slips from which on a valve of the field has many
