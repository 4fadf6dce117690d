"""Figures of least squares that several outputs share, as the size of one load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from stiction_ros.discrepancy.likelihood.noise import (
    Blocks,
    NoiseFit,
    left_by,
    projector,
    whitened_columns,
)
from stiction_ros.effects import FloatArray
from stiction_ros.signals.autoregression import whiten


def information(
    columns: FloatArray, shared: FloatArray, noise: NoiseFit, blocks: Blocks
) -> FloatArray:
    """Return the information of one output on the factors, shape (s, s).

    Args:
        columns: of the factors, shape (N, s).
        shared: columns that every fit projects out, shape (N, q).
        noise: under which they are judged.
        blocks: rows; the fitted ones count.
    """
    basis = projector(whitened_columns(shared, noise.ar, blocks.train))
    white = left_by(basis, whiten(columns, noise.ar)[blocks.train])
    return np.asarray(white.T @ white / max(noise.innovation_std, 1e-300) ** 2)


def shared_factors(
    sizes: Mapping[int, FloatArray],
    shared: Sequence[FloatArray],
    noise: Mapping[int, NoiseFit],
    blocks: Sequence[Blocks],
) -> FloatArray:
    """Return the factors that all outputs have in common, shape (s,).

    Each output's own factors count by their information.

    Args:
        sizes: per output the columns of the factors, shape (N, s).
        shared: per output the columns that every fit projects out.
        noise: per output its own fit, whose first coefficients are its factors.
        blocks: per output its rows.
    """
    known = {i: information(sizes[i], shared[i], noise[i], blocks[i]) for i in sizes}
    total = np.sum(list(known.values()), axis=0)
    wanted = np.sum([known[i] @ noise[i].coefficients[: sizes[i].shape[1]] for i in sizes], axis=0)
    return np.asarray(np.linalg.pinv(total) @ wanted)
