import pytest

from stiction_ros.cli.main import main
from stiction_ros.config_files import find_config
from stiction_ros.effects import HeStiction
from stiction_ros.loop import ValveChange
from stiction_ros.online.session import Scenario
from stiction_studies.commands.change import Outcome, _good, changed

OLD, GROWN = HeStiction(8.0, 1.0), HeStiction(12.0, 1.0)


@pytest.fixture(scope="module")
def tank() -> Scenario:
    return Scenario.load(find_config("tank.scenario.yaml"))


def test_the_valve_changes_after_the_swap_and_a_window_follows(tank: Scenario) -> None:
    scenario, friction = changed(tank, "grown")
    assert friction == GROWN
    assert scenario.valve_changes == (ValveChange(1302 * 60.0, "V1", (GROWN,)),)
    assert scenario.samples == 3100  # whole rounds of 620 samples
    assert scenario.samples >= 1302 + tank.estimator.window


def test_serviced_leaves_no_friction_and_unchanged_all(tank: Scenario) -> None:
    assert changed(tank, "serviced")[0].valve_changes[0].effects == ()
    scenario, friction = changed(tank, "unchanged")
    assert (scenario.valve_changes, friction) == ((), OLD)


def outcome(**known: object) -> Outcome:
    values: dict[str, object] = {
        "seed": 1,
        "good": False,
        "noticed": 300,
        "moves": 20,
        "mode": "unaware",
        "static_friction": None,
        "amplitude": {"C": 0.1, "T": 0.1},
    }
    return Outcome(**(values | known))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("known", "good"),
    [
        ({}, True),
        ({"moves": 61}, False),
        ({"noticed": None}, False),
        ({"noticed": 1241}, False),
        ({"mode": "embedding"}, False),
        ({"static_friction": 8.0}, False),
    ],
)
def test_a_service_is_noticed_soon_or_it_does_not_count(
    known: dict[str, object], good: bool
) -> None:
    assert _good(outcome(**known), "serviced", None, 1240) is good


@pytest.mark.parametrize(
    ("friction", "amplitude", "good"),
    [(12.5, 0.15, True), (11.3, 0.1, False), (12.0, 0.16, False), (None, 0.1, False)],
)
def test_a_growth_is_found_and_the_loop_is_quiet(
    friction: float | None, amplitude: float, good: bool
) -> None:
    one = outcome(mode="embedding", static_friction=friction, amplitude={"C": amplitude})
    assert _good(one, "grown", GROWN, 1240) is good


def test_an_unchanged_valve_must_not_be_noticed() -> None:
    one = outcome(mode="embedding", static_friction=8.1, noticed=None)
    assert _good(one, "unchanged", OLD, 1240)
    assert not _good(outcome(mode="embedding", static_friction=8.1), "unchanged", OLD, 1240)


def test_a_scenario_that_is_not_there_is_named() -> None:
    assert main(["study-change", "nowhere.scenario.yaml"]) == 2
