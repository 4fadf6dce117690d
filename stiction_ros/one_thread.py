"""Linear algebra on one thread.

The matrices here are small and many: threads of a library would wait for each other, each keeping
a core busy. Command and nodes say so by the environment before anything is loaded; whoever calls
from a process of his own gets the same by a limit that ends with the call.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

VARIABLE = "OMP_NUM_THREADS"


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep linear algebra on one thread meanwhile, unless :data:`VARIABLE` says how many."""
    if os.environ.get(VARIABLE):
        yield
        return
    from threadpoolctl import threadpool_limits  # finds what is loaded by then

    with threadpool_limits(limits=1, user_api="blas"):
        yield
