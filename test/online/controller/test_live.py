import dataclasses
import functools
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np
import pytest

from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, StepStatus
from stiction_ros.effects import ChoudhuryStiction, FrictionLaw, HeStiction, KanoStiction, Stiction
from stiction_ros.errors import InputError
from stiction_ros.identification.friction import behaviour_of
from stiction_ros.loop import LoopModel, Plant, SetPoints, ValveChange
from stiction_ros.online.controller.live import LiveController
from stiction_ros.online.controller.plans import thinned_plan
from stiction_ros.online.controller.settings import LiveControllerSettings

PLANT = LoopModel.load(find_config("example1.loop.yaml"))
PROCESS = LoopModel.load(find_config("example1_process.loop.yaml"))
MOVES = SetPoints.load(find_config("siso.set_points.yaml"), ("PV1",))
TANK = LoopModel.load(find_config("tank_linear.loop.yaml"))
SETTINGS = LiveControllerSettings(
    horizon=40,
    move_weights=(0.1,),
    embedding_move_weights=(0.01,),
    look_ahead=0,  # a friction that is wrong shows in many moves of the stem
    kick_limits=(np.inf,),
    state_noise=0.01,
    disturbance_noise=(1e-4,),
    measurement_noise=(1e-4,),
    watch_samples=0,
    hand_over_samples=1,
    offer_samples=0,
    approach_samples=0,
)
KNOWN = PROCESS.with_valve_effects({"V1": [HeStiction(5.0, 2.0)]})


def settings(**changes: object) -> LiveControllerSettings:
    return dataclasses.replace(SETTINGS, **changes)  # type: ignore[arg-type]


class Run:
    """The sticky loop of Example 1 under a live controller."""

    def __init__(self, live: LiveController, seed: int = 1) -> None:
        self.live, self.plant = live, Plant(PLANT, seed)
        self.op: list[float] = []
        self.error: list[float] = []

    def go(self, samples: int) -> None:
        for _ in range(samples):
            measured = self.plant.measure()
            sp = MOVES.at(measured.time)
            op = self.live.step(measured.pv, sp).op
            self.plant.apply(op)
            self.op.append(float(op[0]))
            self.error.append(abs(float(measured.pv_clean[0] - sp[0])))


def modes(live: LiveController) -> list[tuple[int, str]]:
    return [(change.sample, change.mode.value) for change in live.changes]


def refusal_of(live: LiveController, model: LoopModel) -> str:
    """What is said of an offer that cannot be prepared."""
    live.offer(model, 0)
    live.step(np.array(live.model.pv0), np.array(live.model.pv0))
    return live.doubts[-1][1]


def test_it_starts_unaware_where_no_friction_is_known() -> None:
    live = LiveController(SETTINGS, PROCESS)
    assert (live.mode, live.frictions) == (ControlMode.UNAWARE, (None,))
    assert modes(live) == [(0, "unaware")]


def test_it_starts_aware_of_the_friction_in_its_own_model() -> None:
    live = LiveController(SETTINGS, PLANT)
    assert (live.mode, live.frictions) == (ControlMode.EMBEDDING, (HeStiction(5.0, 2.0),))


@pytest.mark.parametrize("at", [30, 31, 57])
def test_an_offered_model_takes_effect_at_exactly_its_sample(at: int) -> None:
    plain, swapped = Run(LiveController(SETTINGS, PROCESS)), Run(LiveController(SETTINGS, PROCESS))
    plain.go(80)
    swapped.go(25)
    swapped.live.offer(KNOWN, at)
    swapped.go(55)
    assert modes(swapped.live) == [(0, "unaware"), (at, "embedding")]
    assert swapped.op[:at] == plain.op[:at]
    assert swapped.op[at] != plain.op[at]
    assert swapped.live.changes[-1].reason


def test_a_rate_limit_below_the_kick_of_the_valve_leaves_the_controller_unaware() -> None:
    live = LiveController(settings(op_rate_limits=(0.5,)), PROCESS)
    said = refusal_of(live, KNOWN)
    assert "op_rate_limits: 0.5 % per sample is less than the kick that moves V1" in said
    assert "raise it to at least 6.5, or leave the controller unaware" in said
    assert live.mode is ControlMode.UNAWARE
    live.retune(settings(op_rate_limits=(6.5,)))
    live.offer(KNOWN, 1)
    live.step(np.array(PROCESS.pv0), np.array(PROCESS.pv0))
    assert live.mode is ControlMode.EMBEDDING
    with pytest.raises(InputError, match="less than the kick that moves V1"):
        live.retune(settings(op_rate_limits=(0.5,)))
    live.step(np.array(PROCESS.pv0), np.array(PROCESS.pv0))
    assert live.settings.op_rate_limits == (6.5,)


