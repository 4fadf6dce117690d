"""Clocks of exports: 12 hours, summer time, zones, words of months and halves of the day."""

import datetime
import re
import zoneinfo
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from stiction_ros.intake import Loop
from stiction_ros.intake.repairs import FORMS as FORMS_READ
from stiction_ros.intake.sheets.stamps import _month, is_stamp

from .exports import op, pv, said, text, write
from .exports import read as read_all

BERLIN = zoneinfo.ZoneInfo("Europe/Berlin")
AUTUMN = datetime.datetime(2024, 10, 27, 0, 0, tzinfo=datetime.UTC)  # 02:00 summer time
SPRING = datetime.datetime(2024, 3, 31, 0, 30, tzinfo=datetime.UTC)  # 01:30 winter time
BEFORE = datetime.datetime(2024, 10, 17, 6, 0, tzinfo=datetime.UTC)
STEP, ROWS = 60, 130

Stamp = Callable[[datetime.datetime], str]


def local(moment: datetime.datetime) -> str:
    return moment.astimezone(BERLIN).strftime("%Y-%m-%d %H:%M:%S")


def plain(moment: datetime.datetime) -> str:
    return moment.strftime("%Y-%m-%d %H:%M:%S")


def stamps(stamp: Stamp, begin: datetime.datetime, step: int = STEP, rows: int = ROWS) -> list[str]:
    return [stamp(begin + datetime.timedelta(seconds=step * k)) for k in range(rows)]


def wide(path: Path, times: Sequence[str]) -> Path:
    rows = [[f'"{t}"', str(op(k)), str(pv(k))] for k, t in enumerate(times)]
    return write(path / "a.csv", text(rows, ["Time", "FIC1.OP", "FIC1.PV"]))


def one_value_a_row(path: Path, times: Sequence[str]) -> Path:
    rows = [
        [f"FIC1.{name}", f'"{t}"', str(of(k))]
        for k, t in enumerate(times)
        for name, of in (("OP", op), ("PV", pv))
    ]
    return write(path / "a.csv", text(rows, ["Tag", "Timestamp", "Value"]))


def tag_by_tag(path: Path, times: Sequence[str]) -> Path:
    rows = [
        [f"FIC1.{name}", f'"{t}"', str(of(k))]
        for name, of in (("OP", op), ("PV", pv))
        for k, t in enumerate(times)
    ]
    return write(path / "a.csv", text(rows, ["Tag", "Timestamp", "Value"]))


def file_a_tag(path: Path, times: Sequence[str]) -> Path:
    for name, of in (("OP", op), ("PV", pv)):
        rows = [[f'"{t}"', str(of(k))] for k, t in enumerate(times)]
        write(path / "tags" / f"FIC1.{name}.csv", text(rows, ["Timestamp", "Value"]))
    return path / "tags"


FORMS = pytest.mark.parametrize("form", [wide, one_value_a_row, tag_by_tag, file_a_tag])
Form = Callable[[Path, Sequence[str]], Path]


def read(path: Path, **options: object) -> Loop:
    (loop,) = read_all(path, **options)
    return loop


def check(loop: Loop, rows: int = ROWS, step: float = STEP) -> None:
    assert loop.problem is None
    (record,) = loop.parts
    assert (len(record), record.sample_time) == (rows, step)
    np.testing.assert_allclose(record.op[:, 0], [op(k) for k in range(rows)], atol=1e-9)
    np.testing.assert_allclose(record.pv[:, 0], [pv(k) for k in range(rows)], atol=1e-9)


@FORMS
def test_twelve_hours_without_am_and_pm_are_refused(tmp_path: Path, form: Form) -> None:
    def half(moment: datetime.datetime) -> str:
        return moment.strftime("%Y-%m-%d %I:%M:%S")

    begin = datetime.datetime(2024, 5, 13, 6, 0, tzinfo=datetime.UTC)
    problem = str(read(form(tmp_path, stamps(half, begin, 600, 156))).problem)
    assert (
        "12 hours, without AM and PM: 2024-05-13 12:50:00 is followed by 2024-05-13 01" in problem
    )
    assert "2024-05-13 06:00:00 is there twice" in problem


