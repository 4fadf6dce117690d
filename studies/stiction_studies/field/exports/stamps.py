"""How exports write the time of a row."""

import datetime
import enum

MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")


class StampStyle(enum.StrEnum):
    """Forms of a stamp."""

    ISO = "iso"
    ZONED = "zoned"
    EUROPEAN = "european"
    AMERICAN = "american"
    PI = "pi"
    MILLISECONDS = "epoch_ms"
    SECONDS = "seconds"


def stamp(seconds: float, style: StampStyle, start: float) -> str:
    """Return the time of a row as text.

    Args:
        seconds: since 1970.
        style: of the text.
        start: of the record, from which :attr:`StampStyle.SECONDS` counts.
    """
    if style is StampStyle.SECONDS:
        return f"{round(seconds - start, 3):.10g}"
    milliseconds = round(1000.0 * seconds)
    if style is StampStyle.MILLISECONDS:
        return str(milliseconds)
    whole, part = divmod(milliseconds, 1000)
    at = datetime.datetime.fromtimestamp(whole, datetime.UTC)
    rest = f".{part:03d}" if part else ""
    if style is StampStyle.EUROPEAN:
        return f"{at:%d.%m.%Y %H:%M:%S}{rest}"
    if style is StampStyle.AMERICAN:
        return (
            f"{at:%m/%d/%Y} {at.hour % 12 or 12}:{at:%M:%S}{rest} {'PM' if at.hour > 11 else 'AM'}"
        )
    if style is StampStyle.PI:
        return f"{at.day:02d}-{MONTHS[at.month - 1]}-{at:%y %H:%M:%S}{rest}"
    return f"{at:%Y-%m-%d %H:%M:%S}{rest}{'Z' if style is StampStyle.ZONED else ''}"
