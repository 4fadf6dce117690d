"""The commands that the studies add to ``stiction``."""

COMMANDS: dict[str, tuple[str, str]] = {
    name: (f"stiction_studies.{module}", text)
    for name, module, text in (
        ("example", "commands.example", "identify a loop whose truth is known, and compare"),
        ("study", "commands.scenario", "run a scenario over many seeds, without ROS"),
        (
            "study-change",
            "commands.change",
            "run a scenario whose sticky valve changes after the swap, without ROS",
        ),
        (
            "study-control",
            "commands.control",
            "the exact embedding on the tank when friction or inputs are not as known",
        ),
        (
            "study-monitor",
            "commands.monitor",
            "the estimator's monitor over loops in which an effect sets in half-way",
        ),
        (
            "faults",
            "commands.faults",
            "put faults into a running graph and judge what becomes of it",
        ),
        (
            "soak",
            "commands.soak",
            "a long run with the real nodes: missed samples, growth of memory",
        ),
        ("paper", "commands.paper", "every figure and table of the paper, printed beside ours"),
        ("bench", "benches.command", "measure speed, side by side"),
        ("demo opcua", "commands.demo_opcua", "the tank behind a control system"),
        ("demo --compare", "commands.compare", "Example 2 under five controllers, without ROS"),
        ("experiment plant", "commands.experiment_plant", "a folder of exports of known truth"),
    )
}
"""Module of each command, loaded when it is called, and what ``--help`` says.

A name with a space is a part of a command of ``stiction_ros``.
"""
