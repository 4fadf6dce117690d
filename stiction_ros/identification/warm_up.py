"""Everything that is compiled, compiled before it is needed."""

from collections.abc import Sequence

import numpy as np

from stiction_ros.effects import HeStiction
from stiction_ros.identification.identification_options import METHODS, IdentificationOptions
from stiction_ros.identification.methods import identify
from stiction_ros.records.record import Record
from stiction_ros.signals.polynomials import recursion

SAMPLES = 240


def compile_loops(methods: Sequence[str] = METHODS) -> None:
    """Identify a short made-up record by each of ``methods``.

    The first call on a machine compiles for many seconds and keeps the result; later ones
    take a fraction of a second.
    """
    generator = np.random.default_rng(0)
    op = 10.0 * np.sin(0.2 * np.arange(SAMPLES)) + generator.standard_normal(SAMPLES)
    stem = HeStiction(4.0, 1.0).simulate(op)
    late = np.concatenate([np.zeros(2), 0.2 * stem[:-2]])
    pv = recursion(np.array([1.0, -0.8]), late, np.zeros(1))
    pv += 0.1 * generator.standard_normal(SAMPLES)
    record = Record("made up", 1.0, ("V1",), ("PV1",), op[:, None], pv[:, None])
    for method in methods:
        identify(record, IdentificationOptions(method, output_order=1, input_order=1, delay=(0, 2)))
