"""A replay gives the numbers of the live run, and says so when it does not."""

import dataclasses
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "records"))
sys.path.insert(0, str(Path(__file__).parents[1]))
from bag_cutting import SECOND, copy_bag, cut_bag
from bag_making import joint_state, text
from recorded_runs import SAMPLES, write_run

from stiction_ros.effects import KanoStiction
from stiction_ros.errors import InputError
from stiction_ros.identification import Identification, IdentificationOptions
from stiction_ros.online.estimator.live import fit
from stiction_ros.online.loop_estimator import EstimatorNodeSettings
from stiction_ros.online.replays.bag import read_replay_bag
from stiction_ros.online.replays.estimator import replay_estimator
from stiction_ros.online.replays.result import Match, Replay, first_difference
from stiction_ros.online.replays.run import replay
from stiction_ros.online.session import LiveRun
from stiction_ros.records.bag.messages import read_messages, read_raw
from stiction_ros.records.bag.writer import BagWriter
from stiction_ros.records.record import Record
from stiction_ros.records.storage.mcap_scan import RawMessage
from stiction_ros.settings import from_mapping

FITS = [399, 449, 499]  # samples


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, LiveRun]:
    """A run from its first sample until a little after the swap, with three fits."""
    path = tmp_path_factory.mktemp("run") / "bag"
    return path, write_run(path)


@pytest.fixture(scope="module")
def bag(live: tuple[Path, LiveRun]) -> Path:
    return live[0]


@pytest.fixture(scope="module")
def swap(live: tuple[Path, LiveRun]) -> int:
    """The sample from which the live run was under the embedding controller."""
    start, change = live[1].changes
    assert (start.sample, change.mode.value) == (0, "embedding")
    return change.sample


@pytest.fixture(scope="module", autouse=True)
def each_fit_once() -> Iterator[None]:
    """Fit no window twice: copies of the bag that spoil something else hold the same windows."""
    known: dict[tuple[bytes, bytes], Identification] = {}

    def remembered(record: Record, options: IdentificationOptions) -> Identification:
        key = record.op.tobytes(), record.pv.tobytes()
        if key not in known:
            known[key] = fit(record, options)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("stiction_ros.online.loop_estimator.fit", remembered)
        yield


@pytest.fixture(scope="module")
def whole(bag: Path) -> Replay:
    return replay(bag)


def test_every_fit_is_equal(whole: Replay) -> None:
    found = [(fit.fit.end, fit.comparison.match, fit.comparison.difference) for fit in whole.fits]
    assert found == [(end, Match.EQUAL, "") for end in FITS]


def test_every_op_is_equal(whole: Replay) -> None:
    assert whole.op is not None
    assert (whole.op.compared, whole.op.equal) == (SAMPLES, SAMPLES)


def test_the_swap_comes_at_the_same_moment(whole: Replay, swap: int) -> None:
    assert whole.modes is not None
    assert (whole.modes.match, whole.modes.difference) == (Match.EQUAL, "")
    recorded, replayed = whole.swaps
    assert recorded is not None
    assert recorded == replayed
    assert whole.seconds(recorded.stamp) == swap


def test_the_whole_replay_is_equal_without_notes(whole: Replay) -> None:
    assert whole.match is Match.EQUAL
    assert whole.from_first_sample
    assert whole.first_difference == ""
    assert whole.notes == ()


def test_a_run_with_another_law_is_replayed_bit_for_bit(tmp_path: Path) -> None:
    live = write_run(tmp_path / "bag", KanoStiction(4.0, 2.0), 500)
    assert live.swap is not None
    found = replay(tmp_path / "bag")
    assert (found.match, found.first_difference) == (Match.EQUAL, "")
    assert list(found.fits[-1].fit.rows) == ["V1.f_s", "V1.f_d", "V1.kano.s", "V1.kano.j"]
    assert found.modes is not None
    assert found.swaps[0] is not None
    assert set(found.swaps[0].frictions) == {"V1.f_s", "V1.f_d", "V1.s", "V1.j"}


def test_the_json_tells_fits_modes_and_swap(
    whole: Replay, live: tuple[Path, LiveRun], swap: int
) -> None:
    document = whole.to_dict()
    assert document["match"] == "equal"
    assert document["swap"] == {"recorded": swap, "replayed": swap}
    fits = live[1].fits
    assert [fit["loop_model"] for fit in document["fits"]] == [
        fit.loop_model is not None for fit in fits
    ]
    assert [fit["valves"][0]["verdict"] for fit in document["fits"]] == [
        fit.identification.valves[0].verdict.value for fit in fits
    ]
    modes = [change["mode"] for change in document["modes"]["replayed"]]
    assert modes == ["unaware", "embedding"]


