"""How a survey looks at each loop."""

import dataclasses

from stiction_ros.identification.identification_options import IdentificationOptions


@dataclasses.dataclass(frozen=True)
class SurveyOptions:
    """What a worker is told beside the loop."""

    identification: IdentificationOptions = IdentificationOptions()  # of every identification
    gain: bool = True  # whether what would help is simulated for the valves that are found
    pages: bool = True  # whether a page is written for each loop
    units: tuple[tuple[str, str], ...] = ()  # engineering unit of PV by loop, for the pages
    read_by: str = ""  # how the exports are read; other ways give other records

    def unit(self, name: str) -> str:
        """Return the unit of a loop's PV; empty where none was given."""
        return dict(self.units).get(name, "")

    def mark(self) -> str:
        """Return what tells options apart whose entries differ."""
        return repr((self.identification, self.gain, self.read_by))
