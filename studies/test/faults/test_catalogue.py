"""Every fault has a row in the documentation, and the rows are those of the code."""

import inspect
from pathlib import Path

import pytest

from stiction_ros.cli.main import main
from stiction_ros.errors import InputError
from stiction_ros.online.session import NODE_SETTINGS
from stiction_ros.settings import from_mapping
from stiction_studies.faults.catalogue import FAULTS, find, table
from stiction_studies.faults.fault import Fault
from stiction_studies.faults.loop.setting_up import NAMES, case_parameters
from stiction_studies.faults.terms import LEVELS, Pace

PAGE = Path(__file__).parents[3] / "docs" / "faults.md"
every_fault = pytest.mark.parametrize("fault", FAULTS, ids=[fault.name for fault in FAULTS])


def test_the_page_shows_the_table():
    assert f"## The faults\n\n{table()}\n## Next\n" in PAGE.read_text(encoding="utf-8")


def test_the_command_prints_the_table(capsys):
    assert main(["faults"]) == 0
    assert capsys.readouterr().out == table()


def test_names_are_unique():
    names = [fault.name for fault in FAULTS]
    assert len(set(names)) == len(names)


@every_fault
def test_a_fault_can_be_run(fault: Fault):
    assert find(fault.name) is fault
    assert fault.cases
    assert set(fault.ends) <= set(fault.paces)
    assert fault.recovery > 0.0
    assert list(inspect.signature(fault.put).parameters)
    for notice in fault.notices:
        assert notice.node in NAMES
        assert notice.level in LEVELS[1:]
        assert set(notice.paces) & set(fault.paces)


@every_fault
def test_the_parameters_of_a_case_are_known_to_the_nodes(fault: Fault, tmp_path):
    for pace in fault.paces:
        for name, values in case_parameters(fault, pace, 3, 25.0, tmp_path / "bag").items():
            own = {key: value for key, value in values.items() if key != "use_sim_time"}
            settings = from_mapping(NODE_SETTINGS[name], own, name)
            assert getattr(settings, "pace", pace.value) == pace.value


def test_both_paces_and_both_sides_of_the_swap_are_there():
    cases = {case for fault in FAULTS for case in fault.cases}
    assert len(cases) == 2 * len(Pace)


def test_an_unknown_name_says_which_are_close():
    with pytest.raises(InputError, match="poison-chain"):
        find("poison-ch")
