"""Times as people say them."""

from stiction_ros.texts import spoken


def test_durations_are_told_as_people_say_them() -> None:
    said = [spoken(seconds) for seconds in (48.0, 1200.0, 5100.0, 1_478_251.0)]
    assert said == ["48 s", "1200 s", "1.42 h", "17.1 d"]
