import dataclasses
import itertools
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
from as_given import read_csv_parts
from hypothesis import given
from hypothesis import strategies as st

from stiction_ros.errors import InputError
from stiction_ros.records.bag.messages import read_raw
from stiction_ros.records.csv_writer import write_csv
from stiction_ros.records.parts import joined, longest_part
from stiction_ros.records.record import Gap, Quality, Record, Segment
from stiction_ros.records.run.loop_runs import read_bag_parts

G, H, B, M = Quality.GOOD, Quality.HELD, Quality.BAD, Quality.MANUAL


def record(
    mask: list[Quality] | None = None, gaps: tuple[Gap, ...] = (), count: int = 10
) -> Record:
    rows = np.arange(float(count))[:, None]
    quality = None if mask is None else np.array(mask, dtype=np.uint8)
    return Record("r", 2.0, ("V",), ("P",), rows, rows + 100.0, start=5.0, mask=quality, gaps=gaps)


def test_a_plain_record_is_one_good_segment_and_its_mask_takes_no_room() -> None:
    plain = record()
    assert plain.segments == (Segment(0, 10, 5.0),)
    assert plain.quality.tolist() == [G] * 10
    assert plain.quality.strides == (0,)
    assert plain.good_parts() == (plain,)
    assert plain.filled() is plain
    assert record([G] * 10).mask is None


def test_time_jumps_at_a_gap_and_falls_back_where_a_run_begins() -> None:
    found = record(gaps=(Gap(4, 105.0), Gap(8, 5.0)))
    assert found.segments == (Segment(0, 4, 5.0), Segment(4, 8, 105.0), Segment(8, 10, 5.0))
    assert found.time.tolist() == [0, 2, 4, 6, 100, 102, 104, 106, 0, 2]


def test_a_part_keeps_its_place_on_the_clock() -> None:
    found = record([G, H, B, M, G, G, G, G, G, G], (Gap(4, 105.0), Gap(8, 200.0)))
    part = found.part(5, 10)
    assert (part.start, part.segments) == (107.0, (Segment(0, 3, 107.0), Segment(3, 5, 200.0)))
    assert part.mask is None
    assert found.part(1, 4).quality.tolist() == [H, B, M]
    assert found.part(4, 8).segments == (Segment(0, 4, 105.0),)
    assert found.part(8, 10).start == 200.0


def test_only_bad_samples_may_be_nan() -> None:
    pv = np.arange(3.0)[:, None]
    pv[1] = np.nan
    whole = record(count=3)
    mask = np.array([G, B, G], dtype=np.uint8)
    assert np.isnan(dataclasses.replace(whole, pv=pv, mask=mask).pv[1, 0])
    for quality in (G, H, M):
        mask[1] = quality
        with pytest.raises(InputError, match="pv is not finite at sample 1"):
            dataclasses.replace(whole, pv=pv, mask=mask)


@pytest.mark.parametrize(
    ("mask", "gaps", "words"),
    [
        ([G] * 9, (), "no quality for each of 10 samples"),
        ([7] * 10, (), "no quality for each of 10 samples"),
        (None, (Gap(0, 1.0),), r"gaps at samples \[0\] of 10"),
        (None, (Gap(10, 1.0),), r"gaps at samples \[10\] of 10"),
        (None, (Gap(5, 99.0), Gap(5, 199.0)), r"gaps at samples \[5, 5\] of 10"),
    ],
)
def test_what_does_not_fit_is_refused(
    mask: list[Quality] | None, gaps: tuple[Gap, ...], words: str
) -> None:
    with pytest.raises(InputError, match=words):
        record(mask, gaps)


records = st.integers(2, 30).flatmap(
    lambda count: st.builds(
        lambda mask, rows, jumps: record(
            mask,
            tuple(
                Gap(row, 5.0 + 2.0 * row + 2.0 * sum(jumps[: k + 1]))
                for k, row in enumerate(sorted(rows))
            ),
            count,
        ),
        st.lists(st.sampled_from(Quality), min_size=count, max_size=count),
        st.sets(st.integers(1, count - 1), max_size=4),
        st.lists(st.integers(6, 30), min_size=4, max_size=4),
    )
)


@given(records)
def test_segments_cover_every_sample_once_and_usable_rows_all_that_is_usable(found: Record) -> None:
    covered = [row for first, last, _ in found.segments for row in range(first, last)]
    assert covered == list(range(len(found)))
    usable = [row for first, last in found.usable_rows() for row in range(first, last)]
    assert usable == np.flatnonzero(np.isin(found.quality, [G, H])).tolist()
    borders = {gap.row for gap in found.gaps}
    for first, last in found.usable_rows():
        assert not borders & set(range(first + 1, last))
    for part in found.good_parts():
        assert part.segments == (Segment(0, len(part), part.start),)


