"""Checked reading of YAML: every wrong key, type or number becomes one clear error."""

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from stiction_ros.checks import number, one_of, shown
from stiction_ros.effects.behaviour import FloatArray
from stiction_ros.errors import InputError

_REQUIRED: Any = object()


def load_yaml(path: Path | str) -> Any:
    """Return what the YAML file holds; a missing or broken file raises InputError."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise InputError("no such file", where=str(path), fix="check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"cannot be read ({error})", where=str(path)) from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, where: str) -> Any:
    """Return what the YAML text holds, or raise InputError with the line at fault."""
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f" in line {mark.line + 1}" if mark is not None else ""
        problem = getattr(error, "problem", None) or "cannot be parsed"
        raise InputError(f"no valid YAML{line} ({problem})", where=where) from None
    except (ValueError, RecursionError) as error:  # a date that does not exist, 1000 brackets
        raise InputError(f"no valid YAML ({error})", where=where) from None


# what a YAML text from outside may need to be read: time and memory are bounded by these
CHARACTERS = 65_536  # of the text
DEPTH = 20  # lists and mappings within one another
NODES = 2000  # values, keys, lists and mappings altogether


def parse_limited(text: str, where: str) -> Any:
    """Return what a YAML text from outside holds; nothing in the error repeats the text.

    It may be longer, deeper or fuller than the limits, have aliases, or be no YAML.
    """
    if len(text) > CHARACTERS:
        raise InputError(f"more than {CHARACTERS} characters", where=where)
    depth = nodes = 0
    try:
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            nodes += isinstance(event, yaml.NodeEvent)
            if isinstance(event, yaml.AliasEvent):
                raise InputError("aliases are not read", where=where, fix="write values in full")
            if depth > DEPTH:
                raise InputError(f"nested deeper than {DEPTH} levels", where=where)
            if nodes > NODES:
                raise InputError(f"more than {NODES} keys and values", where=where)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        line = f" in line {mark.line + 1}" if mark is not None else ""
        raise InputError(f"no valid YAML{line}", where=where) from None
    return parse_yaml(text, where)


class Section:
    """One mapping of a file, read key by key; :meth:`finish` refuses what was not asked for."""

    def __init__(self, value: Any, where: str) -> None:
        """Wrap ``value``, which must be a mapping; ``where`` names it in errors."""
        if not isinstance(value, Mapping):
            raise InputError(f"expected keys and values, found {shown(value)}", where=where)
        self.values = value
        self.where = where
        self._asked: dict[str, None] = {}

    def __contains__(self, key: str) -> bool:
        self._asked[key] = None
        return self.values.get(key) is not None

    def raw(self, key: str, default: Any = _REQUIRED) -> Any:
        """Return the value as it stands; ``default`` where the key is absent."""
        self._asked[key] = None
        if key in self.values:
            return self.values[key]
        if default is _REQUIRED:
            raise InputError(f"lacks {key!r}", where=self.where, fix=f"add {key}: ...")
        return default

    def text(self, key: str, default: Any = _REQUIRED) -> str:
        """Return a non-empty string."""
        value = self.raw(key, default)
        if not isinstance(value, str) or not value:
            raise InputError(f"{shown(value)} is no name", where=self.at(key))
        return value

    def choice(self, key: str, choices: tuple[str, ...], default: Any = _REQUIRED) -> str:
        return one_of(self.text(key, default), choices, self.at(key))

    def number(
        self,
        key: str,
        default: Any = _REQUIRED,
        *,
        low: float = -math.inf,
        high: float = math.inf,
        above: float = -math.inf,
    ) -> float:
        """Return a finite number in [low, high] and > above."""
        value = self.raw(key, default)
        return float(number(value, self.at(key), low=low, high=high, above=above))

    def integer(self, key: str, default: Any = _REQUIRED, *, low: int = 0) -> int:
        """Return a whole number ≥ low."""
        return int(number(self.raw(key, default), self.at(key), low=low, whole=True))

    def numbers(
        self, key: str, default: Any = _REQUIRED, *, count: int | None = None
    ) -> FloatArray:
        """Return a list of finite numbers, shape (count,)."""
        value = self.raw(key, default)
        if not isinstance(value, list | tuple):
            raise InputError(f"{shown(value)} is no list of numbers", where=self.at(key))
        if count is not None and len(value) != count:
            raise InputError(
                f"has {len(value)} values, not {count}", where=self.at(key), fix=f"give {count}"
            )
        return np.array([number(v, f"{self.at(key)}[{i}]") for i, v in enumerate(value)])

    def ends(self, key: str) -> tuple[float, float]:
        """Return the lower and the upper end of a range."""
        low, high = self.numbers(key, count=2).tolist()
        if low >= high:
            raise InputError(
                f"lower end {low:g} is not below {high:g}",
                where=self.at(key),
                fix="write [low, high]",
            )
        return low, high

    def named_numbers(self, key: str, names: Sequence[str], default: FloatArray) -> FloatArray:
        """Return the numbers of a mapping such as ``op: {V1: 50}`` in the order of ``names``."""
        if key not in self:
            return default
        entry = self.section(key)
        values = [entry.number(n, float(d)) for n, d in zip(names, default, strict=True)]
        entry.finish()
        return np.array(values)

    def matrix(self, key: str) -> FloatArray:
        """Return a matrix given as a list of rows of equal length."""
        rows = self.raw(key)
        if not isinstance(rows, list | tuple) or not rows:
            raise InputError("is no list of rows", where=self.at(key))
        out = []
        for i, row in enumerate(rows):
            if not isinstance(row, list | tuple) or len(row) != len(rows[0]):
                raise InputError(f"row {i + 1} differs in length", where=self.at(key))
            out.append([number(v, f"{self.at(key)}[{i}]") for v in row])
        return np.array(out)

    def section(self, key: str, default: Any = _REQUIRED) -> "Section":
        """Return the mapping below ``key``."""
        return Section(self.raw(key, default), self.at(key))

    def sections(self, key: str, default: Any = _REQUIRED) -> "Iterator[Section]":
        """Yield the mappings of the list below ``key``."""
        value = self.raw(key, default)
        if not isinstance(value, list | tuple):
            raise InputError(f"{shown(value)} is no list", where=self.at(key))
        for i, entry in enumerate(value):
            yield Section(entry, f"{self.at(key)}[{i}]")

    def at(self, key: str) -> str:
        """Return the place of ``key`` for errors."""
        return f"{self.where}: {key}" if ": " not in self.where else f"{self.where}.{key}"

    def finish(self) -> None:
        """Raise InputError when the mapping holds a key that nobody asked for."""
        for key in self.values:
            if key not in self._asked:
                raise InputError(
                    f"unknown key {key!r}",
                    where=self.where,
                    fix=f"known keys: {', '.join(self._asked)}",
                )
