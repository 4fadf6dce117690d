import json

import pytest

from stiction_ros.cli.main import main


def test_the_study_of_a_healthy_loop_tells_its_measurements(
    capsys: pytest.CaptureFixture[str],
) -> None:
    arguments = ["--healthy", "--seeds", "500:500", "--jobs", "1", "--json", "-"]
    assert main(["study-monitor", *arguments]) == 0
    (run,) = json.loads(capsys.readouterr().out)
    assert run["looks"] == [19, 0]
    assert (run["seed"], run["cause"], run["score"]) == (500, "none", "quiet")
