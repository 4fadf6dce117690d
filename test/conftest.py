"""Settings of the middleware, made before any test imports rclpy."""

import os
import random
import sys
from pathlib import Path

# A domain of its own keeps a test run apart from nodes that run on the same host.
os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randint(1, 100))
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
# Without it rclpy sends Float64(data=1) as 5e-324 and says nothing.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ.setdefault("MPLBACKEND", "Agg")
# As the command and the nodes do; fits run on one thread.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# Wheels set no prefix path; a sourced ROS installation does.
if (Path(sys.prefix) / "share" / "ament_index").is_dir():
    os.environ.setdefault("AMENT_PREFIX_PATH", sys.prefix)
