"""From a record to centred, scaled data, its liveliest part and the orders that are tried."""

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.identification.friction import find_law
from stiction_ros.identification.identification_options import IdentificationOptions, limited
from stiction_ros.identification.problem.input_checks import (
    TOO_SHORT,
    require_samples,
    require_signals,
)
from stiction_ros.identification.problem.models import Data
from stiction_ros.identification.problem.output_error import Orders
from stiction_ros.records.record import Record

MIN_SAMPLES = 60
PART = 6000
"""Samples of a long record that are searched; all of it is concluded from. A friction that suits
them is within a few thousandths of the best for the whole, round which alone all are looked at."""
ORDERS = (1, 2, 3)  # n_a that are tried unless one is given


def prepare(record: Record, options: IdentificationOptions) -> Data:
    """Return the centred, scaled data; raise :class:`InputError` when they are unusable."""
    require_signals(record)
    orders = windows(options)[-1]
    free = 2 * orders.output + len(record.valves) * orders.input + orders.noise + 3
    needed = orders.first + max(MIN_SAMPLES, 5 * free)
    require_samples(record, needed, TOO_SHORT)
    u, y = np.ascontiguousarray(record.op.T), np.ascontiguousarray(record.pv.T)
    return Data(
        y=(y - y.mean(axis=1, keepdims=True)) / y.std(axis=1, keepdims=True),
        u=u - u.mean(axis=1, keepdims=True),
        law=find_law(options.first_law),
        limit=limited(np.ptp(u, axis=1), options.friction_limit),
        delay=options.delay,
    )


def windows(options: IdentificationOptions) -> list[Orders]:
    """Return all orders that are tried, on one window."""
    tried = ORDERS if options.output_order is None else (options.output_order,)
    return [window(options, n, options.input_order or n) for n in tried]


def window(options: IdentificationOptions, output_order: int, input_order: int) -> Orders:
    """Return orders with the one window that suits all rivals of this identification."""
    most = options.output_order or max(ORDERS)
    beyond = most + 2, (options.input_order or most) + 2  # the orders of friction-free rivals
    first = options.delay[1] + 2 * beyond[1] + beyond[0] + options.noise_order + 1
    return Orders(output_order, input_order, options.noise_order, first)


def liveliest_part(data: Data) -> Data:
    """Return the ``PART`` samples in which OP moves most; all of a shorter record."""
    samples = data.u.shape[1]
    if samples <= PART:
        return data
    begin = liveliest_begin(data.u / data.u.std(axis=1, keepdims=True), PART)
    return data.part(begin, begin + PART)


def liveliest_begin(op: FloatArray, count: int) -> int:
    """Return where the ``count`` samples begin in which OP, scaled, shape (m, N), moves most."""
    samples = op.shape[1]
    begins = np.linspace(0, samples - count, 2 * (samples // count) + 1).astype(int)
    moved = [float(op[:, at : at + count].std(axis=1).sum()) for at in begins]
    return int(begins[int(np.argmax(moved))])
