import dataclasses
import tempfile
from collections.abc import Sequence
from pathlib import Path

import pytest
from bag_making import JOINT_STATE, SECOND, Bag, joint_state
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.records.bag.playback import Playback, bag_content, offered_qos
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.storage.bag_metadata import BagTopic, Qos, qos_yaml
from stiction_ros.records.storage.mcap_scan import RawMessage

START = 5 * SECOND


class HandClock:
    """A steady clock that a test moves."""

    def __init__(self) -> None:
        self.now = 17

    def __call__(self) -> int:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += round(seconds * SECOND)


def written(bag: Bag) -> Path:
    bag.writer.close()
    return bag.writer.directory


def ramp(bag: Bag, samples: int = 6) -> Path:
    """Two topics, one sample a second from START on."""
    for k in range(samples):
        bag.joint("/pv", START + k * SECOND, {"C": float(k)})
        bag.joint("/op", START + k * SECOND, {"V1": float(k)})
    return written(bag)


def player(path: Path, clock: HandClock, wanted: str = ".*", **options: float | bool) -> Playback:
    return Playback(bag_content(path, wanted), clock, **options)  # type: ignore[arg-type]


def seconds(messages: Sequence[RawMessage]) -> list[float]:
    return [(message.log_time - START) / SECOND for message in messages]


def test_nothing_is_due_before_it_is_resumed(bag: Bag) -> None:
    clock = HandClock()
    playback = player(ramp(bag), clock)
    clock.wait(10.0)
    assert playback.due(100) == []
    assert playback.time == START


@pytest.mark.parametrize(("rate", "waited"), [(1.0, 2.5), (2.0, 1.25), (0.5, 5.0)])
def test_messages_come_at_their_time_divided_by_the_rate(
    bag: Bag, rate: float, waited: float
) -> None:
    clock = HandClock()
    playback = player(ramp(bag), clock, rate=rate)
    playback.resume()
    clock.wait(waited)
    assert seconds(playback.due(100)) == [0, 0, 1, 1, 2, 2]
    assert playback.time == START + round(2.5 * SECOND)
    assert playback.due(100) == []


def test_what_is_played_is_what_was_recorded(bag: Bag) -> None:
    clock = HandClock()
    path = ramp(bag)
    playback = player(path, clock)
    playback.resume()
    clock.wait(100.0)
    found = [(m.topic.name, m.log_time, m.data) for m in playback.due(100)]
    assert found == bag.written
    assert playback.finished
    assert playback.played == 12


def test_time_stands_still_while_paused(bag: Bag) -> None:
    clock = HandClock()
    playback = player(ramp(bag), clock)
    playback.resume()
    clock.wait(1.5)
    playback.pause()
    clock.wait(60.0)
    assert playback.time == START + round(1.5 * SECOND)
    assert playback.due(100) == []
    playback.resume()
    clock.wait(0.6)
    assert seconds(playback.due(100)) == [0, 0, 1, 1, 2, 2]


def test_a_new_rate_holds_from_now_on(bag: Bag) -> None:
    clock = HandClock()
    playback = player(ramp(bag), clock)
    playback.resume()
    clock.wait(1.0)
    playback.rate = 4.0
    clock.wait(0.5)
    assert playback.time == START + 3 * SECOND


def test_a_step_is_every_message_of_the_next_time(bag: Bag) -> None:
    playback = player(ramp(bag, 3), HandClock())
    steps = [seconds(playback.next_messages()) for _ in range(4)]
    assert steps == [[0, 0], [1, 1], [2, 2], []]
    assert playback.finished


def test_a_running_playback_does_not_step(bag: Bag) -> None:
    playback = player(ramp(bag), HandClock())
    playback.resume()
    assert playback.next_messages() == []


def test_after_a_step_time_goes_on_from_there(bag: Bag) -> None:
    clock = HandClock()
    playback = player(ramp(bag), clock)
    playback.next_messages()
    playback.next_messages()
    playback.resume()
    clock.wait(1.0)
    assert seconds(playback.due(100)) == [2, 2]


def test_a_start_passes_over_what_is_before_but_for_the_last_latched(bag: Bag) -> None:
    for k in range(3):
        bag.text("/mode", f"mode {k}", START + k * SECOND)
    for k in range(6):
        bag.joint("/pv", START + k * SECOND, {"C": float(k)})
    clock = HandClock()
    path = written(bag)
    playback = player(path, clock, start=3.0)
    playback.resume()
    found = playback.due(100)
    assert [m.topic.name for m in found] == ["/mode", "/pv"]
    assert seconds(found) == [2, 3]


