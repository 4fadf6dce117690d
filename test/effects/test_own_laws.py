"""A law with a third parameter and a jump form, from its file to answers and loop models."""

import dataclasses
import sys
from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest

from stiction_ros import effects
from stiction_ros.cli.gap import _print as _print_gap
from stiction_ros.cli.identify import _print
from stiction_ros.config_files import find_config
from stiction_ros.discrepancy import GapOptions, find_discrepancy
from stiction_ros.discrepancy.answer.found_effects import FoundEffect
from stiction_ros.discrepancy.answer.say import called
from stiction_ros.discrepancy.candidate.plugged import (
    PluggedOutput,
    PluggedValve,
    plugged_candidates,
)
from stiction_ros.discrepancy.fit.baseline import Baseline
from stiction_ros.discrepancy.fit.misfit import misfit
from stiction_ros.discrepancy.fit.search import _Search, fit_candidate
from stiction_ros.discrepancy.fit.uncertainty import likelihood_intervals
from stiction_ros.discrepancy.simulation.free_run import FreeRun, join_records
from stiction_ros.effects import Behaviour, discovery
from stiction_ros.errors import InputError
from stiction_ros.identification.answer.identified_loop import identified_loop
from stiction_ros.identification.answer.summary import why
from stiction_ros.identification.result import (
    FitStatus,
    Identification,
    OutputModel,
    ValveEstimate,
    VerdictKind,
)
from stiction_ros.loop import LoopModel, SetPoints, simulate
from stiction_ros.records.record import Record
from stiction_ros.report.run.identified import valve_cards

LAW = '''
"""He's law with a slip that falls short of its end."""

import dataclasses
from typing import ClassVar

import numpy as np

from stiction_ros import effects


@dataclasses.dataclass(frozen=True)
class FallsShort(effects.FrictionPair):
    """He's law whose slip leaves a share of its way undone."""

    law: ClassVar[str | None] = "falls_short"
    viscous: float = effects.parameter("viscous", "1", "share left undone", low=0.0, high=0.9)

    def step(self, memory, value, time=0.0):
        error = value - memory
        if abs(error) > self.static_friction:
            way = error - np.sign(error) * self.dynamic_friction
            memory = float(memory + (1.0 - self.viscous) * way)
        return memory, memory

    @classmethod
    def simulate_grid(cls, grid, values, start, sample_time=1.0):
        static, dynamic, viscous = grid.T
        stem, out = np.full(len(grid), 1.0) * start, np.empty((len(values), len(grid)))
        for k, value in enumerate(values):
            error = value - stem
            moved = stem + (1.0 - viscous) * (error - np.sign(error) * dynamic)
            np.copyto(stem, moved, where=np.abs(error) > static)
            out[k] = stem
        return out

    def jump_form(self):
        return effects.JumpForm(
            self, self.static_friction, self.dynamic_friction, 1.0 - self.viscous
        )

    @classmethod
    def axes(cls, seen):
        return (
            effects.Axis(0.2, max(seen.span, 2.5), 12),
            effects.Axis(0.0, 2.0, 6, natural=True),
            effects.Axis(0.0, 0.9, 4, natural=True),
        )
'''


