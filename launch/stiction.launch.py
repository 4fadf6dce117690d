"""Starts a loop: recorder, estimator, controller and plant, as the command ``stiction demo`` does.

ros2 launch stiction_ros stiction.launch.py scenario:=siso speed:=25.0 directory:=run1

With a parameter file of the node opcua that node stands in the place of the plant. It runs in no
namespace, as its tag map names those of the loops:

ros2 launch stiction_ros stiction.launch.py scenario:=F.scenario.yaml opcua:=F.yaml namespace:=F1
"""

from pathlib import Path

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from stiction_ros.cli.shared.scenarios import (
    SCENARIOS,
    bridged_nodes,
    find,
    loop_nodes,
    write_parameters,
)

ARGUMENTS = {
    "scenario": ("siso", f"{' or '.join(SCENARIOS)}, or a *.scenario.yaml file"),
    "directory": ("run", "folder for the parameter file and the bag; there must be no bag in it"),
    "speed": ("max", "simulated seconds per second, or max for lockstep"),
    "seed": ("", "seed of the noise; empty for that of the scenario"),
    "namespace": ("", "of all nodes but opcua"),
    "opcua": ("", "parameter file of the node opcua in place of the plant; empty for none"),
}


def nodes_of(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Return the nodes; their parameters stand in one file below ``directory``."""
    given = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    directory = Path(given["directory"]).resolve()
    directory.mkdir(parents=True, exist_ok=True)
    scenario = find(given["scenario"])
    speed = None if given["speed"] == "max" else float(given["speed"])
    if given["opcua"]:
        nodes = bridged_nodes(scenario, directory, "topic:pv", speed=speed or 1.0)
    else:
        seed = int(given["seed"]) if given["seed"] else None
        nodes = loop_nodes(scenario, directory, seed=seed, speed=speed)
    parameters = directory / "parameters.yaml"
    write_parameters(nodes, parameters)
    files = dict.fromkeys(nodes, parameters)
    if given["opcua"]:
        files["opcua"] = Path(given["opcua"]).resolve()
    return [
        Node(
            package="stiction_ros",
            executable=name,
            name=name,
            namespace="" if name == "opcua" else given["namespace"],
            parameters=[str(file)],
            output="screen",
        )
        for name, file in files.items()
    ]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments and the nodes."""
    arguments = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=nodes_of)])
