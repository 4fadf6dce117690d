"""What OP is counted in, by its name."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from exports import check, iso, one, op, pv, said, table, text, write

from stiction_ros.intake.intake_options import TO_PERCENT, OpUnit

STANDARD = [
    ("psig", OpUnit.PSI, "OP of 3 to 15 psi brought to %"),
    ("psi", OpUnit.PSI, "OP of 3 to 15 psi brought to %"),
    ("mA", OpUnit.CURRENT, "OP of 4 to 20 mA brought to %"),
    ("bar", OpUnit.BAR, "OP of 0.2 to 1 bar brought to %"),
    ("kPa", OpUnit.KILOPASCAL, "OP of 20 to 100 kPa brought to %"),
]


def raw(unit: OpUnit) -> list[list[str]]:
    factor, offset = TO_PERCENT[unit]
    return [[t, repr((float(u) - offset) / factor), *rest] for t, u, *rest in table()]


@pytest.mark.parametrize(("word", "unit", "note"), STANDARD)
@pytest.mark.parametrize("form", ["OP_{}", "OP [{}]", "OP ({})", "F.OP_{}", "F.OP {}"])
def test_a_standard_signal_becomes_percent(
    tmp_path: Path, word: str, unit: OpUnit, note: str, form: str
) -> None:
    header = ["t", form.format(word), "F.PV" if "F." in form else "PV", "SP"]
    rows = [[str(10 * k), *row[1:]] for k, row in enumerate(raw(unit))]
    loop = one(write(tmp_path / "a.csv", text(rows, header)))
    check(loop)
    assert loop.notes == (note,)


def test_the_ends_of_each_standard_signal() -> None:
    ends = {"psi": (3, 15), "bar": (0.2, 1), "kpa": (20, 100), "ma": (4, 20)}
    ends |= {"0-10v": (0, 10), "1-5v": (1, 5), "2-10v": (2, 10)}
    for unit, (low, high) in ends.items():
        factor, offset = TO_PERCENT[OpUnit(unit)]
        assert [factor * low + offset, factor * high + offset] == pytest.approx([0.0, 100.0])


def test_a_unit_in_the_name_of_a_tag(tmp_path: Path) -> None:
    rows = [
        [tag, iso(k), repr(value)]
        for k, row in enumerate(raw(OpUnit.PSI))
        for tag, value in (("F.OP_psig", float(row[1])), ("F.PV", pv(k)))
    ]
    check(one(write(tmp_path / "a.csv", text(rows, ["tag", "time", "value"]))))


@pytest.mark.parametrize("name", ["OP [V]", "OP_V", "OP (VDC)"])
def test_volts_are_asked_for(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / "a.csv", text(raw(OpUnit.VOLT_1_5), ["time", name, "PV", "SP"]))
    assert "--op-unit 0-10v, --op-unit 1-5v or --op-unit 2-10v" in str(one(path).problem)
    check(one(path, op_unit=OpUnit.VOLT_1_5))


def test_an_op_outside_of_its_standard_signal_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", text(table(), ["time", "OP_psig", "PV", "SP"]))
    assert "though the export says 3 to 15 psi" in str(one(path).problem)
    loop = one(path, op_unit=OpUnit.OTHER)
    assert loop.parts[0].op[7, 0] == op(7)
    assert "brought" not in said(loop)
