"""Records and identifications that several figures and tables share, made once when needed."""

import dataclasses
import time

from stiction_ros.identification import Identification
from stiction_ros.identification import identify as identify_by_own
from stiction_ros.paper.methods import identify
from stiction_studies.examples import Example
from stiction_studies.paper.settings import printed_example
from stiction_studies.paper.success import OWN


@dataclasses.dataclass(frozen=True)
class Found:
    """An identification and its wall-clock time, s."""

    identification: Identification
    seconds: float


class Sources:
    """Of one seed.

    Attributes:
        seed: of all noise.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self._examples: dict[int, Example] = {}
        self._found: dict[tuple[int, str], Found] = {}

    def example(self, number: int) -> Example:
        """Return Example 1 or 2."""
        if number not in self._examples:
            self._examples[number] = printed_example(number).make(self.seed)
        return self._examples[number]

    def found(self, number: int, method: str) -> Found:
        """Return what a method finds in an example at the paper's settings.

        A search of our own goes twice: its first run loads what is compiled.
        """
        key = number, method
        if key not in self._found:
            example = self.example(number)
            own = dataclasses.replace(example.options, method=method) if method in OWN else None
            if own is not None:
                identify_by_own(example.record, own)
            begun = time.perf_counter()
            if own is not None:
                found = identify_by_own(example.record, own)
            else:
                options = printed_example(number).options(example, method)
                found = identify(example.record, options)
            self._found[key] = Found(found, time.perf_counter() - begun)
        return self._found[key]
