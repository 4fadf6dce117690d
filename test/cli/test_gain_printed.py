"""What ``stiction gain`` prints: the verdict first, intervals beside figures, notes below."""

import pytest

from stiction_ros.cli.gain import show
from stiction_ros.gain.gain import Gain, Option, What
from stiction_ros.gain.measures import Measures

NOTE = "The valve without friction under the controller that is there. " * 2
VERDICT = {
    "verdict": "undecided",
    "f_s": 1.25,
    "f_s_interval": [0.0, 2.5],
    "f_d": 0.5,
    "f_d_interval": [0.0, 1.0],
    "probability": 0.12,
}


def test_a_terminal_of_80_columns_is_enough(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    now = Measures(0.139, 0.0354, 1234.5, 99.0, 12.0, 98.8)
    then = Measures(0.121, 0.0205, 1100.5, 80.0, 10.0, 21.5)
    interval = {"amplitude": (0.101, 0.139), "travel_per_hour": (1000.0, 1200.0)}
    options = (
        Option(What.SERVICE, then, interval, NOTE),
        Option(What.EMBEDDING, None, {}, "It cannot be set up."),
        Option(What.LEAVE, now, {}, "As it is."),
    )
    show(Gain("V1", "PV1", now, options), VERDICT)
    out = capsys.readouterr().out
    assert out.startswith(
        "V1 and PV1: undecided, f_S 1.25 % (0.00 to 2.50), f_D 0.50 % (0.00 to 1.00"
    )
    assert "does not decide" in " ".join(out.splitlines())
    assert "0.139 │ 0.121 │ 0.101 to 0.139" in " ".join(out.split())
    assert "1000 to 1200" in out
    assert out.count("period, s") == 1  # where it is another one
    assert "98.8 │ 21.5" in " ".join(out.split())
    assert f"service: {NOTE[:50]}" in out
    assert "friction promises" not in out
    assert "a service of the valve promises 42 %" in " ".join(out.split())
    assert max(map(len, out.splitlines())) <= 80