def test_twelve_hours_that_go_over_midnight_alone_are_refused(tmp_path: Path) -> None:
    begin = datetime.datetime(2024, 5, 13, 22, 30, tzinfo=datetime.UTC)
    times = stamps(lambda moment: moment.strftime("%Y-%m-%d %I:%M:%S"), begin)
    problem = str(read(wide(tmp_path, times)).problem)
    assert "2024-05-13 11:59:00 is followed by 2024-05-14 12:00:00" in problem


def test_twelve_hours_of_times_of_the_day_alone(tmp_path: Path) -> None:
    begin = datetime.datetime(2024, 5, 13, 6, 0, tzinfo=datetime.UTC)
    times = stamps(lambda moment: moment.strftime("%I:%M:%S"), begin, 300)
    assert "12 hours, without AM and PM" in str(read(wide(tmp_path, times)).problem)
    times = stamps(lambda moment: moment.strftime("%I:%M:%S %p"), begin, 300)
    check(read(wide(tmp_path, times)), step=300)


@FORMS
def test_both_passes_of_autumn_are_kept(tmp_path: Path, form: Form) -> None:
    loop = read(form(tmp_path, stamps(local, AUTUMN)))
    check(loop)
    assert "the clock is set back by an hour at 2024-10-27 03:00:00" in said(loop)


@FORMS
def test_the_leap_of_spring_is_taken_back(tmp_path: Path, form: Form) -> None:
    loop = read(form(tmp_path, stamps(local, SPRING)))
    check(loop)
    assert "the clock is set forward by an hour at 2024-03-31 02:00:00" in said(loop)


@pytest.mark.parametrize("zone", ["Europe/Lisbon", "Europe/Helsinki", "America/Chicago"])
@pytest.mark.parametrize("month", [3, 10])
def test_other_calendars(tmp_path: Path, zone: str, month: int) -> None:
    info = zoneinfo.ZoneInfo(zone)
    day = {("America/Chicago", 3): 10, ("America/Chicago", 10): 34}.get(
        (zone, month), 31 - (month > 3) * 4
    )
    begin = datetime.datetime(2024, month, 1, tzinfo=info) + datetime.timedelta(days=day - 1)
    begin = begin.astimezone(datetime.UTC)
    times = stamps(lambda m: m.astimezone(info).strftime("%d.%m.%Y %H:%M:%S"), begin, 60, 300)
    loop = read(wide(tmp_path, times))
    check(loop, 300)
    assert "by an hour" in said(loop)


@pytest.mark.parametrize("days", [1, 7, -7, 40])
def test_an_hour_that_is_missing_elsewhere_stays_a_gap(tmp_path: Path, days: int) -> None:
    other = SPRING + datetime.timedelta(days=days)
    times = stamps(plain, other, rows=200)
    loop = read(wide(tmp_path, times[:30] + times[90:]))
    assert "clock" not in said(loop)
    assert len(loop.parts) == 2


def test_rows_within_the_hour_of_spring_tell_of_a_clock_that_does_not_change(
    tmp_path: Path,
) -> None:
    loop = read(wide(tmp_path, stamps(plain, SPRING, rows=200)))
    check(loop, 200)
    assert not loop.notes


@FORMS
@pytest.mark.parametrize("step", [60, 70])
def test_a_doubled_hour_that_is_sorted_is_refused(tmp_path: Path, form: Form, step: int) -> None:
    begin = AUTUMN - datetime.timedelta(minutes=30)
    loop = read(form(tmp_path, sorted(stamps(local, begin, step, 200))))
    assert (
        "the clock is set back by an hour at 2024-10-27 03:00:00, and the rows from 02:00"
        in str(loop.problem)
    )


@FORMS
def test_offsets_tell_the_passes_of_autumn_apart_as_the_error_says(
    tmp_path: Path, form: Form
) -> None:
    times = stamps(lambda m: m.astimezone(BERLIN).isoformat(" "), AUTUMN)
    loop = read(form(tmp_path, times))
    check(loop)
    assert "clock" not in said(loop)


