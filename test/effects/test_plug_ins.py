"""A law and an effect in one file each, taken through all that knows behaviours."""

import dataclasses
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stiction_ros import effects
from stiction_ros.config_files import find_config
from stiction_ros.control import ControlMode, MpcController
from stiction_ros.control_settings import ControlSettings
from stiction_ros.discrepancy import GapOptions, find_discrepancy
from stiction_ros.discrepancy.data.controller_check import ControllerStatus
from stiction_ros.discrepancy.data.gate import SHOWN
from stiction_ros.effects import Behaviour, behaviours, discovery
from stiction_ros.errors import InputError
from stiction_ros.identification import IdentificationOptions, VerdictKind, identify
from stiction_ros.identification.friction import find_law, first_values, laws
from stiction_ros.loop import LoopModel, SetPoints, simulate
from stiction_ros.online.handover.known_friction import frictions_of
from stiction_ros.records.record import Record

LAW = Path(__file__).resolve().parents[2] / "examples" / "10_add_a_friction_law.py"
EFFECT = '''
"""A positioner that overdoes every move."""

import dataclasses
from typing import ClassVar

from stiction_ros.effects import Axis, Behaviour, parameter


@dataclasses.dataclass(frozen=True)
class Kick(Behaviour):
    """Adds ``share`` of the last move to the stem, for one sample."""

    effect: ClassVar[str] = "kick"
    places: ClassVar[tuple[str, ...]] = ("valve",)
    experiment: ClassVar[str] = "move OP fast"

    share: float = parameter("share", "1", "share of the move", low=0.0)

    def step(self, memory, value, time):
        return value, value + self.share * (value - memory)

    @classmethod
    def axes(cls, seen):
        return (Axis(0.1, 6.0, 12, logarithmic=True),)
'''


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder with both files, known while this module is tested."""
    path = tmp_path_factory.mktemp("own")
    (path / "lopsided.py").write_text(LAW.read_text(encoding="utf-8"), encoding="utf-8")
    (path / "kick.py").write_text(EFFECT, encoding="utf-8")
    import stiction_ros.effects.own as own

    before, modules = list(own.__path__), set(sys.modules)
    own.__path__.append(str(path))
    discovery._found.cache_clear()
    yield path
    own.__path__[:] = before
    discovery._found.cache_clear()
    for name in set(sys.modules) - modules:
        if name.startswith("stiction_ros.effects.own."):
            del sys.modules[name]


def loop() -> LoopModel:
    return LoopModel.load(find_config("flow.loop.yaml"))


def record_of(model: LoopModel, samples: int = 700) -> Record:
    moves = SetPoints.load(find_config("flow.set_points.yaml"), model.outputs)
    return simulate(model, moves, samples=samples)


def lopsided() -> Behaviour:
    return effects.from_mapping(
        {"effect": "stiction", "law": "lopsided", "f_s": 4.0, "f_d": 1.5, "closing": 1.4}
    )


@pytest.mark.usefixtures("folder")
def test_the_law_is_simulated_and_survives_yaml() -> None:
    model = loop().with_valve_effects({"V1": (lopsided(),)})
    again = LoopModel.from_yaml(model.to_yaml())
    assert again.valves[0].effects == (lopsided(),)
    assert frictions_of(again, ("V1",)) == (lopsided(),)
    record = record_of(again, 300)
    assert record.stem is not None
    assert np.any(record.stem != record.op)


@pytest.mark.usefixtures("folder")
def test_the_exact_search_refuses_a_law_whose_patterns_it_does_not_know() -> None:
    record = record_of(loop().with_valve_effects({"V1": (lopsided(),)}), 450)
    with pytest.raises(InputError, match=r"law: .*'lopsided'.*evidence"):
        identify(record, IdentificationOptions(law="lopsided", method="exact"))


@pytest.mark.trial
@pytest.mark.usefixtures("folder")
def test_all_three_parameters_are_identified_and_nothing_is_certified() -> None:
    record = record_of(loop().with_valve_effects({"V1": (lopsided(),)}), 450)
    found = identify(record, IdentificationOptions(law="lopsided"))
    valve = found.valves[0]
    assert valve.verdict is VerdictKind.STICKY
    assert valve.static_friction == pytest.approx(4.0, abs=0.2)
    assert valve.dynamic_friction == pytest.approx(1.5, abs=0.1)
    assert valve.further["closing"] == pytest.approx(1.4, abs=0.06)
    low, high = valve.further_intervals["closing"]
    assert low <= 1.4 <= high
    assert valve.to_dict()["closing_interval"] == [low, high]
    law = valve.behaviour()
    assert law is not None
    assert law.to_mapping()["closing"] == valve.further["closing"]
    assert not [note for note in found.notes if "enumerated round" in note]


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("mode", [ControlMode.EMBEDDING, ControlMode.INVERSION])
def test_no_controller_plans_for_a_law_without_a_jump_form(mode: ControlMode) -> None:
    with pytest.raises(InputError, match=r"lopsided.*has no jump form"):
        MpcController(ControlSettings().design(loop()), mode, [lopsided()])


@pytest.mark.trial
@pytest.mark.usefixtures("folder")
def test_gap_finds_the_effect_and_says_that_the_law_was_not_considered() -> None:
    kick = effects.from_mapping({"effect": "kick", "share": 2.0})
    truth = loop().with_effect("valve:V1", kick)
    found = find_discrepancy(loop(), [record_of(truth)], GapOptions(quick=True))
    (effect,) = found.effects
    assert (effect.place, effect.effect, effect.alternatives) == ("valve:V1", "kick", ())
    assert effect.parameters["share"] == pytest.approx(2.0, abs=0.2)
    assert found.model_after.valves[0].effects[-1].effect == "kick"
    listed = {entry["law"]: entry for entry in found.to_dict()["not_considered"] if "law" in entry}
    assert listed["lopsided"]["reason"]
    assert "kick" not in {entry["effect"] for entry in found.to_dict()["not_considered"]}


def test_a_folder_of_the_environment_is_known_to_every_process(folder: Path) -> None:
    code = "from stiction_ros.effects import behaviours; print(*(k.effect for k in behaviours()))"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"STICTION_EFFECTS": str(folder)},
        check=True,
        capture_output=True,
        text=True,
    )
    assert "kick" in done.stdout.split()


def test_an_entry_point_is_known(tmp_path: Path) -> None:
    (tmp_path / "toy_kick.py").write_text(EFFECT, encoding="utf-8")
    about = tmp_path / "toy-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: toy\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text("[stiction_ros.effects]\ntoy = toy_kick\n")
    code = "from stiction_ros.effects import about; print(about('kick').__module__)"
    paths = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"PYTHONPATH": paths},
        check=True,
        capture_output=True,
        text=True,
    )
    assert done.stdout.split() == ["toy_kick"]


def test_two_effects_of_one_name_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(discovery, "_registered", [])

    @dataclasses.dataclass(frozen=True)
    class Other(effects.Backlash):
        """Another backlash."""

    with pytest.raises(InputError, match="there twice"):
        effects.register(Other)


def test_a_folder_that_is_not_there_is_told(tmp_path: Path) -> None:
    code = "from stiction_ros.effects import behaviours; behaviours()"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"STICTION_EFFECTS": str(tmp_path / "nowhere")},
        capture_output=True,
        text=True,
    )
    assert done.returncode
    assert "no such folder" in done.stderr


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("def step(:\n    pass\n", 1, "SyntaxError: invalid syntax"),
        ("from typing import ClassVar\n\nraise KeyError('what')\n", 3, "KeyError: 'what'"),
        ("import no_such_module\n", 1, "ModuleNotFoundError: No module named 'no_such_module'"),
    ],
)
def test_a_file_that_cannot_be_loaded_is_told_in_one_line(
    tmp_path: Path, text: str, line: int, said: str
) -> None:
    (tmp_path / "broken.py").write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "stiction_ros.cli.main", "identify", "x.csv", "--law", "he"],
        env=os.environ | {"STICTION_EFFECTS": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert done.stderr == (
        f"stiction: {tmp_path / 'broken.py'}, line {line}: it cannot be loaded ({said}); mend the "
        "file, or take it out of the folder that STICTION_EFFECTS lists\n"
    )


def test_a_law_derived_from_another_is_not_taken_for_it() -> None:
    class Sluggish(effects.HeStiction):
        def step(self, memory: Any, value: float, time: float = 0.0) -> Any:
            return super().step(memory, value - 1.0, time)

    law = Sluggish(4.0, 1.0)
    assert Sluggish.switching is None
    assert law.jump_form() is None
    u = 10.0 * np.sin(np.arange(50) / 5.0)
    stems = Sluggish.simulate_grid(np.array([[4.0, 1.0]]), u, 0.0)
    assert stems[:, 0].tolist() == law.simulate(u, 0.0).tolist()


# -- every behaviour and every consumer ---------------------------------------------------------


@pytest.mark.usefixtures("folder")
def test_identify_knows_every_law_or_says_why_not() -> None:
    for kind in behaviours():
        if kind.effect != effects.Stiction.effect:
            continue
        assert kind.law is not None
        if kind.law in laws():
            assert find_law(kind.law) is kind
        else:
            with pytest.raises(InputError, match=r"is not identified: .{10}"):
                find_law(kind.law)


@pytest.mark.usefixtures("folder")
def test_control_plans_for_every_law_or_says_why_not() -> None:
    for kind in behaviours():
        if not issubclass(kind, effects.FrictionPair | effects.SlipJumpPair):
            continue
        own = kind.rows_of_frictions(np.array([[4.0, 1.5]]))[0].tolist()
        law = kind(*own, *first_values(kind))
        if law.jump_form() is None:
            with pytest.raises(InputError, match="has no jump form"):
                MpcController(ControlSettings().design(loop()), ControlMode.INVERSION, [law])
        else:
            form = law.jump_form()
            assert form is not None
            assert form.static_friction == pytest.approx(4.0)
            raised = form.raised(6.0)
            assert (raised.static_friction, raised.dynamic_friction) == pytest.approx((6.0, 1.5))


@pytest.mark.usefixtures("folder")
def test_gap_considers_every_behaviour_or_lists_it() -> None:
    found = find_discrepancy(loop(), [record_of(loop(), 500)], GapOptions(quick=True))
    listed = {(entry.place, entry.effect, entry.law) for entry in found.not_considered}
    tried = found.looks[0].scores.candidates
    keys = {(place.partition(":")[0], name) for c in tried for place, name in c.keys}
    by_data = {"tuning", "time_shift"}
    assert found.controller.status is not ControllerStatus.NOT_ASKED
    for kind in behaviours():
        for place in kind.places:
            searched = (place, kind.effect) in keys
            otherwise = kind in SHOWN or kind.effect in by_data or kind is effects.Offset
            assert searched or otherwise or (place, kind.effect, kind.law) in listed
            if searched and kind.law is not None and kind.law not in ("he", "xch", "cubic"):
                assert (place, kind.effect, kind.law) in listed
    assert all(len(entry.reason) > 10 for entry in found.not_considered)
