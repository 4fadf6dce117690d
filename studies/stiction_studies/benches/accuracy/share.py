"""Rates that something is held to."""

import dataclasses
from collections.abc import Iterable

from rich.table import Table


@dataclasses.dataclass(frozen=True)
class Share:
    """How often something happened, and how often it should."""

    name: str
    count: int
    total: int
    wanted: str

    @property
    def share(self) -> float:
        """Between 0 and 1; NaN of none."""
        return self.count / self.total if self.total else float("nan")


def shares_table(found: Iterable[Share]) -> Table:
    """Return rates as a table, – for those of nothing."""
    table = Table("rate", "count", "of", "share", "wanted")
    for rate in found:
        share = f"{100.0 * rate.share:.1f} %" if rate.total else "–"
        table.add_row(rate.name, str(rate.count), str(rate.total), share, rate.wanted)
    return table