def test_a_rate_limit_that_the_friction_fits_in_is_no_reason_to_refuse_it_unseen() -> None:
    judged = settings(op_rate_limits=(8.0,), hand_over_samples=200, offer_samples=1000)
    run = Run(LiveController(judged, PROCESS))
    run.go(300)
    run.live.offer(KNOWN, 300)
    run.go(200)
    assert run.live.doubts == []
    assert modes(run.live) == [(0, "unaware"), (300, "embedding")]
    assert np.abs(np.diff(run.op)).max() <= 8.0 + 1e-9


def test_an_offer_for_the_past_takes_effect_now() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(40)
    run.live.offer(KNOWN, 5)
    run.go(1)
    assert modes(run.live)[-1] == (40, "embedding")


def test_a_later_offer_replaces_one_that_waits() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    other = PROCESS.with_valve_effects({"V1": [HeStiction(6.0, 1.0)]})
    run.live.offer(KNOWN, 20)
    run.live.offer(other, 10)
    run.go(30)
    assert run.live.frictions == (HeStiction(6.0, 1.0),)
    assert modes(run.live) == [(0, "unaware"), (10, "embedding")]


def test_an_offer_without_friction_goes_back_to_unaware() -> None:
    run = Run(LiveController(SETTINGS, PLANT))
    run.live.offer(PROCESS, 10)
    run.go(20)
    assert modes(run.live) == [(0, "embedding"), (10, "unaware")]


def test_the_stem_is_known_after_the_swap() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(600)
    run.live.offer(KNOWN, 600)
    for _ in range(60):
        measured = run.plant.measure()
        op = run.live.step(measured.pv, MOVES.at(measured.time)).op
        stem = run.plant.apply(op)
        assert run.live.observed.stem == pytest.approx(stem, abs=1e-9)


def test_the_fixed_modes_take_no_notice_of_offers() -> None:
    run = Run(LiveController(settings(mode="unaware"), PROCESS))
    run.live.offer(KNOWN, 5)
    run.go(20)
    assert run.live.mode is ControlMode.UNAWARE


def test_too_many_sticky_valves_are_refused_as_a_value() -> None:
    valves = [{"name": f"V{i}", "limits": [0.0, 100.0]} for i in range(4)]
    process = {
        "kind": "arx",
        "outputs": [{"name": "Y", "a": [-0.8], "b": {v["name"]: [0.1] for v in valves}}],
    }
    four = LoopModel.from_mapping(
        {"loop": "four", "sample_time": 1.0, "valves": valves, "process": process}
    )
    live = LiveController(settings(), four)
    sticky = four.with_valve_effects({v: [HeStiction(5.0, 2.0)] for v in four.valve_names})
    assert "4 sticky valves" in refusal_of(live, sticky)
    live.step(np.zeros(1), np.zeros(1))
    assert live.mode is ControlMode.UNAWARE


def test_a_model_of_another_loop_is_refused_as_a_value() -> None:
    live = LiveController(settings(adopt_process=True), PROCESS)
    assert "V1" in refusal_of(live, TANK) or "another loop" in refusal_of(live, TANK)
    assert live.step(np.array([50.0]), np.array([50.0])).status is StepStatus.SOLVED


def test_an_adopted_process_keeps_the_limits_of_the_valves() -> None:
    document = PROCESS.to_mapping()
    del document["valves"][0]["limits"]
    found = LoopModel.from_mapping(document)
    live = LiveController(settings(adopt_process=True), PROCESS)
    live.step(np.array([50.0]), np.array([50.0]))
    live.offer(found, 0)
    for _ in range(60):
        op = live.step(np.array([50.0]), np.array([500.0])).op
        assert 0.0 <= op[0] <= 100.0
    assert live.changes[-1].reason == "friction identified"


def test_an_adopted_process_is_the_one_that_is_controlled_by() -> None:
    document = PROCESS.to_mapping()
    document["process"]["outputs"][0]["b"] = {"V1": [0.1]}
    live = LiveController(settings(adopt_process=True), PROCESS)
    live.step(np.array([50.0]), np.array([50.0]))
    live.offer(LoopModel.from_mapping(document), 0)
    live.step(np.array([50.0]), np.array([50.0]))
    assert live.observed.design.model.gain != pytest.approx(PROCESS.process.linear(1.0).gain)


