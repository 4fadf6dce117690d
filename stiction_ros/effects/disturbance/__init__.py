"""Unmeasured disturbances. One behaviour a file."""
