"""How a survey looks at each loop."""

from __future__ import annotations

import dataclasses

from stiction_ros.identification.identification_options import IdentificationOptions


@dataclasses.dataclass(frozen=True)
class SurveyOptions:
    """What a worker is told beside the loop.

    Attributes:
        identification: options of every identification.
        gain: whether what would help is simulated for the valves that are found.
        pages: whether a page is written for each loop.
        units: engineering unit of PV by loop, for the pages.
        read_by: how the exports are read; other ways give other records.
    """

    identification: IdentificationOptions = IdentificationOptions()
    gain: bool = True
    pages: bool = True
    units: tuple[tuple[str, str], ...] = ()
    read_by: str = ""

    def unit(self, name: str) -> str:
        """Return the unit of a loop's PV; empty where none was given."""
        return dict(self.units).get(name, "")

    def mark(self) -> str:
        """Return what tells options apart whose entries differ."""
        return repr((self.identification, self.gain, self.read_by))