# ---- watching ----------------------------------------------------------------------------------


def watched(**changes: object) -> LiveControllerSettings:
    return settings(
        watch_samples=100,
        watch_settle=40,
        adopt_process=True,
        offer_samples=0,
        slip_check=False,
        **changes,
    )


def process_of_gain(factor: float) -> LoopModel:
    document = PROCESS.to_mapping()
    output = document["process"]["outputs"][0]
    output["b"] = {"V1": [factor * b for b in output["b"]["V1"]]}
    return LoopModel.from_mapping(document)


# It believes the process to be three times weaker than it is, and so overdoes it.
WORSE = process_of_gain(0.3).with_valve_effects({"V1": [HeStiction(5.0, 2.0)]})


@pytest.mark.parametrize("law", [HeStiction, KanoStiction])
def test_a_controller_that_is_worse_is_rolled_back(law: type[FrictionLaw]) -> None:
    sticky = {"V1": [behaviour_of(str(law.law), (5.0, 2.0), {})]}
    run = Run(LiveController(watched(), PROCESS))
    run.plant = Plant(PLANT.with_valve_effects(sticky), 1)
    run.go(350)
    run.live.offer(WORSE.with_valve_effects(sticky), 350)
    run.go(500)
    assert [mode for _, mode in modes(run.live)] == ["unaware", "embedding", "unaware"]
    assert run.live.changes[-1].reason.startswith("rolled back: ")
    assert run.live.frictions == (None,)


def test_a_controller_that_ends_the_limit_cycle_stays() -> None:
    run = Run(LiveController(watched(), PROCESS))
    run.go(1000)
    run.live.offer(KNOWN, 1000)
    run.go(1400)
    assert modes(run.live) == [(0, "unaware"), (1000, "embedding")]
    before, after = np.array(run.error[600:850]), np.array(run.error[2150:2400])
    assert np.mean(after) < 0.5 * np.mean(before)


OTHERS = 20.0  # %: by which another one's OP is off, so that the loop fares worse under it


@pytest.mark.parametrize(
    ("before", "after", "offered", "rolled_back"),
    [
        # Who has the valve (o: we, x: another one, l: we, but limited) for so many samples before
        # the swap and after it, what is swapped in, and whether it is rolled back.
        ("o350", "o500", "KNOWN", False),
        pytest.param("o350", "x500", "KNOWN", False, marks=pytest.mark.trial),  # their errors
        ("o350", "x500", "WORSE", False),  # nothing is seen of it
        ("o350", "x200 o700", "WORSE", True),  # seen once it has the valve, by what was ours
        pytest.param("o350", "x200 o700", "KNOWN", False, marks=pytest.mark.trial),
        ("x350", "o700", "WORSE", False),  # there is nothing of ours to hold it against
        pytest.param("x350 o350", "o500", "WORSE", True, marks=pytest.mark.trial),
        ("o350", "l700", "WORSE", True),  # an OP that is limited is ours all the same
    ],
)
def test_a_swap_is_judged_by_samples_at_which_we_had_the_valve(
    before: str, after: str, offered: str, rolled_back: bool
) -> None:
    run = Run(LiveController(watched(), PROCESS))
    _go_on(run, before)
    run.live.offer({"WORSE": WORSE, "KNOWN": KNOWN}[offered], run.plant.sample)
    _go_on(run, after)
    found = any(change.reason.startswith("rolled back") for change in run.live.changes)
    assert found is rolled_back


def _go_on(run: Run, stretches: str) -> None:
    given = np.array(PLANT.stem_start)
    for stretch in stretches.split():
        for _ in range(int(stretch[1:])):
            measured = run.plant.measure()
            own = run.live.step(measured.pv, MOVES.at(measured.time)).op
            if stretch[0] == "x":
                given = np.array(PLANT.stem_start) + OTHERS
            else:
                given = np.clip(own, given - 3.0, given + 3.0) if stretch[0] == "l" else own
            run.plant.apply(given)
            run.live.applied(given, ours=stretch[0] != "x")


def test_after_the_roll_back_the_loop_goes_on_at_the_next_sample() -> None:
    run = Run(LiveController(watched(), PROCESS))
    run.go(350)
    run.live.offer(WORSE, 350)
    while len(run.live.changes) < 3:
        run.go(1)
        assert len(run.op) < 1000
    assert run.live.changes[-1].sample == len(run.op) - 1
    assert run.live.step(np.array([50.0]), np.array([50.0])).mode is ControlMode.UNAWARE


