"""Recorded runs once more without ROS, held against what was published."""
