import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parent))
from exports import one

from stiction_ros.intake.sheets.names import Tag, read_tag
from stiction_ros.records.record import Quality


@pytest.mark.parametrize(
    ("name", "tag"),
    [
        ("FIC101.PV", Tag("FIC101", "pv")),
        ("FIC101.OP", Tag("FIC101", "op")),
        ("FIC101/PID1/OUT.CV", Tag("FIC101", "op")),
        ("FIC101/PID1/PV.CV", Tag("FIC101", "pv")),
        ("FIC101/PID1/MODE.ACTUAL", Tag("FIC101", "mode")),
        ("UNIT1:FIC101.PIDA.SP", Tag("UNIT1:FIC101", "sp")),
        ("FIC101.SV", Tag("FIC101", "sp")),
        ("FIC101.MV", Tag("FIC101", "op")),
        ("20FIC-101_SP", Tag("20FIC-101", "sp")),
        ("FIC101.MEAS", Tag("FIC101", "pv")),
        ("FIC101.PV.Quality", Tag("FIC101", "pv", quality=True)),
        ("PV", Tag("", "pv")),
        ("setpoint", Tag("", "sp")),
        ("LIC-4711 Istwert", Tag("LIC-4711", "pv")),
        ("LIC-4711 Stellgröße", Tag("LIC-4711", "op")),
        ("LIC-4711 STELLWERT", Tag("LIC-4711", "op")),
        ("LIC-4711 Betriebsart", Tag("LIC-4711", "mode")),
        ("FIC12 consigne", Tag("FIC12", "sp")),
    ],
)
def test_names_of_the_usual_makers(name: str, tag: Tag) -> None:
    assert read_tag(name) == tag


@pytest.mark.parametrize("name", ["", "TI101", "time", "pump running", "STOP", "FIC101"])
def test_other_names_say_nothing(name: str) -> None:
    assert read_tag(name) is None


@given(st.lists(st.sampled_from(["good", "Bad", "", "-9999"]), min_size=40, max_size=80))
def test_no_value_is_lost_or_made_up(kinds: list[str]) -> None:
    """Every sample is the one given, or held or bad, whatever stands in the cells."""
    values = [50.0 + 0.1 * ((7 * k) % 11) for k in range(len(kinds))]
    cells = [f"{v}" if kind == "good" else kind for v, kind in zip(values, kinds, strict=True)]
    lines = [f"{k},{30 + k % 5},{cell}" for k, cell in enumerate(cells)]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.csv"
        path.write_text("t,OP,PV\n" + "\n".join(lines))
        loop = one(path)
    if loop.problem is not None:
        return
    for record in loop.parts:
        first = round(record.start)
        for k in range(len(record)):
            quality = record.quality[k]
            if quality == Quality.GOOD:
                assert record.pv[k, 0] in (values[first + k], -9999.0)
            elif quality == Quality.HELD:
                assert np.isfinite(record.pv[k, 0])
    if kinds.count("-9999") <= 0.1 * len(kinds) and "good" in kinds:
        sentinel = [record for record in loop.parts if (record.pv == -9999.0).any()]
        assert not sentinel