@pytest.mark.parametrize("stamp", re.findall(r"(?<=[sr,] )\d[\w/. :-]*?(?=,| or)", FORMS_READ))
def test_every_form_that_the_error_names_is_read(stamp: str) -> None:
    zones = ("", " Z", " +02:00", " CET", " Europe/Berlin")
    assert all(is_stamp(stamp + zone) for zone in zones)


@FORMS
@pytest.mark.parametrize("style", ["{} [Europe/Berlin]", "{} Europe/Berlin", "{} (Europe/Berlin)"])
@pytest.mark.parametrize("begin", [AUTUMN, SPRING])
def test_names_of_zones(tmp_path: Path, form: Form, style: str, begin: datetime.datetime) -> None:
    loop = read(form(tmp_path, stamps(lambda m: style.format(local(m)), begin)))
    check(loop)
    assert loop.parts[0].start == begin.timestamp()


@pytest.mark.parametrize(
    "style", ["{} [UTC]", "{} (UTC)", "{}Z", "{} GMT+0", "{}+00:00[Europe/London]", "{} +0000"]
)
def test_zones_that_are_utc(tmp_path: Path, style: str) -> None:
    loop = read(wide(tmp_path, stamps(lambda m: style.format(plain(m)), AUTUMN)))
    check(loop)
    assert loop.parts[0].start == AUTUMN.timestamp()


@pytest.mark.parametrize("zone", ["", " [Europe/Berlin]"])
@pytest.mark.parametrize("far", ["0001-01-01 00:00:00", "9999-12-31 23:59:59"])
def test_the_least_and_the_largest_stamp_do_no_harm(tmp_path: Path, zone: str, far: str) -> None:
    times = [f"{t}{zone}" for t in [*stamps(plain, BEFORE), far]]
    assert read(wide(tmp_path, times)).problem is None


def test_a_zone_that_is_unknown_is_one_error(tmp_path: Path) -> None:
    times = stamps(lambda m: f"{plain(m)} [Europe/Belrin]", AUTUMN)
    assert "zone Europe/Belrin of the stamps is unknown" in str(read(wide(tmp_path, times)).problem)


@pytest.mark.parametrize("first", [0, 1])
def test_other_forms_beside_the_first(tmp_path: Path, first: int) -> None:
    def mixed(moment: datetime.datetime) -> str:
        form = "%Y-%m-%d %H:%M:%S" if (moment.minute + first) % 2 else "%d.%m.%Y %H:%M"
        return moment.strftime(form)

    check(read(wide(tmp_path, stamps(mixed, AUTUMN))))


@pytest.mark.parametrize("first", [0, 70])
def test_a_stamp_that_is_not_understood_is_named(tmp_path: Path, first: int) -> None:
    times = stamps(plain, AUTUMN)
    times[first] = "soon"
    loop = read(wide(tmp_path, times))
    assert "1 stamp of 130 not understood, the first: column Time is 'soon'" in said(loop)
    assert f"in line {first + 2}" in said(loop)
    assert "without a time" not in said(loop)
    strict = str(read(wide(tmp_path, times), strict=True).problem)
    assert (
        f"column Time is 'soon', neither seconds nor a stamp that is known, in line {first + 2}"
        in strict
    )


def test_a_stamp_that_is_empty_is_a_row_without_a_time(tmp_path: Path) -> None:
    times = stamps(plain, AUTUMN)
    times[70] = ""
    assert "1 row without a time left out" in said(read(wide(tmp_path, times)))


@FORMS
def test_many_stamps_that_are_not_understood_are_refused(tmp_path: Path, form: Form) -> None:
    times = [t.replace("-10-27 03", "-xyz-27 03") for t in stamps(local, AUTUMN)]
    problem = str(read(form(tmp_path, times)).problem)
    assert "10 stamps of 130 not understood, the first: column" in problem
    assert "is '2024-xyz-27 03:00:00'" in problem
    assert "write times as" in problem