def test_a_mode_that_the_user_sets_is_not_rolled_back() -> None:
    run = Run(LiveController(watched(), PROCESS))
    run.go(200)
    run.live.retune(watched(mode="hold"))
    run.go(200)
    assert modes(run.live) == [(0, "unaware"), (200, "hold")]


def test_a_change_of_friction_is_watched_as_the_first_swap_is() -> None:
    run = Run(LiveController(watched(), PLANT))
    run.go(400)
    run.live.offer(process_of_gain(0.3).with_valve_effects({"V1": [HeStiction(4.0, 2.0)]}), 400)
    run.go(500)
    assert run.live.changes[-1].reason.startswith("rolled back: ")
    assert run.live.frictions == (HeStiction(5.0, 2.0),)
    assert run.live.mode is ControlMode.EMBEDDING


# ---- what is offered, against the past ---------------------------------------------------------


def test_friction_that_contradicts_the_past_is_doubted() -> None:
    run = Run(LiveController(settings(hand_over_samples=100, offer_samples=5000), PROCESS))
    run.go(900)
    run.live.offer(KNOWN, 900)
    run.go(300)
    far_off = PROCESS.with_valve_effects({"V1": [HeStiction(3.0, 0.5)]})
    run.live.offer(far_off, 1205)
    run.go(10)
    assert run.live.frictions == (HeStiction(5.0, 2.0),)
    ((sample, reason),) = run.live.doubts
    assert sample == 1205
    assert "explains" in reason


def test_friction_that_really_changed_is_taken() -> None:
    judged = settings(hand_over_samples=300, slip_check=False, offer_samples=5000)
    run = Run(LiveController(judged, PROCESS))
    run.go(900)
    run.live.offer(KNOWN, 900)
    run.go(100)
    changed = PLANT.with_valve_effects({"V1": [HeStiction(10.0, 2.0)]})
    run.plant = _with_new_valve(run.plant, changed)
    run.go(500)
    run.live.offer(changed, 1500)
    run.go(1)
    assert run.live.doubts == []
    assert run.live.frictions == (HeStiction(10.0, 2.0),)


def _with_new_valve(plant: Plant, model: LoopModel) -> Plant:
    """The same process and noise from now on, behind the valve of ``model``."""
    fresh = Plant(model, 1)
    stem = plant._valves[0].memories[0]
    fresh._state, fresh._now, fresh.sample = plant._state, plant._now, plant.sample
    fresh._valves[0].memories[0] = stem
    return fresh


def test_nothing_is_taken_before_there_is_a_past_to_judge_by() -> None:
    run = Run(LiveController(settings(hand_over_samples=200), PROCESS))
    run.go(100)
    run.live.offer(KNOWN, 0)
    run.go(600)
    (sample, reason), *_ = run.live.doubts
    assert sample == 100
    assert "only 100 samples" in reason
    assert modes(run.live) == [(0, "unaware"), (250, "embedding")]  # looked at again


@pytest.mark.parametrize("friction", [HeStiction(60.0, 59.0), HeStiction(20.0, 1.0)])
@pytest.mark.parametrize("known", [PROCESS, KNOWN])
def test_poisoned_friction_is_not_taken(friction: HeStiction, known: LoopModel) -> None:
    run = Run(LiveController(settings(hand_over_samples=200, offer_samples=5000), known))
    run.go(260)
    before = run.live.frictions
    run.live.offer(PROCESS.with_valve_effects({"V1": [friction]}), 0)
    run.go(600)
    assert run.live.doubts
    assert run.live.frictions == before


def test_a_roll_back_passes_over_what_was_itself_on_trial() -> None:
    run = Run(LiveController(watched(), PROCESS))
    run.go(350)
    run.live.offer(WORSE, 350)
    run.go(20)
    run.live.offer(process_of_gain(0.3).with_valve_effects({"V1": [HeStiction(6.0, 1.0)]}), 370)
    run.go(500)
    assert [mode for _, mode in modes(run.live)] == ["unaware"] + ["embedding"] * 2 + ["unaware"]
    assert run.live.frictions == (None,)


def test_what_was_rolled_back_must_be_clearly_better_to_come_again() -> None:
    run = Run(LiveController(settings(hand_over_samples=200, offer_samples=1000), KNOWN))
    run.go(1000)
    run.live._rolled_back.append((HeStiction(5.01, 1.99),))
    run.live.offer(PROCESS.with_valve_effects({"V1": [HeStiction(5.05, 2.0)]}), 1000)
    run.go(1)
    assert "rolled back before" in run.live.doubts[0][1]