@given(records, st.data())
def test_a_part_of_a_part_is_a_part(found: Record, data: st.DataObject) -> None:
    count = len(found)
    a = data.draw(st.integers(0, count - 1))
    d = data.draw(st.integers(a + 1, count))
    b = data.draw(st.integers(a, d - 1))
    c = data.draw(st.integers(b + 1, d))
    once, twice = found.part(b, c), found.part(a, d).part(b - a, c - a)
    assert once.segments == twice.segments
    assert once.quality.tolist() == twice.quality.tolist()
    np.testing.assert_array_equal(once.op, twice.op)
    np.testing.assert_allclose(once.time + once.start, (found.time + found.start)[b:c])


@given(records)
def test_filled_has_every_sample_at_its_time(found: Record) -> None:
    filled, rows = found.filled(), found.filled_rows()
    assert filled.segments == (Segment(0, len(filled), found.start),)
    np.testing.assert_array_equal(filled.pv[rows], found.pv)
    np.testing.assert_array_equal(filled.quality[rows], found.quality)
    others = np.setdiff1d(np.arange(len(filled)), rows)
    assert (filled.quality[others] == B).all()
    assert np.isnan(filled.op[others]).all()
    wide = max((after - before for before, after in itertools.pairwise(rows)), default=1)
    if wide <= len(found):  # no gap was shortened
        np.testing.assert_allclose(filled.time[rows], found.time)


@given(records)
def test_parts_joined_are_the_record(found: Record) -> None:
    pieces = [found.part(first, last) for first, last, _ in found.segments]
    again = joined(pieces)
    assert again.segments == found.segments
    assert again.quality.tolist() == found.quality.tolist()
    np.testing.assert_array_equal(again.pv, found.pv)


@given(st.lists(st.sampled_from(Quality), min_size=3, max_size=30))
def test_the_mask_goes_through_a_csv_file(mask: list[Quality]) -> None:
    found = record(mask, count=len(mask))
    pv = found.pv.copy()
    pv[np.array(mask) == B] = np.nan
    found = dataclasses.replace(found, pv=pv)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "r.csv"
        write_csv(found, path)
        (again,) = read_csv_parts(path)
    np.testing.assert_array_equal(again.pv, found.pv)
    np.testing.assert_array_equal(again.op, found.op)
    assert again.quality.tolist() == found.quality.tolist()


def test_a_column_of_a_historian_called_quality_is_no_mask(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("t,OP,PV,QUALITY\n0,1,2,Good\n1,1,2,192\n2,1,2,good\n")
    (found,) = read_csv_parts(path)
    assert found.mask is None


def test_parts_with_another_sample_time_or_signals_are_told() -> None:
    rows = np.ones((5, 1))
    other = Record("r", 0.5, ("V",), ("P",), rows, rows, start=100.0)
    known = dataclasses.replace(record(), sp=np.ones((10, 1)))
    late = dataclasses.replace(record(), start=300.0)
    found = joined([known, other, late])
    assert [s.start for s in found.segments] == [5.0, 300.0]
    assert found.sp is None
    assert found.notes == (
        "1 part with another sample time than 2 s left out",
        "sp is not known in every part, left out",
    )


def test_the_longest_good_part_is_named() -> None:
    first = record([G, G, B, G, H, G, M, G, G, G])
    found = longest_part([first, dataclasses.replace(record(count=2), start=99.0)])
    assert (found.start, len(found)) == (11.0, 3)
    assert found.notes == (
        "only the longest good part is looked at: 11 s to 15 s, 3 of 12 samples; 75.0% of the "
        "samples, in 3 other good parts or not good, are left out",
    )
    with pytest.raises(InputError, match="has no good samples"):
        longest_part([record([B] * 10)])
    assert longest_part([record()]).notes == ()


def test_gaps_and_runs_go_through_a_bag(tmp_path: Path) -> None:
    pytest.importorskip("sensor_msgs", reason="the definitions of sensor_msgs are not installed")
    from stiction_ros.records.run.record_to_bag import write_bag

    found = record(gaps=(Gap(20, 105.0), Gap(40, 5.0)), count=60)
    write_bag(found, tmp_path / "bag")
    parts = read_bag_parts(tmp_path / "bag")
    assert joined(parts).segments == found.segments
    np.testing.assert_array_equal(joined(parts).op, found.op)
    times = [raw.log_time for raw in read_raw(tmp_path / "bag")]
    assert times == sorted(times)


def test_a_csv_file_holds_gaps_but_one_run_only(tmp_path: Path) -> None:
    found = record(gaps=(Gap(20, 105.0),), count=40)
    write_csv(found, tmp_path / "r.csv")
    assert joined(read_csv_parts(tmp_path / "r.csv")).segments == found.segments
    with pytest.raises(InputError, match="holds several runs"):
        write_csv(record(gaps=(Gap(5, 5.0),)), tmp_path / "s.csv")


def test_the_part_that_is_kept_is_told_by_its_dates() -> None:
    first = dataclasses.replace(record(count=4), start=1.7e9)
    second = dataclasses.replace(record(count=2), start=1.7e9 + 100.0)
    (note,) = longest_part([first, second]).notes
    assert re.search(r"at: 2023-11-14 22:13:20 to 2023-11-14 22:13:\d\d, 4 of 6", note), note
