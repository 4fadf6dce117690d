"""The one error that users see: what is wrong, where, and how to mend it."""

import contextlib
import sys
from collections.abc import Iterator


def is_finite(value: float) -> bool:
    """Return whether ``value`` fits a double; whole numbers of any size may be asked."""
    return abs(value) <= sys.float_info.max


class InputError(ValueError):
    """Input that cannot be used.

    Args:
        what: what is wrong, in one sentence without a full stop.
        where: the file, key, column or option at fault; empty when there is none.
        fix: how to mend it; empty when the first part says it already.

    ``str(error)`` is one line, ``where: what; fix``, which the command prints before it
    ends with exit code 2.

    Examples:
        >>> from stiction_ros import InputError
        >>> print(InputError("no such file", where="loop.csv", fix="check the path"))
        loop.csv: no such file; check the path
    """

    def __init__(self, what: str, *, where: str = "", fix: str = "") -> None:
        self.what = what
        self.where = where
        self.fix = fix
        super().__init__((f"{where}: " if where else "") + what + (f"; {fix}" if fix else ""))

    def within(self, place: str) -> "InputError":
        """Return the same error with ``place`` put before where it was found."""
        where = f"{place}: {self.where}" if self.where else place
        return InputError(self.what, where=where, fix=self.fix)


@contextlib.contextmanager
def foreign(where: object) -> Iterator[None]:
    """Tell whatever readers of foreign data raise inside the block as an :class:`InputError`.

    Args:
        where: the file, which errors get that name no place.
    """
    try:
        yield
    except InputError as error:
        raise error if error.where else error.within(str(where)) from None
    except Exception as error:  # readers of other packages raise anything, of no common base
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"cannot be read ({said})", where=str(where)) from error


@contextlib.contextmanager
def storing(where: object, *, what: str = "written", fix: str = "") -> Iterator[None]:
    """Tell what the storage refuses inside the block as an :class:`InputError`.

    Args:
        where: the file or folder.
        what: that cannot be done: ``written``, ``made``, ``read``.
        fix: how to mend it.
    """
    try:
        yield
    except OSError as error:
        said = f"cannot be {what} ({error.strerror or error})"
        raise InputError(said, where=str(where), fix=fix) from None