def test_a_bag_that_begins_late_is_compared_from_its_first_whole_window(
    bag: Path, tmp_path: Path
) -> None:
    found = replay(cut_bag(bag, tmp_path / "bag", first=121.0))
    assert not found.from_first_sample
    assert found.op is None
    assert [(fit.whole, fit.comparison.match) for fit in found.fits] == [
        (False, Match.NOT_COMPARED),
        (True, Match.EQUAL),
        (True, Match.EQUAL),
    ]
    assert (found.modes, found.match) == (None, Match.EQUAL)
    assert found.notes == (
        "the bag begins at sample 120 of the run: fits are compared from the first whole window "
        "on, what is trusted after them, op and modes are not",
    )


def test_a_bag_without_a_whole_window_compares_nothing(bag: Path, tmp_path: Path) -> None:
    found = replay(cut_bag(bag, tmp_path / "bag", first=405.0))
    assert found.match is Match.NOT_COMPARED


# ---- what differs is named ---------------------------------------------------------------------

Spoil = Callable[[RawMessage], RawMessage | None]


def joint(bag: Path, topic: str, second: int, shift: float) -> Spoil:
    """Return a copy's change of the first value of one message."""
    stamp = second * SECOND
    (found,) = [
        message.message
        for message in read_messages(bag, wanted=lambda t: t.name == topic)
        if message.log_time == stamp
    ]
    values = [found.position[0] + shift, *found.position[1:]]
    frame = found.header.frame_id
    data = joint_state(stamp, found.name, values, found.velocity, found.effort, frame)

    def spoil(raw: RawMessage) -> RawMessage:
        here = raw.topic.name == topic and raw.log_time == stamp
        return raw._replace(data=data) if here else raw

    return spoil


def config(bag: Path, change: Callable[[str], str], topic: str) -> Spoil:
    """Return a copy's change of the text on one topic."""
    (found,) = {m.message.data for m in read_messages(bag, wanted=lambda t: t.name == topic)}

    def spoil(raw: RawMessage) -> RawMessage:
        return raw._replace(data=text(change(found))) if raw.topic.name == topic else raw

    return spoil


def without(*names: str) -> Spoil:
    return lambda raw: None if raw.topic.name in names else raw


def test_another_op_is_named_by_its_time(bag: Path, tmp_path: Path) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", joint(bag, "/op", 510, 1e-12)))
    assert found.match is Match.DIFFERENT
    assert found.first_difference.startswith("op at 509 s: recorded (")
    assert found.op is not None
    assert found.op.compared - found.op.equal == 1


@pytest.mark.trial
def test_another_pv_makes_another_fit(bag: Path, tmp_path: Path) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", joint(bag, "/pv", 490, 0.5)))
    assert found.match is Match.DIFFERENT
    assert found.first_difference.startswith("fit at 499 s: ")
    assert ": recorded " in found.first_difference


def test_another_friction_in_stiction_is_named(bag: Path, tmp_path: Path) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", joint(bag, "/stiction", 450, 0.25)))
    spoilt = found.fits[1].comparison
    assert spoilt.match is Match.DIFFERENT
    estimate = found.fits[1].fit.rows["V1.f_s"][0]
    assert spoilt.difference == (
        f"stiction.V1.f_s.value: recorded {estimate + 0.25!r}, replayed {estimate!r}"
    )


def test_another_moment_of_the_swap_is_named(bag: Path, swap: int, tmp_path: Path) -> None:
    spoil = without("/diagnostics")

    def later(raw: RawMessage) -> RawMessage | None:
        return raw if raw.log_time != (swap + 1) * SECOND else spoil(raw)

    found = replay(copy_bag(bag, tmp_path / "bag", later))
    assert found.modes is not None
    assert found.modes.match is Match.DIFFERENT
    assert found.modes.difference.startswith(("change 2", "changes of mode: recorded"))


def test_a_lost_sample_is_noted(bag: Path, tmp_path: Path) -> None:
    def lose(raw: RawMessage) -> RawMessage | None:
        lost = raw.topic.name in ("/pv", "/op", "/sp") and raw.log_time == 50 * SECOND
        return None if lost else raw

    found = replay(copy_bag(bag, tmp_path / "bag", lose))
    assert "1 samples are missing within the bag" in found.notes


def test_a_bag_without_the_estimates_compares_op_and_modes_alone(bag: Path, tmp_path: Path) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", without("/stiction")))
    assert {fit.comparison.match for fit in found.fits} == {Match.NOT_COMPARED}
    assert found.match is Match.EQUAL


def test_a_bag_without_the_controller_s_configuration_says_so(bag: Path, tmp_path: Path) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", without("/controller/config")))
    assert found.modes is None
    assert found.op is None
    assert "no configuration of a controller: changes of mode are not replayed" in found.notes


