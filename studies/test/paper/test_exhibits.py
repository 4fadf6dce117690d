"""The page of figures and tables, and the misprints that it tells."""

import json
from pathlib import Path

import numpy as np
import pytest

from stiction_ros.cli.main import main
from stiction_ros.config_files import find_config
from stiction_ros.loop import LoopModel
from stiction_studies.commands import choices
from stiction_studies.paper.exhibits import MAKERS, PAGE, chosen
from stiction_studies.paper.tables.printed_numbers import (
    TABLE_1,
    TABLE_1_MENDED_POLES,
    TABLE_1_POLES,
    TABLE_2_MENDED,
    TABLE_2_POLES,
    gain,
    responses,
)

QUICK = ["--table", "1", "--table", "A.3"]


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("paper")
    assert main(["paper", *QUICK, "--out", str(directory)]) == 0
    return directory


def test_page_and_json_are_written(drawn: Path) -> None:
    assert {path.name for path in drawn.iterdir()} == {"paper.json", PAGE}
    text = (drawn / PAGE).read_text(encoding="utf-8")
    assert text.index("Table 1") < text.index("Table A.3")


def test_the_constants_of_the_tank_are_the_printed_ones(drawn: Path) -> None:
    document = json.loads((drawn / "paper.json").read_text(encoding="utf-8"))
    rows = next(entry["rows"] for entry in document if entry["name"] == "tableA.3")
    assert len(rows) == 15
    assert [row["what"] for row in rows if row["printed"] != row["ours"]] == []


def test_every_choice_of_the_command_has_an_exhibit() -> None:
    wanted = {f"figure{number}" for number in choices.FIGURES}
    assert set(MAKERS) == wanted | {f"table{name}" for name in choices.TABLES}
    assert chosen((), (), True) == tuple(MAKERS)
    assert chosen((6, 2), ("times",), False) == ("figure2", "figure6", "tabletimes")


def test_table_1_is_unstable_with_and_without_its_misprint() -> None:
    assert np.abs(np.roots(TABLE_1_POLES)).max() > 1.0
    assert np.abs(np.roots(TABLE_1_MENDED_POLES)).max() > 1.0


def test_tables_mended_have_the_gains_of_the_state_space_model() -> None:
    model = LoopModel.load(find_config("tank_linear.loop.yaml"))
    actual = model.process.linear(model.sample_time).gain
    for i in range(2):
        for j in range(2):
            mended = gain(TABLE_2_MENDED[i][j], TABLE_2_POLES[i])
            assert mended == pytest.approx(actual[i, j], abs=0.02 * np.abs(actual[i]).max())
    assert gain(TABLE_1[0][1], TABLE_1_MENDED_POLES) < -1e3  # two factors of 1e-5 are missing


def test_a_step_response_ends_at_the_gain() -> None:
    settled = responses(TABLE_2_MENDED[1][1], TABLE_2_POLES[1], 400)[-1]
    assert settled == pytest.approx(gain(TABLE_2_MENDED[1][1], TABLE_2_POLES[1]))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "says nothing to draw"),
        (["--method", "nlp", "--all"], "belongs to --success"),
        (["--success", "1:2", "--table", "1"], "counts alone"),
        (["--figure", "2", "--seed", "-1"], "is negative"),
    ],
)
def test_what_does_not_fit_is_one_line_and_exit_2(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["paper", *arguments, "--out", str(tmp_path)]) == 2
    assert words in capsys.readouterr().err
