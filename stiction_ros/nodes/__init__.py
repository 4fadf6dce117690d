"""The ROS 2 nodes: thin shells around :mod:`stiction_ros.online`, loop and records."""
