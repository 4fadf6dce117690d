"""Loops over samples, compiled to machine code at their first call.

The machine code is kept beside the sources, or in the user's cache directory, so only the
first run on a machine pays for it. It is made anew when the file of a function changes, or a file
from which that takes other compiled functions or constants. Where anything has to be made, that is
logged once as information.
Importing this module costs half a second: only what loops over whole records does so.
"""

import functools
import hashlib
import inspect
import logging
import re
import shutil
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import event

Function = TypeVar("Function", bound=Callable[..., object])

IMPORTS = re.compile(rb"^(?:from|import) ([\w.]+)", re.MULTILINE)
HERE = __name__.encode()
ONE_AT_A_TIME = threading.RLock()  # numba's settings are those of the process, threads import
DIGITS = 12  # of what stands for a content
COMPILING = "compiling what this needs, once on this machine: less than a minute"


class _Teller(event.Listener):
    """Logs the first function that was not found in the cache."""

    told = False

    def on_start(self, event: event.Event) -> None:
        if not self.told:
            self.told = True
            logging.getLogger(__name__).info(COMPILING)

    def on_end(self, event: event.Event) -> None:
        """Do nothing: the next one begins, or all are made."""


event.register("numba:compile", _Teller())  # type: ignore[no-untyped-call]


def compiled(function: Function) -> Function:
    """Return ``function`` compiled; arithmetic as in NumPy, a division by zero included."""
    return _compiled(function)


def compiled_fused(function: Function) -> Function:
    """Return ``function`` compiled as :func:`compiled` does, products and sums in one rounding."""
    return _compiled(function, fastmath={"contract"})


def _compiled(function: Function, **options: Any) -> Function:
    options |= {"error_model": "numpy", "nogil": True}
    config: Any = numba.config
    with ONE_AT_A_TIME:
        before = config.CACHE_DIR
        config.CACHE_DIR = _folder(function, before)
        try:
            return cast(Function, numba.njit(function, cache=True, **options))
        except RuntimeError:  # no directory for the cache can be written: compiled every time
            return cast(Function, numba.njit(function, **options))
        finally:
            config.CACHE_DIR = before


def _folder(function: Callable[..., object], given: str) -> str:
    """Return where the machine code of a function is kept, below ``given`` if not empty.

    The name of the folder stands for the content of all that the machine code is made of. What
    was made of former content goes.
    """
    path = Path(inspect.getfile(function))
    name = f"{path.stem}-{content(path, function.__module__)}"
    folder = (Path(given) if given else path.parent / "__pycache__") / name
    if not given and not folder.exists():
        for former in folder.parent.glob(f"{path.stem}-" + "?" * DIGITS):
            shutil.rmtree(former, ignore_errors=True)
    return str(folder)


@functools.cache
def content(path: Path, module: str) -> str:
    """Return what stands for the content of a file and of what its compiled functions use.

    These are the files of its own package from which it imports, and theirs in turn where they
    hold compiled functions: machine code has the functions that it calls, and the constants.
    """
    depth = len(module.split("."))
    root = path.resolve().parents[depth - 1] if depth <= len(path.parents) else path.parent
    files = {path.resolve()}
    due = [path.resolve()]
    while due:
        for other in _imported(due.pop(), root, module.split(".")[0]):
            if other not in files:
                files.add(other)
                due += [other] if HERE in _text(other) else []
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(_text(file))
    return digest.hexdigest()[:DIGITS]


@functools.cache
def _text(path: Path) -> bytes:
    return path.read_bytes()


def _imported(path: Path, root: Path, package: str) -> Iterator[Path]:
    """Return the modules of a package that a file imports at its top."""
    for name in set(IMPORTS.findall(_text(path))):
        parts = name.decode().split(".")
        if parts[0] == package:
            found = root.joinpath(*parts)
            for file in (found.with_suffix(".py"), found / "__init__.py"):
                if file.is_file():
                    yield file
