import pytest

from stiction_ros.errors import InputError
from stiction_ros.records.bag.topic_choice import topic_choice


@pytest.mark.parametrize(
    ("names", "regex", "exclude", "chosen"),
    [
        ([], ".*", "", ["/pv", "/op", "/a/pv"]),
        (["/pv"], "", "", ["/pv"]),
        (["/op"], ".*/pv", "", ["/pv", "/op", "/a/pv"]),
        ([], "/pv", "", ["/pv"]),
        (["/pv", "/op"], "", "/p.*", ["/op"]),
        ([], ".*", "/a/.*", ["/pv", "/op"]),
    ],
)
def test_names_and_expressions(
    names: list[str], regex: str, exclude: str, chosen: list[str]
) -> None:
    choice = topic_choice(names, regex, exclude)
    assert [topic for topic in ("/pv", "/op", "/a/pv") if choice(topic)] == chosen


@pytest.mark.parametrize(
    ("names", "regex", "exclude", "said"),
    [
        ([], "", "", "no topic is chosen; set topics or regex"),
        ([], "(", "", "recorder: regex: no regular expression"),
        (["/pv"], "", "[", "recorder: exclude_regex: no regular expression"),
    ],
)
def test_errors(names: list[str], regex: str, exclude: str, said: str) -> None:
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        topic_choice(names, regex, exclude)