@pytest.mark.trial
def test_a_bag_without_diagnostics_takes_its_first_pv_for_the_run_s(
    bag: Path, tmp_path: Path
) -> None:
    found = replay(copy_bag(bag, tmp_path / "bag", without("/diagnostics")))
    assert found.from_first_sample
    assert any(note.startswith("/diagnostics of the estimator are") for note in found.notes)


def test_a_bag_without_the_estimator_s_configuration_is_one_clear_error(
    bag: Path, tmp_path: Path
) -> None:
    path = copy_bag(bag, tmp_path / "bag", without("/estimator/config"))
    with pytest.raises(InputError, match="holds no configuration of an estimator; record"):
        replay(path)


def test_a_parameter_of_another_version_is_one_clear_error(bag: Path, tmp_path: Path) -> None:
    spoil = config(bag, lambda t: t.replace(" window:", " windows:"), "/estimator/config")
    with pytest.raises(InputError, match="estimator/config: unknown key 'windows'"):
        replay(copy_bag(bag, tmp_path / "bag", spoil))


@pytest.mark.trial
def test_another_version_and_pace_are_noted(bag: Path, tmp_path: Path) -> None:
    def older(told: str) -> str:
        return told.replace("version: ", "version: 0.0.").replace("lockstep", "realtime")

    found = replay(copy_bag(bag, tmp_path / "bag", config(bag, older, "/controller/config")))
    assert any("/controller ran version 0.0." in note for note in found.notes)
    assert any("realtime pace" in note for note in found.notes)


def test_a_bag_without_op_has_nothing_to_replay(bag: Path, tmp_path: Path) -> None:
    path = tmp_path / "listened"
    with BagWriter(path) as writer:
        for raw in read_raw(bag):
            name = {"/pv": "/FIC101/pv", "/op": "/FIC101/op_applied"}.get(raw.topic.name)
            if name:
                topic = raw.topic
                writer.add_topic(name, topic.type, topic.definition, topic.type_hash)
                writer.write(name, raw.data, raw.log_time, raw.publish_time)
    for namespace in (None, "/FIC101"):
        with pytest.raises(InputError, match=r"only listening.*identify, report, convert and gap"):
            read_replay_bag(path, namespace=namespace)


@pytest.mark.trial
def test_of_several_loops_one_is_chosen_by_its_namespace(bag: Path, tmp_path: Path) -> None:
    path = tmp_path / "two"
    with BagWriter(path) as writer:
        for raw in read_raw(bag):
            for space in ("/one", "/two"):
                if raw.topic.name in ("/pv", "/op", "/sp"):
                    topic = dataclasses.replace(raw.topic, name=space + raw.topic.name)
                    writer.add_topic(topic.name, topic.type, topic.definition, topic.type_hash)
                    writer.write(topic.name, raw.data, raw.log_time, raw.publish_time)
    with pytest.raises(InputError, match=r"holds 2 loops \(/one, /two\); choose one with --names"):
        read_replay_bag(path)
    with pytest.raises(InputError, match="no loop in the namespace three; its loops are /one, /t"):
        read_replay_bag(path, namespace="three")
    assert read_replay_bag(path, namespace="two").namespace == "/two"


def test_a_fit_that_fails_leaves_the_next_one_alone(
    bag: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded = read_replay_bag(bag)
    assert recorded.estimator is not None
    settings = from_mapping(EstimatorNodeSettings, recorded.estimator.parameters, "")
    calls: list[int] = []

    def fitter(record: Record, options: IdentificationOptions) -> Identification:
        calls.append(len(calls))
        if len(calls) == 1:
            raise RuntimeError("no memory")
        return fit(record, options)

    monkeypatch.setattr("stiction_ros.online.loop_estimator.fit", fitter)
    early = tuple(one for one in recorded.signals if one.stamp <= 460 * SECOND)
    found = replay_estimator(dataclasses.replace(recorded, signals=early), settings, SECOND)
    first, second = found.fits
    assert first.failure == "window not usable: RuntimeError('no memory')"
    assert first.rows == {}
    assert second.update is not None


@pytest.mark.parametrize(
    ("one", "other", "said"),
    [
        ({"a": 1.0}, {"a": 1.0}, ""),
        ({"a": {"b": [1, 2]}}, {"a": {"b": [1, 3]}}, "a.b.1: recorded 2, replayed 3"),
        ({"a": [1]}, {"a": [1, 2]}, "a: recorded [1], replayed [1, 2]"),
        ({"a": 1}, {}, "a: recorded 1, replayed None"),
        ({"a": [{"b": 1}]}, {"a": [{"b": 1, "new": 2}], "new": 3}, ""),
        ({"a": [{"b": 1}]}, {"a": [{"b": 2, "new": 2}]}, "a.0.b: recorded 1, replayed 2"),
    ],
)
def test_the_first_difference_is_named_and_what_an_older_version_did_not_tell_is_none(
    one: object, other: object, said: str
) -> None:
    assert first_difference(one, other) == said
