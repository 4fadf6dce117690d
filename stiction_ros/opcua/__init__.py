"""The link to a control system by OPC UA: listen always, write under its grant only.

:mod:`.plant_link` alone knows the network; ``asyncua`` comes with the extra ``opcua``.
"""

import importlib.util

from stiction_ros.errors import InputError


def require_asyncua() -> None:
    """Raise InputError, which says what to install, when ``asyncua`` is missing."""
    if importlib.util.find_spec("asyncua") is None:
        raise InputError(
            "asyncua, the OPC UA library, is not installed",
            fix="run pip install -c constraints.txt asyncua",
        )
