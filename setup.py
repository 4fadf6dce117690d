"""Files that are installed beside the modules; almost everything else stands in setup.cfg.

`ros2 run` starts what lies in lib/stiction_ros. pip writes console scripts to bin only, and
colcon would write all of them to one folder, so the nodes are no console scripts: small
shell launchers are installed as data files, the same under pip and under colcon, and the
command `stiction` alone is a console script in bin.
"""

from glob import glob

from setuptools import setup

NAME = "stiction_ros"
# Links to one file, which itself is no node.
LAUNCHERS = sorted(set(glob("launchers/*")) - {"launchers/node"})

setup(
    python_requires=">=3.11",  # here, as colcon cannot read it from setup.cfg
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (
            f"share/{NAME}/config",
            sorted(glob("config/*.yaml") + glob("config/*.xml") + glob("config/*.json")),
        ),
        (f"share/{NAME}/launch", sorted(glob("launch/*.launch.py"))),
        (f"lib/{NAME}", LAUNCHERS),
    ],
)
