from pathlib import Path

import pytest

from stiction_ros.config_files import config_directories, find_config
from stiction_ros.errors import InputError


def test_a_path_is_taken_as_it_is(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.touch()
    assert find_config(mine) == mine


def test_a_name_is_found_among_those_that_come_along() -> None:
    assert find_config("tank.loop.yaml").parent in config_directories()


def test_a_file_here_goes_before_one_that_comes_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "tank.loop.yaml").touch()
    monkeypatch.chdir(tmp_path)
    assert find_config("tank.loop.yaml") == Path("tank.loop.yaml")


@pytest.mark.parametrize("name", ["none.loop.yaml", "/none/tank.loop.yaml"])
def test_a_missing_file_is_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(InputError) as caught:
        find_config(name)
    assert caught.value.where == name
    assert "tank.loop.yaml" in caught.value.fix


def test_a_prefix_path_is_searched(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "share" / "stiction_ros" / "config"
    folder.mkdir(parents=True)
    (folder / "far.loop.yaml").touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    assert find_config("far.loop.yaml") == folder / "far.loop.yaml"