MONTHS = {
    "en": "jan feb mar apr may jun jul aug sep oct nov dec",
    "de": "jan feb mär apr mai jun jul aug sept okt nov dez",
    "fr": "janv févr mars avr mai juin juil août sept oct nov déc",
    "it": "gen feb mar apr mag giu lug ago set ott nov dic",
    "es": "ene feb mar abr may jun jul ago sep oct nov dic",
    "pt": "jan fev mar abr mai jun jul ago set out nov dez",
    "nl": "jan feb mrt apr mei jun jul aug sep okt nov dec",
    "pl": "sty lut mar kwi maj cze lip sie wrz paź lis gru",
    "pl of": "stycznia lutego marca kwietnia maja czerwca lipca sierpnia września października "
    "listopada grudnia",
    "de whole": "Januar Februar März April Mai Juni Juli August September Oktober November "
    "Dezember",
    "fr whole": "janvier février mars avril mai juin juillet août septembre octobre novembre "
    "décembre",
}


@pytest.mark.parametrize("language", MONTHS)
def test_months(language: str) -> None:
    assert [_month(word) for word in MONTHS[language].split()] == list(range(1, 13))


def test_the_beginning_of_two_months_is_none() -> None:
    assert _month("jui") == 0


def test_words_and_a_number_are_no_date() -> None:
    assert not is_stamp("sample-and-12")


HALVES = [
    ("AM", "PM"),
    ("a. m.", "p. m."),
    ("a.m.", "p.m."),
    ("vorm.", "nachm."),
    ("\u202fam", "\u202fpm"),
]
ZONES = {"": "UTC", " UTC": "UTC", " [Europe/Rome]": "Europe/Rome", " (CET)": "Etc/GMT-1"}
DATES = [
    "{y}-{m:02d}-{d:02d}", "{y}-{m}-{d}", "{y}/{m:02d}/{d:02d}", "{d:02d}.{m:02d}.{y}",
    "{d}.{m}.{y}",
    "{d:02d}/{m:02d}/{y}", "{m}/{d}/{y}", "{d}-{name}-{y}", "{d} {name} {y}", "{d}. {name} {y}",
    "{name} {d}, {y}", "{d:02d}-{name}.-{y}", "{y}{m:02d}{d:02d}", "{d} de {name} de {y}",
]  # fmt: skip


@settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    begin=st.datetimes(datetime.datetime(1999, 1, 1), datetime.datetime(2030, 1, 1)),
    step=st.sampled_from([1, 7, 60, 900]),
    date=st.sampled_from(DATES),
    clock=st.sampled_from(["{h:02d}:{n:02d}:{s:02d}", "{h}:{n}:{s}", "{i}:{n:02d}:{s:02d} {half}"]),
    language=st.sampled_from(sorted(MONTHS)),
    halves=st.sampled_from(HALVES),
    zone=st.sampled_from(sorted(ZONES)),
)
def test_stamps_are_read_as_they_are_or_refused(
    tmp_path: Path,
    begin: datetime.datetime,
    step: int,
    date: str,
    clock: str,
    language: str,
    halves: tuple[str, str],
    zone: str,
) -> None:
    info = zoneinfo.ZoneInfo(ZONES[zone])
    names = MONTHS[language].split()

    def stamp(moment: datetime.datetime) -> str:
        t = moment.astimezone(info)
        fields = {"y": t.year, "m": t.month, "d": t.day, "h": t.hour, "n": t.minute, "s": t.second}
        words = {"name": names[t.month - 1], "half": halves[t.hour >= 12], "i": t.hour % 12 or 12}
        return f"{date} {clock}".format(**fields, **words) + zone

    first = begin.replace(microsecond=0, tzinfo=datetime.UTC)
    loop = read(wide(tmp_path, stamps(stamp, first, step)))
    if loop.problem is not None:
        asked = "may begin with the day" in loop.problem and "--dates" in loop.problem
        assert asked or "is set back" in loop.problem
        return
    check(loop, step=step)
    assert loop.parts[0].start == first.timestamp()
