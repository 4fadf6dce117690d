"""Copies and sums into parts of arrays, value by value, compiled.

An assignment of one array to a part of another compiles for two seconds, for the words of the
error that it raises where shapes differ. Here nobody looks at shapes.
"""

from stiction_ros.compiled import compiled
from stiction_ros.effects.behaviour import FloatArray


@compiled
def put(out: FloatArray, values: FloatArray) -> None:
    """Write values over a row, both of shape (n,)."""
    for k in range(len(values)):
        out[k] = values[k]


@compiled
def put_block(out: FloatArray, values: FloatArray) -> None:
    """Write values over a block, both of shape (n, q)."""
    for k in range(values.shape[0]):
        for i in range(values.shape[1]):
            out[k, i] = values[k, i]


@compiled
def add_block(out: FloatArray, values: FloatArray) -> None:
    """Add values to a block, both of shape (n, q)."""
    for k in range(values.shape[0]):
        for i in range(values.shape[1]):
            out[k, i] += values[k, i]