@pytest.fixture(scope="module", autouse=True)
def _known(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The law in a folder that is known while this module is tested."""
    path = tmp_path_factory.mktemp("own")
    (path / "falls_short.py").write_text(LAW, encoding="utf-8")
    import stiction_ros.effects.own as own

    before, modules = list(own.__path__), set(sys.modules)
    own.__path__.append(str(path))
    discovery._found.cache_clear()
    yield
    own.__path__[:] = before
    discovery._found.cache_clear()
    for name in set(sys.modules) - modules:
        if name.startswith("stiction_ros.effects.own."):
            del sys.modules[name]


def law(viscous: float = 0.3) -> Behaviour:
    return effects.from_mapping(
        {"effect": "stiction", "law": "falls_short", "f_s": 4.0, "f_d": 1.5, "viscous": viscous}
    )


def loop() -> LoopModel:
    return LoopModel.load(find_config("flow.loop.yaml"))


@pytest.fixture(scope="module")
def record() -> Record:
    moves = SetPoints.load(find_config("flow.set_points.yaml"), loop().outputs)
    return simulate(loop().with_valve_effects({"V1": (law(),)}), moves, samples=400)


@pytest.fixture(scope="module")
def found(record: Record) -> Identification:
    """Return what a search for the law comes to, without the search."""
    valve = ValveEstimate(
        name="V1",
        verdict=VerdictKind.STICKY,
        law="falls_short",
        static_friction=4.0,
        static_interval=(3.8, 4.2),
        dynamic_friction=1.5,
        dynamic_interval=(1.3, 1.7),
        jump=2.5,
        stem_start=float(record.op[0, 0]),
        moves=40,
        evidence={},
        further={"viscous": 0.3},
        further_intervals={"viscous": (0.25, 0.36)},
    )
    model = OutputModel("PV1", (-0.9,), {"V1": (0.1,)}, {"V1": 2}, 0.0, 0.1, 90.0, 80.0)
    stem = np.asarray(record.stem)
    return Identification(FitStatus.OK, "", "exact", 400, 2.0, 0.1, (valve,), (model,), stem)


def test_the_loop_model_has_every_parameter_that_was_found(
    record: Record, found: Identification
) -> None:
    model = identified_loop(record, found, "again")
    assert model.valves[0].effects == (law(),)
    (told,) = [entry for entry in model.provenance if entry.get("valve") == "V1"]
    assert told["viscous_interval"] == [0.25, 0.36]


def test_the_jump_is_the_least_move_of_the_law(found: Identification) -> None:
    (valve,) = found.valves
    told = valve.with_own_jump()
    assert told.jump == pytest.approx(0.7 * (4.0 - 1.5))
    assert told.to_dict()["jump"] == told.jump
    assert "jumps by 1.75 % or more" in why(dataclasses.replace(found, valves=(told,)), 0)
    swings = dataclasses.replace(valve, law="semi_physical", further={"k": 1.99})
    assert swings.with_own_jump().jump == pytest.approx(1.99 * (4.0 - 1.5))
    assert dataclasses.replace(valve, jump=0.0).with_own_jump().jump == 0.0  # a deadband


def test_summary_and_report_show_every_parameter_with_its_interval(
    found: Identification, capsys: pytest.CaptureFixture[str]
) -> None:
    _print("short.csv", found)
    assert "viscous 0.3 (0.25 to 0.36)" in " ".join(capsys.readouterr().out.split())
    card = valve_cards([valve.to_dict() for valve in found.valves])
    assert "viscous 0.300 (0.250 … 0.360): share left undone" in card
    held = dataclasses.replace(found.valves[0], further_intervals={})
    _print("short.csv", dataclasses.replace(found, valves=(held,)))
    assert "held" in capsys.readouterr().out
    assert "viscous 0.300 (held)" in valve_cards([held.to_dict()])


def test_gap_leaves_out_what_the_law_refuses_of_its_axes(record: Record) -> None:
    run = FreeRun(loop(), join_records(loop(), [record]))
    candidate = PluggedValve.of(run, 0, type(law()))
    grid = candidate.values(candidate.grid())
    allowed = candidate.possible(grid)
    assert np.array_equal(allowed, grid[:, 1] <= grid[:, 0])
    assert 0.0 < allowed.mean() < 1.0
    base = Baseline.of(run)
    squares = misfit(base, run.gap, candidate.respond(run, grid), {0: np.zeros(0)})
    assert np.isinf(squares[~allowed]).all()
    assert np.isfinite(squares[allowed]).all()
    fit = fit_candidate(base, run.gap, candidate)
    assert fit.behaviour is not None
    assert np.isfinite(fit.delta_bic)
    point = np.array([[0.2, 2.0, 0.5]])
    assert not np.isfinite(_Search(base, run.gap, candidate)._try(point)[1].delta_bic)


def test_without_a_jump_in_reach_of_its_axes_a_law_is_no_candidate(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused = (effects.Axis(0.1, 0.2, 3), effects.Axis(1.0, 2.0, 3), effects.Axis(0.0, 0.9, 2))
    monkeypatch.setattr(type(law()), "axes", classmethod(lambda cls, seen: refused))
    run = FreeRun(loop(), join_records(loop(), [record]))
    found = plugged_candidates(run, [np.ones(len(record))])
    assert "stiction" not in {candidate.effect for candidate in found}


def test_gap_names_the_law_in_its_table_and_sentences(
    record: Record, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    run = FreeRun(loop(), join_records(loop(), [record]))
    assert PluggedValve.of(run, 0, type(law())).name == "valve:V1 stiction (falls_short)"
    assert called("valve:V1", "stiction", "xch") == "stiction (xch) of valve V1"
    xch = effects.XchStiction(2.0, 1.0)
    effect = FoundEffect(
        "valve:V1", xch, 50.0, closed=0.9, sentence="It gains 50 BIC over no effect"
    )
    assert (effect.to_dict()["effect"], effect.to_dict()["law"]) == ("stiction", "xch")
    found = find_discrepancy(loop(), [simulate(loop(), samples=300)], GapOptions(quick=True))
    _print_gap(dataclasses.replace(found, effects=(effect,)), "")
    shown = capsys.readouterr().out
    assert "stiction in valve V1 (law xch)" in shown


def test_the_true_reason_is_told_of_a_law_that_names_no_axes(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.setattr(type(law()), "axes", Behaviour.__dict__["axes"])
    found = find_discrepancy(loop(), [simulate(loop(), samples=300)], GapOptions(quick=True))
    told = {entry.law: entry.reason for entry in found.not_considered}
    assert told["falls_short"] == "it names no axes on which its figures are searched"
    assert told["kano"] == "stiction is searched by the laws he and xch"
    _print_gap(found, "")
    shown = capsys.readouterr().out
    assert f"valve stiction (falls_short): {told['falls_short']}" in shown
    assert f"(semi_physical): {told['kano']}" in shown


@dataclasses.dataclass(frozen=True)
class Bump(Behaviour):
    """A sensor that is off by ``height`` in every twentieth sample and the one after."""

    effect: ClassVar[str] = "bump"
    places: ClassVar[tuple[str, ...]] = ("sensor",)

    height: float = effects.parameter("height", "signal", "how far it is off")

    def rest(self, value: float) -> Any:
        return 0.0

    def step(self, memory: Any, value: float, time: float = 0.0) -> Any:
        return memory + 1.0, value + self.height * (memory % 20.0 < 2.0)

    @classmethod
    def axes(cls, seen: effects.Seen) -> tuple[effects.Axis, ...]:
        return (effects.Axis(-seen.span, seen.span, 3, linear=True),)


def test_the_interval_of_a_linear_figure_has_a_width() -> None:
    shown = simulate(loop().with_ideal_valves(), samples=400)
    bumps = Bump(1.0).simulate(shown.pv[:, 0])[:, None]
    model = loop().with_ideal_valves()
    run = FreeRun(model, join_records(model, [dataclasses.replace(shown, pv=bumps)]))
    base = Baseline.of(run)
    candidate = PluggedOutput.of(run, 0, "sensor", Bump, np.zeros(0))
    fit = fit_candidate(base, run.gap, candidate)
    low, high = likelihood_intervals(base, fit)["height"]
    assert fit.point[0] == pytest.approx(1.0, abs=0.1)
    assert low < fit.point[0] < high
    # About forty rows in each of four hundred tell it: their noise over their root.
    error = fit.noise[0].innovation_std / np.sqrt(40.0)
    assert 0.3 * 1.96 * error < 0.5 * (high - low) < 3.0 * 1.96 * error


def test_a_slip_that_falls_short_is_planned_by_its_jump_form() -> None:
    form = law().jump_form()  # type: ignore[attr-defined]
    for wanted in (52.0, 55.0, 46.0):
        reached, _ = law().step(50.0, form.op(50.0, wanted), 0.0)
        assert reached == pytest.approx(wanted)
    assert form.least == pytest.approx(0.7 * 2.5)


def test_a_figure_out_of_its_range_is_refused() -> None:
    with pytest.raises(InputError, match=r"use \[0, 0.9\]$"):
        law(1.5)
