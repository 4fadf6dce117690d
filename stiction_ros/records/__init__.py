"""Records of loops, from CSV files and bags."""

from stiction_ros.records.record import Record

__all__ = ["Record"]
