"""Which behaviours there are: found by their folder, by entry point, or by :func:`register`.

The folders are those of this package, one per place, and those that ``STICTION_EFFECTS`` lists;
entry points name modules in the group ``stiction_ros.effects``.
"""

import functools
import importlib
import inspect
import os
import pkgutil
import traceback
from importlib import metadata
from importlib.machinery import FileFinder
from types import ModuleType

from stiction_ros.effects.behaviour import Behaviour
from stiction_ros.errors import InputError

FOLDERS = ("friction", "valve", "process", "disturbance", "sensor", "data", "own")
GROUP = "stiction_ros.effects"

_registered: list[type[Behaviour]] = []


def register(kind: type[Behaviour]) -> type[Behaviour]:
    """Make a behaviour known to this process; also as a decorator.

    Examples:
        >>> from stiction_ros import effects
        >>> effects.register(effects.Backlash) is effects.Backlash  # known already
        True
    """
    if kind not in behaviours():
        _refuse_twins((*behaviours(), kind))
        _registered.append(kind)
    return kind


def behaviours() -> tuple[type[Behaviour], ...]:
    """Return all behaviours that are known, by folder and file."""
    return (*_found(), *_registered)


@functools.cache
def _found() -> tuple[type[Behaviour], ...]:
    modules = [module for folder in FOLDERS for module in _modules_in(f"{GROUP}.{folder}")]
    for entry in metadata.entry_points(group=GROUP):
        mend = "mend or uninstall the package that brings it"
        modules.append(_loaded(entry.module, f"entry point {entry.value}", mend))
    found = [kind for module in modules for kind in _kinds_of(module)]
    found = list(dict.fromkeys(found))
    _refuse_twins(tuple(found))
    return tuple(found)


def _modules_in(package: str) -> list[ModuleType]:
    folder = importlib.import_module(package)
    for path in folder.__path__:
        if not os.path.exists(path):
            raise InputError("no such folder", where=f"STICTION_EFFECTS, {path}")
    found = sorted(pkgutil.iter_modules(folder.__path__), key=lambda info: info.name)
    if package != f"{GROUP}.own":
        return [importlib.import_module(f"{package}.{info.name}") for info in found]
    mend = "mend the file, or take it out of the folder that STICTION_EFFECTS lists"
    return [_loaded(f"{package}.{info.name}", _file_of(info), mend) for info in found]


def _file_of(info: pkgutil.ModuleInfo) -> str:
    assert isinstance(info.module_finder, FileFinder)
    name = os.path.join(info.name, "__init__.py") if info.ispkg else f"{info.name}.py"
    return os.path.join(info.module_finder.path, name)


def _loaded(module: str, place: str, fix: str) -> ModuleType:
    """Return a module that others wrote at a ``place``; it may do anything when imported."""
    try:
        return importlib.import_module(module)
    except Exception as error:
        said = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
        raise InputError(
            f"it cannot be loaded ({type(error).__name__}: {said})",
            where=f"{place}{_line(error, place)}",
            fix=fix,
        ) from error


def _line(error: Exception, file: str) -> str:
    """Return ``, line N`` of the file at fault; empty where the error does not tell it."""
    if isinstance(error, SyntaxError) and error.filename == file:
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == file]
    return f", line {lines[-1]}" if lines else ""


def _kinds_of(module: ModuleType) -> list[type[Behaviour]]:
    """Return the behaviours that a module itself defines and names, in order."""
    return [
        value
        for name, value in vars(module).items()
        if not name.startswith("_")
        and isinstance(value, type)
        and issubclass(value, Behaviour)
        and value.__module__ == module.__name__
        and hasattr(value, "effect")
        and not inspect.isabstract(value)
    ]


def _refuse_twins(kinds: tuple[type[Behaviour], ...]) -> None:
    seen: dict[tuple[str, str, str | None], type[Behaviour]] = {}
    for kind in kinds:
        for place in kind.places:
            other = seen.setdefault((place, kind.effect, kind.law), kind)
            if other is not kind:
                raise InputError(
                    f"{kind.title()} of {kind.__module__} is there twice: {other.__module__} "
                    "has an effect of that name",
                    where=f"effects of a {place}",
                    fix="give it a law or an effect of another name",
                )