# ---- what the valves were given ----------------------------------------------------------------


def test_what_is_told_to_be_applied_is_what_the_stem_estimate_follows() -> None:
    live = LiveController(SETTINGS, KNOWN)
    live.begin(np.array([50.0]))
    stem, applied = HeStiction(5.0, 2.0).rest(50.0), 50.0
    for k in range(40):
        result = live.step(np.array([50.0]), np.array([52.0]))
        assert result.op is not None
        applied = 50.0 + 9.0 * (k % 4 == 1) - 9.0 * (k % 4 == 3)
        live.applied(np.array([applied]))
        stem, position = HeStiction(5.0, 2.0).step(stem, applied)
        live.pass_over(np.array([np.nan]))
        assert live.observed.stem == pytest.approx([HeStiction(5.0, 2.0).step(stem, applied)[1]])
        stem, position = HeStiction(5.0, 2.0).step(stem, applied)
    assert position != 50.0


def test_an_op_that_never_reached_the_valve_is_no_evidence_of_a_stuck_one() -> None:
    run = Run(LiveController(SETTINGS, PLANT), seed=3)
    lost = np.random.default_rng(1)
    held = np.array([50.0])
    for _ in range(900):
        measured = run.plant.measure()
        op = run.live.step(measured.pv, MOVES.at(measured.time)).op
        held = held if lost.random() < 0.3 else op
        run.plant.apply(held)
        run.live.applied(held)
    assert run.live.frictions == (HeStiction(5.0, 2.0),)
    assert len(run.live.changes) == 1


def test_no_slip_is_judged_where_nobody_knows_what_was_applied() -> None:
    run = Run(LiveController(SETTINGS, PLANT), seed=3)
    for _ in range(400):
        measured = run.plant.measure()
        op = run.live.step(measured.pv, MOVES.at(measured.time)).op
        run.plant.apply(np.array([50.0]))
        run.live.applied(op, known=False)
    assert run.live.frictions == (HeStiction(5.0, 2.0),)


def test_the_first_op_of_a_run_is_the_one_in_force() -> None:
    live = LiveController(SETTINGS, PROCESS)
    live.begin(np.array([63.0]))
    first = live.step(np.array([50.0]), np.array([58.0]))
    second = live.step(np.array([50.0]), np.array([58.0]))
    assert abs(first.op[0] - 63.0) <= 1.0
    assert abs(second.op[0] - first.op[0]) > 1.0


@pytest.mark.parametrize("hold", [False, True])
def test_after_a_start_or_a_hold_a_far_set_point_is_approached(hold: bool) -> None:
    moves = {}
    for samples in (0, 20):
        live = LiveController(settings(approach_samples=samples), PROCESS)
        live.begin(np.array([50.0]))
        if hold:
            for _ in range(60):
                live.step(np.array([50.0]), np.array([50.0]))
            for _ in range(30):
                live.step(np.array([np.nan]), np.array([50.0]))
        op = [live.step(np.array([50.0]), np.array([60.0])).op[0] for _ in range(25)]
        moves[samples] = np.abs(np.diff([50.0, *op])).max()
        assert abs(op[0] - 50.0) <= 1.0
    assert moves[20] < 0.5 * moves[0]


def test_a_start_near_the_set_point_needs_no_approach() -> None:
    ops = []
    for samples in (0, 20):
        live = LiveController(settings(approach_samples=samples), PROCESS)
        live.begin(np.array([50.0]))
        ops.append([live.step(np.array([50.0]), np.array([50.3])).op[0] for _ in range(25)])
    assert ops[0] == ops[1]


def test_a_run_that_begins_anew_forgets_the_past_and_keeps_the_friction() -> None:
    run = Run(LiveController(SETTINGS, PLANT))
    run.go(300)
    run.live.begin(np.array([41.0]))
    measured = run.plant.measure()
    assert run.live.step(measured.pv, measured.pv).op == pytest.approx([41.0], abs=1.0)
    assert run.live.frictions == (HeStiction(5.0, 2.0),)
    assert len(run.live._past) == 0


