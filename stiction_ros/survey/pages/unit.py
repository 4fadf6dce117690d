"""The unit of PV on a page: it can be told after the loop was judged."""

from __future__ import annotations

import re

from stiction_ros.pages.frame import text

NONE = "PV units"
"""What stands where no unit was given."""

_PLACE = re.compile(r'(<span class="unit">)[^<]*(</span>)')


def unit_mark(unit: str) -> str:
    """Return a unit as HTML that :func:`with_unit` finds; empty for one that is not known."""
    return f'<span class="unit">{text(unit or NONE)}</span>'


def with_unit(page: str, unit: str) -> str:
    """Return a page whose PV is in another unit.

    Args:
        page: HTML of a loop.
        unit: as people write it.
    """
    return _PLACE.sub(lambda place: f"{place[1]}{text(unit or NONE)}{place[2]}", page)
