"""Bags: a record becomes one, any tool of ROS 2 plays it, and it is read like a CSV file.

For ROS engineers. No running ROS is needed; `ros2 bag play flow_bag` replays it into a graph.
"""

from pathlib import Path

import numpy as np

from stiction_ros import LoopModel, find_config, identify, read, simulate, write_bag


def main(samples: int = 1500, folder: Path = Path("flow_bag")) -> None:
    """Write a bag, read it back, and identify what it holds."""
    record = simulate(LoopModel.load(find_config("flow.loop.yaml")), samples=samples)
    counts = write_bag(record, folder)
    print(", ".join(f"{topic} {count}" for topic, count in counts.items()))
    for file in sorted(folder.iterdir()):
        print(f"  {file.name}: {file.stat().st_size} bytes")

    bag = read(folder)
    assert bag.stem is not None
    print(f"{len(bag)} samples, {np.count_nonzero(np.diff(bag.stem[:, 0]))} moves of the stem")
    valve = identify(bag).valves[0]
    print(f"{valve.name} {valve.verdict}, f_S {valve.static_friction:.2f} %")


if __name__ == "__main__":
    main()
