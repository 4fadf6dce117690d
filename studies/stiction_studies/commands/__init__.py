"""The commands that the studies add to ``stiction``."""

COMMANDS: dict[str, tuple[str, str]] = {
    name: (f"stiction_studies.{module}", text)
    for name, module, text in (
        ("example", "commands.example", "identify an example, compare with truth"),
        ("study", "commands.scenario", "run a scenario over many seeds"),
        ("study-change", "commands.change", "a valve that changes after the swap"),
        ("study-control", "commands.control", "the tank when friction is not as known"),
        ("study-monitor", "commands.monitor", "the monitor when an effect sets in"),
        ("faults", "commands.faults", "put faults into a running graph"),
        ("soak", "commands.soak", "run the nodes for long: misses, memory"),
        ("paper", "commands.paper", "figures and tables of the paper, and ours"),
        ("calibrate", "commands.calibrate", "fit the probability of friction"),
        ("bench", "benches.command", "measure speed and accuracy"),
        ("demo opcua", "commands.demo_opcua", "the tank behind a control system"),
        ("demo --compare", "commands.compare", "Example 2 under five controllers, without ROS"),
        ("experiment", "commands.experiment_plant", "a folder of exports of known truth"),
    )
}
"""Module of each command, loaded when it is called, and what ``--help`` says.

A name with a space is a part of a command of ``stiction_ros``.
"""