def test_samples_that_are_passed_over_are_seen_and_keep_op() -> None:
    live, other = LiveController(SETTINGS, PROCESS), LiveController(SETTINGS, PROCESS)
    for one in (live, other):
        given = [one.step(np.array([50.0 + k]), np.array([50.0 + 5 * k])).op[0] for k in range(3)]
    for pv in (50.1, 50.3, 50.6):
        live.pass_over(np.array([pv]))
        other.pass_over(np.array([np.nan]))
    moved, blind = (one.step(np.array([51.0]), np.array([50.0])) for one in (live, other))
    assert given[1] != given[2]
    assert live._past.history().op[:, 0].tolist() == [*given, *given[2:] * 3]
    assert moved.op[0] < given[2]
    assert moved.op[0] != blind.op[0]


# ---- beside the loop ---------------------------------------------------------------------------


class Later(Executor):
    """A background whose work is done when the test says so."""

    def __init__(self) -> None:
        self.work: list[tuple[Future[Any], Callable[[], Any]]] = []

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.work.append((future, functools.partial(work, *arguments)))
        return future

    def do(self) -> None:
        for future, work in self.work:
            future.set_result(work())
        self.work.clear()


def test_an_offer_that_is_not_ready_in_time_is_taken_when_it_is() -> None:
    background = Later()
    run = Run(LiveController(SETTINGS, PROCESS, background))
    run.go(60)
    run.live.offer(KNOWN, 60)
    run.go(7)
    assert run.live.mode is ControlMode.UNAWARE
    background.do()
    run.go(1)
    assert modes(run.live) == [(0, "unaware"), (67, "embedding")]


def about_to_roll_back() -> tuple[Run, Later]:
    """A loop whose watch has found the controller worse, the one before not yet prepared."""
    background = Later()
    run = Run(LiveController(watched(), PROCESS, background))
    run.go(350)
    run.live.offer(WORSE, 350)
    background.do()
    while not background.work:
        run.go(1)
        assert len(run.op) < 1000
    return run, background


def test_a_roll_back_too_is_prepared_beside_the_loop() -> None:
    run, background = about_to_roll_back()
    run.go(3)
    assert run.live.mode is ControlMode.EMBEDDING
    background.do()
    run.go(1)
    assert run.live.mode is ControlMode.UNAWARE


def test_settings_that_change_while_an_offer_waits_do_not_undo_it() -> None:
    background = Later()
    run = Run(LiveController(SETTINGS, PROCESS, background))
    run.go(60)
    run.live.offer(KNOWN, 60)
    run.live.retune(settings(horizon=30))
    background.do()
    for _ in range(6):
        run.go(1)
        background.do()
    assert run.live.mode is ControlMode.EMBEDDING
    assert run.live.observed.design.unaware.horizon == 30


def test_no_offer_is_taken_while_a_roll_back_is_on_its_way() -> None:
    run, background = about_to_roll_back()
    run.live.offer(PROCESS.with_valve_effects({"V1": [HeStiction(6.0, 1.0)]}), 0)
    run.go(3)
    background.do()
    run.go(1)
    assert run.live.changes[-1].reason.startswith("rolled back")
    assert run.live._proven[0].frictions == (None,)


