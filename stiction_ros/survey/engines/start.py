"""How worker processes of this machine are started: they import what the one that starts them does.

A new interpreter would look in the present folder first, where a clone may bear this name.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator
from multiprocessing.context import ForkServerContext, SpawnContext
from multiprocessing.process import BaseProcess
from typing import Any

from stiction_ros.orphans import spared


def context_of(module: str) -> ForkServerContext | SpawnContext:
    """Return how processes are started here; a server, if there is one, imports ``module`` once."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([module])
    return context


def started(
    context: ForkServerContext | SpawnContext, work: Callable[..., None], *arguments: Any
) -> BaseProcess:
    """Return a process of a :func:`context_of` that does ``work`` and ends with this one."""
    process = context.Process(target=work, args=arguments, daemon=True)
    with same_imports(), spared():
        process.start()
    return process


@contextlib.contextmanager
def same_imports() -> Iterator[None]:
    """Let interpreters that are started inside look for modules where this one does, nowhere else.

    ``multiprocessing`` tells that to a worker, but not to the server that workers are forked from.
    """
    here = os.getcwd()
    told = {"PYTHONPATH": os.pathsep.join(path or here for path in sys.path), "PYTHONSAFEPATH": "1"}
    before = {name: os.environ.get(name) for name in told}
    os.environ.update(told)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
