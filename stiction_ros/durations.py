"""Times as people say them."""

from __future__ import annotations

HOUR, DAY = 3600.0, 86400.0


def spoken(seconds: float) -> str:
    """Return a time of three digits in the unit that suits it: ``45.5 s``, ``4.78 h``, ``12.3 d``.

    Args:
        seconds: not negative; whole ones are kept below an hour.

    Examples:
        >>> spoken(45.52), spoken(1234.0), spoken(17210.0)
        ('45.5 s', '1234 s', '4.78 h')
    """
    if seconds < HOUR:
        return f"{seconds:.3g} s" if seconds < 1000.0 else f"{seconds:.0f} s"
    size, unit = (HOUR, "h") if seconds < 2.0 * DAY else (DAY, "d")
    return f"{seconds / size:.3g} {unit}"
