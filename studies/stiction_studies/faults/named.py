"""A fault by its name."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from stiction_ros.errors import InputError


class Named(Protocol):
    """What has a name of its own in a table."""

    @property
    def name(self) -> str:
        """Its name."""
        ...


T = TypeVar("T", bound=Named)


def named(faults: Sequence[T], name: str, listing: str) -> T:
    """Return the fault of that name.

    Args:
        faults: the table.
        name: which.
        listing: the command that shows all of them.

    Raises:
        InputError: there is none.
    """
    for fault in faults:
        if fault.name == name:
            return fault
    close = [fault.name for fault in faults if name in fault.name]
    raise InputError(
        f"unknown fault {name!r}",
        where="--only",
        fix=f"use {', '.join(close)}" if close else f"{listing} shows all",
    )