def test_a_loop_begins_again_at_the_start(bag: Bag) -> None:
    clock = HandClock()
    playback = player(ramp(bag, 3), clock, "/pv", start=1.0, loop=True)
    playback.resume()
    found = []
    for _ in range(5):
        clock.wait(1.0)
        found += seconds(playback.due(100))
    assert found == [1, 2] * 5
    assert playback.rounds == 5
    assert not playback.finished


def test_no_more_than_asked_for_at_once(bag: Bag) -> None:
    clock = HandClock()
    playback = player(ramp(bag), clock)
    playback.resume()
    clock.wait(100.0)
    assert [len(playback.due(5)) for _ in range(4)] == [5, 5, 2, 0]


def test_topics_are_chosen_by_their_full_names(bag: Bag) -> None:
    content = bag_content(ramp(bag), "/p.*")
    assert [message.topic.name for message in content.messages] == 6 * ["/pv"]
    assert content.seconds == 5.0


@pytest.mark.parametrize(
    ("wanted", "options", "said"),
    [
        ("(", {}, "no regular expression"),
        ("/none", {}, "holds no message to play"),
        (".*", {"rate": 0.0}, "0 is no rate"),
        (".*", {"start": 6.0}, "6 s is not within the bag, which lasts 5 s"),
        (".*", {"start": -1.0}, "-1 s is not within the bag"),
    ],
)
def test_what_cannot_be_played_is_one_clear_error(
    bag: Bag, wanted: str, options: dict[str, float], said: str
) -> None:
    path = ramp(bag)
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        player(path, HandClock(), wanted, **options)


moves = st.lists(
    st.one_of(
        st.floats(0.0, 3.0),
        st.sampled_from(["pause", "resume", "step"]),
        st.tuples(st.just("rate"), st.floats(0.1, 20.0)),
    ),
    max_size=30,
)


@given(st.lists(st.integers(0, 8), min_size=1, max_size=20), moves, st.integers(1, 7))
def test_every_message_comes_once_in_order_and_never_early(
    times: list[int], moves: list[object], most: int
) -> None:
    stamps = [START + time * SECOND for time in sorted(times)]
    with tempfile.TemporaryDirectory() as folder:
        bag = Bag(BagWriter(Path(folder) / "run"))
        for number, stamp in enumerate(stamps):
            data = joint_state(stamp, ["C"], [float(number)])
            bag.put("/pv", JOINT_STATE, data, stamp)
        clock = HandClock()
        playback = player(written(bag), clock)
        found: list[bytes] = []
        for move in moves:
            if isinstance(move, float):
                clock.wait(move)
            elif isinstance(move, tuple):
                playback.rate = move[1]
            elif move == "step":
                found += [message.data for message in playback.next_messages()]
            else:
                getattr(playback, str(move))()
            for message in playback.due(most):
                assert message.log_time <= playback.time
                found.append(message.data)
        playback.resume()
        clock.wait(1000.0)
        while not playback.finished:
            found += [message.data for message in playback.due(most)]
    assert found == [data for _, _, data in bag.written]


def topic(*profiles: Qos) -> BagTopic:
    return BagTopic("/a", JOINT_STATE, "", "", qos_yaml(profiles))


@pytest.mark.parametrize("durability", ["volatile", "transient_local"])
@pytest.mark.parametrize("reliability", ["reliable", "best_effort"])
@pytest.mark.parametrize("depth", [1, 7, 100])
def test_the_recorded_quality_of_service_is_offered(
    durability: str, reliability: str, depth: int
) -> None:
    qos = Qos(durability=durability, reliability=reliability, depth=depth)
    assert offered_qos(topic(qos)) == qos


def test_of_several_profiles_the_one_that_suits_all_readers_is_offered() -> None:
    weak = Qos(reliability="best_effort", depth=5)
    strong = Qos(durability="transient_local", depth=1)
    assert offered_qos(topic(weak, strong)) == dataclasses.replace(strong, depth=5)


def test_without_a_profile_it_is_reliable_and_volatile() -> None:
    found = offered_qos(BagTopic("/a", JOINT_STATE, ""))
    assert (found.reliability, found.durability) == ("reliable", "volatile")


def test_profiles_of_old_bags_are_numbers() -> None:
    text = "- history: 1\n  depth: 3\n  reliability: 2\n  durability: 1\n"
    found = offered_qos(BagTopic("/a", JOINT_STATE, "", "", text))
    assert found == Qos(depth=3, reliability="best_effort", durability="transient_local")


@pytest.mark.parametrize("text", ["[", "7", "- 3", "- reliability: 99", "- depth: many"])
def test_a_profile_that_cannot_be_read_is_one_clear_error(text: str) -> None:
    with pytest.raises(InputError, match="quality of service of /a cannot be read"):
        offered_qos(BagTopic("/a", JOINT_STATE, "", "", text))
