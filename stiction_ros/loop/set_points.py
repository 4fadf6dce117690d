"""A schedule of set-points, held between its moves and repeated when asked."""

import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np

from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError
from stiction_ros.loop.yaml_reading import Section, load_yaml


@dataclasses.dataclass(frozen=True)
class SetPoints:
    """Piecewise constant set-points of p outputs.

    Attributes:
        outputs: tags of the outputs.
        times: seconds of the moves, increasing, the first 0; shape (M,).
        values: set-points from each move on, shape (M, p), engineering units.
        repeat: seconds after which the schedule starts again; inf for never.

    Examples:
        >>> from stiction_ros import SetPoints
        >>> moves = [{"time": 0.0, "PV1": 40.0}, {"time": 60.0, "PV1": 44.0}]
        >>> schedule = SetPoints.from_mapping({"moves": moves}, ("PV1",), "example")
        >>> schedule.at(59.0).item(), schedule.at(60.0).item()
        (40.0, 44.0)
    """

    outputs: tuple[str, ...]
    times: FloatArray
    values: FloatArray
    repeat: float = np.inf

    @classmethod
    def from_mapping(cls, value: Any, outputs: tuple[str, ...], where: str) -> "SetPoints":
        """Read ``{repeat: s, moves: [{time: s, TAG: value, …}, …]}``; the first sets every tag.

        Args:
            value: the mapping.
            outputs: tags of the loop's outputs.
            where: named in messages.

        Raises:
            InputError: unknown tags, times that do not increase, or no value for a tag.
        """
        top = Section(value, where)
        repeat = top.number("repeat", above=0.0) if "repeat" in top else np.inf
        times: list[float] = []
        rows: list[list[float]] = []
        for section in top.sections("moves"):
            times.append(section.number("time", low=0.0))
            before: list[float | None] = [*rows[-1]] if rows else [None] * len(outputs)
            rows.append(
                [
                    section.number(tag) if tag in section or last is None else last
                    for tag, last in zip(outputs, before, strict=True)
                ]
            )
            section.finish()
        top.finish()
        if not times or times[0] != 0.0:
            raise InputError("the first move is not at time 0", where=where, fix="add time: 0")
        if any(b <= a for a, b in itertools.pairwise(times)) or times[-1] >= repeat:
            raise InputError("times must increase and end before repeat", where=where)
        return cls(outputs, np.array(times), np.array(rows, dtype=float), repeat)

    @classmethod
    def load(cls, path: Path | str, outputs: tuple[str, ...]) -> "SetPoints":
        """Read the schedule from a YAML file.

        Args:
            path: the file.
            outputs: tags of the loop's outputs.

        Raises:
            InputError: as :meth:`from_mapping`; no such file.
        """
        return cls.from_mapping(load_yaml(path), outputs, str(path))

    def at(self, time: float) -> FloatArray:
        """Return the set-points, shape (p,), in force at ``time`` seconds."""
        time += 1e-9  # a clock that rounds down must not shift a move, nor the start of a round
        if np.isfinite(self.repeat):
            time = time % self.repeat
        row = int(np.searchsorted(self.times, time, side="right")) - 1
        return np.asarray(self.values[max(row, 0)])

    def to_mapping(self) -> dict[str, Any]:
        """Return the mapping that :meth:`from_mapping` reads."""
        moves = [
            {"time": float(time)}
            | {tag: float(v) for tag, v in zip(self.outputs, row, strict=True)}
            for time, row in zip(self.times, self.values, strict=True)
        ]
        repeat = {"repeat": float(self.repeat)} if np.isfinite(self.repeat) else {}
        return {**repeat, "moves": moves}
