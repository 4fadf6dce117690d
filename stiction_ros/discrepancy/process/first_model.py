"""A first linear model for loops that have none."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from stiction_ros.errors import InputError
from stiction_ros.identification.answer.identified_loop import identified_loop
from stiction_ros.identification.identification_options import IdentificationOptions
from stiction_ros.identification.methods import identify
from stiction_ros.identification.problem.preparation import liveliest_begin
from stiction_ros.loop import LoopModel
from stiction_ros.records import Record

MOST = 5000  # samples of all records together


def liveliest_parts(records: Sequence[Record], most: int = MOST) -> tuple[Record, ...]:
    """Return the records, cut where they have more than ``most`` samples together.

    Every record keeps the same share, the part in which OP moves most. Times are then those
    since the first sample of the part; a note says which samples it holds.
    """
    total = sum(len(record) for record in records)
    if total <= most:
        return tuple(records)
    return tuple(_cut(record, max(len(record) * most // total, 1)) for record in records)


def _cut(record: Record, count: int) -> Record:
    scaled = record.op / np.maximum(record.op.std(axis=0), 1e-300)
    first = liveliest_begin(scaled.T, count)
    note = (
        f"{record.name} is long: samples {first} to {first + count - 1}, in which OP moves most, "
        "were looked at"
    )
    part = record.part(first, first + count)
    return dataclasses.replace(part, notes=(*record.notes, note))


def first_model(records: Sequence[Record], delay: tuple[int, int] = (0, 10)) -> LoopModel:
    """Return the process that identification finds in the longest record, with ideal valves.

    Args:
        records: one at least.
        delay: inclusive range of the delays tried, samples.

    Raises:
        InputError: no record, or no stable model of it.
    """
    if not records:
        raise InputError("no record", where="fit-linear")
    longest = max(liveliest_parts(records), key=len)
    name = longest.name.removesuffix(".csv") or "loop"
    found = identify(longest, IdentificationOptions(delay=delay))
    return _process_alone(identified_loop(longest, found, name))


def _process_alone(model: LoopModel) -> LoopModel:
    """Return the model with ideal valves, no noise and no disturbance: they are not looked for."""
    document = model.with_ideal_valves().to_mapping()
    document.pop("disturbances", None)
    for entry in document["process"]["outputs"]:
        entry.pop("noise", None)
    return LoopModel.from_mapping(document, model.name)
