import csv
import dataclasses
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from made import entry, identification, record, unreadable

from stiction_ros.errors import InputError
from stiction_ros.intake.loop import Loop
from stiction_ros.survey.assess import Assessed, failed
from stiction_ros.survey.engines.engine import Task
from stiction_ros.survey.entry import Entry, Status, SurveyOptions
from stiction_ros.survey.listing.tables import HEAD, write_csv, write_xlsx
from stiction_ros.survey.survey import Plan, survey

KEYS = {
    *("name", "files", "status", "reason", "samples", "sample_time", "auto_share"),
    *("saturated_share", "oscillation", "verdict", "cause", "f_s", "f_s_interval", "f_d"),
    *("f_d_interval", "band_share", "travel_per_hour", "reversals_per_hour", "gain", "rank"),
    *("probability", "group", "report"),
}


GAIN_IN_LIST = {"now": {"iae_per_hour": 2.0}, "service": {"iae_per_hour": 0.5, "note": ""}}


class Counting:
    """An engine that judges nothing and counts what it was given."""

    name = "counting"
    workers = 1

    def __init__(self, stop_after: int | None = None) -> None:
        self.given: list[str] = []
        self.closed = False
        self._stop = stop_after

    def run(self, tasks: Iterator[Task], options: SurveyOptions) -> Iterator[tuple[Task, Assessed]]:
        for task in tasks:
            if self._stop is not None and len(self.given) == self._stop:
                raise KeyboardInterrupt
            self.given.append(task.loop.name)
            found = dataclasses.replace(entry(task.loop.name), files=())
            yield task, Assessed(found, f"<p>{task.loop.name}</p>", ("a decision",))

    def close(self) -> None:
        self.closed = True


def _loops(count: int) -> list[Loop]:
    return [unreadable(k) for k in range(count)]


def test_the_json_has_the_keys_of_the_contract(tmp_path: Path) -> None:
    found = survey(_loops(3), Plan(SurveyOptions(), tmp_path), Counting())
    document = json.loads(json.dumps(found.to_dict()))
    assert {"engine", "workers", "seconds", "loops_per_minute", "loops"} <= set(document)
    for row in document["loops"]:
        assert set(row) >= KEYS
    assert [row["rank"] for row in document["loops"]] == [1, 2, 3]
    for row in document["loops"]:
        assert (tmp_path / row["report"]).read_text() == f"<p>{row['name']}</p>"
    assert (tmp_path / "survey.log").read_text().count("a decision") == 3


def test_a_survey_that_was_broken_off_goes_on_where_it_was(tmp_path: Path) -> None:
    plan = Plan(SurveyOptions(), tmp_path)
    first = Counting(stop_after=4)
    with pytest.raises(KeyboardInterrupt):
        survey(_loops(10), plan, first)
    assert first.closed
    with (tmp_path / "loops.jsonl").open("a") as journal:
        journal.write('{"key": "half a li')
    second = Counting()
    found = survey(_loops(10), dataclasses.replace(plan, resume=True), second)
    assert len(found.entries) == 10
    assert len(second.given) == 6
    assert not set(first.given) & set(second.given)
    third = Counting()
    again = survey(_loops(10), dataclasses.replace(plan, resume=True), third)
    assert third.given == []
    assert again.entries == found.entries


class Losing(Counting):
    """An engine whose worker dies with one loop."""

    def run(self, tasks: Iterator[Task], options: SurveyOptions) -> Iterator[tuple[Task, Assessed]]:
        for task, found in super().run(tasks, options):
            ended = task.loop.name == "FIC001"
            yield task, failed(task.loop, "its worker ended", again=True) if ended else found


def test_a_loop_whose_worker_died_is_tried_again(tmp_path: Path) -> None:
    plan = Plan(SurveyOptions(), tmp_path)
    first = survey(_loops(4), plan, Losing())
    assert [e.name for e in first.entries if e.status is Status.FAILED] == ["FIC001"]
    engine = Counting()
    again = survey(_loops(4), dataclasses.replace(plan, resume=True), engine)
    assert engine.given == ["FIC001"]
    assert {e.status for e in again.entries} == {Status.OK}


def test_a_folder_that_holds_a_survey_is_not_written_over(tmp_path: Path) -> None:
    survey(_loops(2), Plan(SurveyOptions(), tmp_path), Counting())
    before = (tmp_path / "loops.jsonl").read_bytes()
    with pytest.raises(InputError, match="holds a survey; --resume goes on"):
        survey(_loops(2), Plan(SurveyOptions(), tmp_path), Counting())
    assert (tmp_path / "loops.jsonl").read_bytes() == before


def test_other_options_do_not_go_on_with_it(tmp_path: Path) -> None:
    survey(_loops(1), Plan(SurveyOptions(), tmp_path), Counting())
    other = Plan(SurveyOptions(gain=False), tmp_path, resume=True)
    with pytest.raises(InputError, match="other options"):
        survey(_loops(1), other, Counting())
    with pytest.raises(InputError, match="--out"):
        survey(_loops(1), Plan(SurveyOptions(), resume=True), Counting())


def test_names_of_loops_make_names_of_files(tmp_path: Path) -> None:
    names = ["../../etc/x", "A/B", "A B", "…"]
    loops = [dataclasses.replace(unreadable(1), name=name) for name in names]
    found = survey(loops, Plan(SurveyOptions(), tmp_path), Counting())
    pages = [(tmp_path / (e.report or "")).resolve() for e in found.entries]
    assert len(set(pages)) == 4
    assert all(page.parent == (tmp_path / "loops").resolve() for page in pages)


def test_an_entry_survives_json() -> None:
    one = entry("FIC1", beats=(1.0, 2.5), notes=("a", "b"), gain={"now": {"amplitude": None}})
    assert Entry.from_line(json.loads(json.dumps(dataclasses.asdict(one)))) == one


def test_the_tables_hold_the_list(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    rows = [
        entry('FIC "1", ü', rank=1, gain=GAIN_IN_LIST),
        dataclasses.replace(entry("B<&>"), verdict=None, reason="=1+1", f_s_interval=None, rank=2),
    ]
    write_csv(tmp_path / "l.csv", rows)
    write_xlsx(tmp_path / "l.xlsx", rows)
    with (tmp_path / "l.csv").open(encoding="utf-8-sig", newline="") as file:
        read = list(csv.reader(file))
    assert tuple(read[0]) == HEAD
    assert read[1][HEAD.index("loop")] == 'FIC "1", ü'
    assert float(read[1][HEAD.index("|PV−SP| now")]) == 2.0
    assert float(read[1][HEAD.index("|PV−SP| after service %")]) == -75.0
    assert read[1][HEAD.index("cycles by")] == "its valve"
    sheet = openpyxl.load_workbook(tmp_path / "l.xlsx")["loops"]
    values = list(sheet.values)
    assert tuple(values[0]) == HEAD
    assert values[2][HEAD.index("loop")] == "B<&>"
    assert values[2][HEAD.index("reason")] == "'=1+1"
    assert sheet.cell(3, HEAD.index("reason") + 1).data_type != "f"
    assert values[1][HEAD.index("f_S low")] == 1.8
    assert values[2][HEAD.index("f_S low")] is None


def test_identification_and_record_of_the_tests_fit() -> None:
    of = record()
    assert identification(of).to_dict()["valves"][0]["verdict"] == "sticky"