@pytest.mark.parametrize("error", [OverflowError("too large"), ValueError("no"), KeyError("x")])
def test_an_offer_that_fails_in_any_way_does_not_end_the_loop(
    error: Exception, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise error

    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(10)
    monkeypatch.setattr("stiction_ros.online.controller.making.spreads_of", fail)
    run.live.offer(KNOWN, 10)
    run.go(5)
    assert type(error).__name__ in run.live.doubts[0][1]
    assert run.live.mode is ControlMode.UNAWARE


def test_intervals_that_are_no_numbers_are_not_taken() -> None:
    document = KNOWN.to_mapping()
    document["provenance"] = [
        {"valve": "V1", "effect": "stiction", "f_s_interval": [0, 10**400], "f_d_interval": [0, 1]}
    ]
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(10)
    run.live.offer(LoopModel.from_mapping(document), 10)
    run.go(5)
    assert run.live.observed.spreads == (None,)


def test_a_new_run_does_not_follow_the_plan_of_the_last_one() -> None:
    live = LiveController(settings(approach_samples=20), PROCESS)
    for _ in range(40):
        live.step(np.array([50.0]), np.array([60.0]))
    live.begin(np.array([20.0]))
    blind = [float(live.step(np.array([np.nan]), np.array([60.0])).op[0]) for _ in range(3)]
    assert blind == [20.0] * 3
    seen = live.step(np.array([50.0]), np.array([60.0]))
    assert abs(seen.op[0] - 20.0) <= 1.0
    assert np.isfinite(live.step(np.array([50.0]), np.array([60.0])).op).all()
    assert live.observed.mode is ControlMode.UNAWARE


def test_the_way_to_the_fallback_has_a_rate_of_its_own() -> None:
    rule = settings(hold_after=1, fallback_after=2, fallback_op=(20.0,), fallback_rate=(5.0,))
    live = LiveController(rule, PROCESS)
    live.step(np.array([50.0]), np.array([50.0]))
    op = [float(live.step(np.array([np.nan]), np.array([50.0])).op[0]) for _ in range(12)]
    assert np.diff(op)[3:7] == pytest.approx([-5.0] * 4)


# ---- what is said ------------------------------------------------------------------------------


def test_embedding_without_friction_says_so() -> None:
    live = LiveController(settings(mode="embedding"), PROCESS)
    result = live.step(np.array([50.0]), np.array([50.0]))
    assert (result.mode, result.status) == (ControlMode.UNAWARE, StepStatus.SOLVED)
    assert "no friction is known" in result.reason
    live.offer(KNOWN, 1)
    assert live.step(np.array([50.0]), np.array([50.0])).reason == ""


def test_a_law_without_a_jump_form_is_refused_as_a_value(monkeypatch: pytest.MonkeyPatch) -> None:
    live = LiveController(SETTINGS, PROCESS)
    monkeypatch.setattr(ChoudhuryStiction, "jump_form", Stiction.jump_form)
    other = PROCESS.with_valve_effects({"V1": [ChoudhuryStiction(7.0, 3.0)]})
    assert "no jump form" in refusal_of(live, other)


def test_friction_beyond_the_travel_is_said_and_the_valve_left_alone() -> None:
    live = LiveController(SETTINGS, PROCESS.with_valve_effects({"V1": [HeStiction(150.0, 1.0)]}))
    for _ in range(5):
        result = live.step(np.array([48.0]), np.array([52.0]))
        assert result.op.tolist() == [50.0]
    assert result.status is StepStatus.UNREACHABLE
    assert "V1 cannot be moved" in result.reason


@pytest.mark.parametrize("law", [HeStiction, KanoStiction, ChoudhuryStiction])
def test_a_valve_that_sticks_more_in_mid_run_is_found_by_the_slip_check(
    law: type[FrictionLaw],
) -> None:
    before, after = (behaviour_of(str(law.law), (static, 2.0), {}) for static in (5.0, 9.0))
    known = PROCESS.with_valve_effects({"V1": [before]})
    run = Run(LiveController(SETTINGS, known))
    sticky = PLANT.with_valve_effects({"V1": [before]})
    run.plant = Plant(sticky, 1, [ValveChange(40.0, "V1", (after,))])
    run.go(900)
    told = [change.sample for change in run.live.changes if "V1 stayed" in change.reason]
    assert told
    assert min(told) > 40
    friction = run.live.frictions[0]
    assert isinstance(friction, law)
    assert 5.0 < friction.static_friction <= 9.0
    run.live.retune(settings(horizon=40))
    run.go(1)
    assert run.live.frictions == (friction,), "new settings have lost it"


def test_a_loop_without_measurements_ends_in_mode_hold_and_comes_back() -> None:
    run = Run(LiveController(settings(hold_after=2), PROCESS))
    run.go(20)
    for _ in range(10):
        run.live.step(np.array([np.nan]), np.array([50.0]))
    run.live.step(np.array([50.0]), np.array([50.0]))
    assert modes(run.live) == [(0, "unaware"), (22, "hold"), (30, "unaware")]
    assert run.live.changes[-1].reason == "a plan is found again"


def test_the_prediction_of_an_older_plan_begins_now() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(60)
    solved = run.live.step(np.array([50.0]), np.array([53.0]))
    before, _ = thinned_plan(run.live.observed, solved, 200)
    shifted = run.live.step(np.array([np.nan]), np.array([53.0]))
    rows, picks = thinned_plan(run.live.observed, shifted, 200)
    assert shifted.age == 1
    assert picks[-1] == len(before) - 2
    assert rows[1:, 0] == pytest.approx(before[2:, 0])


# ---- preview -----------------------------------------------------------------------------------


def test_a_preview_moves_the_valve_before_the_set_point_moves() -> None:
    ops = []
    for preview in (None, np.vstack([np.full((8, 1), 50.0), np.full((60, 1), 53.0)])):
        live = LiveController(SETTINGS, PROCESS)
        for _ in range(2):
            op = live.step(np.array([50.0]), np.array([50.0]), None, preview).op
        ops.append(op[0])
    assert ops[0] == pytest.approx(50.0)
    assert ops[1] > 50.5


# ---- settings ----------------------------------------------------------------------------------


def test_retuning_takes_effect_at_the_next_sample() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(60)
    run.live.retune(settings(move_weights=(50.0,)))
    run.go(1)
    assert run.live.observed.design.unaware.move.tolist() == [[50.0]]
    assert run.live.changes[-1].sample == 60


def test_retuning_keeps_what_is_known_of_the_friction() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.live.offer(KNOWN, 10)
    run.go(20)
    run.live.retune(settings(horizon=30))
    run.go(1)
    assert run.live.mode is ControlMode.EMBEDDING


def test_retuning_does_not_drop_an_offer_that_waits() -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(10)
    run.live.offer(KNOWN, 30)
    run.live.retune(settings(horizon=30))
    run.go(10)
    assert run.live.mode is ControlMode.UNAWARE, "it took effect before its time"
    run.go(20)
    assert (30, "embedding") in modes(run.live)


@pytest.mark.parametrize(
    "bad",
    [{"move_weights": (1.0, 1.0)}, {"pv_low": (5.0,), "pv_high": (4.0,)}, {"output_weights": ()}],
)
def test_settings_that_do_not_fit_are_refused_and_leave_the_old_ones(
    bad: dict[str, object],
) -> None:
    live = LiveController(SETTINGS, PROCESS)
    before = live.settings
    with pytest.raises(InputError):
        live.retune(settings(**bad))
    assert live.settings is before
    assert live.step(np.array([50.0]), np.array([50.0])).status is StepStatus.SOLVED
    assert len(live.changes) == 1


def test_settings_that_do_not_fit_the_model_are_refused_at_the_start() -> None:
    with pytest.raises(InputError):
        LiveController(settings(measurement_noise=(1.0, 1.0)), PROCESS)


@pytest.mark.parametrize("first", [True, False])
def test_measurements_that_are_no_numbers_do_no_lasting_harm(first: bool) -> None:
    run = Run(LiveController(SETTINGS, PROCESS))
    run.go(0 if first else 30)
    stood_in = run.live.step(np.array([np.nan]), np.array([50.0]))
    assert stood_in.status is (StepStatus.HELD if first else StepStatus.SHIFTED)
    run.live.offer(KNOWN, 0)
    result = run.live.step(np.array([50.0]), np.array([50.0]))
    assert result.status is StepStatus.SOLVED
    assert np.isfinite(run.live.observed.observer.state).all()


def test_disturbances_that_are_no_numbers_do_not_survive_a_swap() -> None:
    document = {
        "loop": "ss",
        "sample_time": 1.0,
        "valves": [{"name": "V1", "limits": [-100.0, 100.0]}],
        "process": {
            "kind": "state_space",
            "a": [[0.8]],
            "b": [[0.2]],
            "c": [[1.0]],
            "e": [[0.1]],
            "outputs": [{"name": "Y"}],
            "measured_disturbances": ["D"],
        },
    }
    model = LoopModel.from_mapping(document)
    live = LiveController(SETTINGS, model)
    live.step(np.zeros(1), np.zeros(1), np.zeros(1))
    live.step(np.zeros(1), np.zeros(1), np.array([np.nan]))
    live.offer(model.with_valve_effects({"V1": [HeStiction(5.0, 2.0)]}), 0)
    assert live.step(np.zeros(1), np.zeros(1), np.zeros(1)).status is StepStatus.SOLVED


def test_a_model_that_lacks_a_valve_is_refused_as_a_value() -> None:
    document = PROCESS.to_mapping()
    document["valves"][0]["name"] = "V7"
    document["process"]["outputs"][0]["b"] = {"V7": [0.1]}
    document["process"]["outputs"][0]["delay"] = {}
    document["operating_point"] = {}
    live = LiveController(SETTINGS, PROCESS)
    assert "V1" in refusal_of(live, LoopModel.from_mapping(document))


def test_after_a_roll_back_new_settings_do_not_bring_the_worse_controller_back() -> None:
    run = Run(LiveController(watched(), PROCESS))
    run.go(350)
    run.live.offer(WORSE, 350)
    run.go(500)
    run.live.retune(watched(horizon=30))
    run.go(1)
    assert run.live.mode is ControlMode.UNAWARE


def test_a_fit_must_take_effect_before_the_next_window_ends() -> None:
    model = LoopModel.load(find_config("example1_process.loop.yaml"))
    with pytest.raises(InputError, match="fit_every"):
        LiveController(LiveControllerSettings(fit_every=4, fit_latency=5), model)
