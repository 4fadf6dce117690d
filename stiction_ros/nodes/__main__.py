"""Start one node: ``python -m stiction_ros.nodes plant --ros-args -p pace:=lockstep``."""

import importlib
import os
import signal
import sys

# As in the command: with another number of threads sums come in another order, and a run
# could not be replayed bit for bit.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

NODES = ("plant", "controller", "estimator", "recorder", "player", "opcua")
HELP = ("-h", "--help")
USAGE = f"""usage: python -m stiction_ros.nodes NODE [--ros-args ...]

NODE is one of {", ".join(NODES)}; what follows is for ROS:

  --params-file F.yaml   parameters, below the key /NODE, or /**/NODE for any namespace
  -p NAME:=VALUE         one parameter
  -r __ns:=/LOOP         the namespace of the node and its topics
  -r __node:=NAME        another name

Topics and parameters: docs/nodes.md. Ctrl-C ends a node in order.
"""


def main() -> int:
    """Run the node named first on the command line and return its exit code."""
    own = sys.argv[1 : sys.argv.index("--ros-args")] if "--ros-args" in sys.argv else sys.argv[1:]
    if any(argument in HELP for argument in own):
        print(USAGE, end="")
        return 0
    if len(sys.argv) < 2 or sys.argv[1] not in NODES:
        given = f"unknown node {sys.argv[1]!r}" if len(sys.argv) > 1 else "no node named"
        print(f"{given}; known nodes: {', '.join(NODES)}", file=sys.stderr)
        return 2
    for number in (signal.SIGINT, signal.SIGTERM):  # nothing is open yet while modules load
        signal.signal(number, lambda _number, _frame: os._exit(0))
    name = sys.argv[1]
    sys.argv[:2] = [name]
    from stiction_ros.nodes.shared.runner import run

    module = importlib.import_module(f"stiction_ros.nodes.{name}")
    return run(name, getattr(module, f"{name.capitalize()}Node"))


if __name__ == "__main__":
    sys.exit(main())
