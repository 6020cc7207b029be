"""Tucson and CSV files: laid out as the format asks, read by others, refused if misread."""

from __future__ import annotations

import warnings
from pathlib import Path

import dplpy
import numpy as np
import pandas as pd
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pandas.testing import assert_frame_equal

from forest.dendro import read_csv, read_rwl, short_ids, write_csv, write_rwl
from forest.errors import InputError


def wide(series: dict[str, tuple[int, list[float]]]) -> pd.DataFrame:
    """A wide frame of series, each with its first year."""
    columns = {
        name: pd.Series(widths, index=range(first, first + len(widths)), dtype=float)
        for name, (first, widths) in series.items()
    }
    frame = pd.DataFrame(columns)
    years = pd.RangeIndex(frame.index.min(), frame.index.max() + 1, name="Year")
    return frame.reindex(years)


def by_dplpy(path: Path) -> pd.DataFrame:
    """What dplPy reads, where it has nothing to complain of."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        frame = dplpy.readers(str(path), verbose=False)
    frame.attrs.clear()
    return frame


def test_tucson_by_hand(tmp_path):
    frame = wide(
        {
            "A1": (1998, [1.234, 0.0, 2.5]),
            "B2": (1987, [0.999, 9.999, 0.001]),  # the last year ends in 9
        }
    )
    path = write_rwl(frame, tmp_path / "two.rwl")
    assert path.read_text() == (
        "A1      1998  1234     0\n"
        "A1      2000  2500 -9999\n"
        "B2      1987   998  9999     1\n"
        "B2      1990 -9999\n"
    )


MARKERS = [0.999, 9.99, 9.999, 0.0, 0.998, 1.0, 99.999]
widths_mm = st.one_of(st.sampled_from(MARKERS), st.floats(0.0, 99.999))
some_series = st.lists(
    st.tuples(st.integers(1890, 1999), st.lists(widths_mm, min_size=1, max_size=25)),
    min_size=1,
    max_size=4,
)


@settings(max_examples=25, deadline=None)
@given(some_series)
@example([(1990, [0.999] * 10), (1981, MARKERS), (1979, [0.0])])
def test_others_read_what_was_written(tmp_path_factory, some):
    folder = tmp_path_factory.mktemp("files")
    names = short_ids([f"stand_7_tree_{k}" for k in range(len(some))])
    frame = wide(dict(zip(names, some, strict=True)))
    units = (1000.0 * frame).round()
    in_csv = units / 1000.0
    in_rwl = units.where(units != 999, 998) / 1000.0

    rwl, csv = write_rwl(frame, folder / "s.rwl"), write_csv(frame, folder / "s.csv")
    for read, expected in (
        (read_rwl(rwl), in_rwl),
        (by_dplpy(rwl), in_rwl),
        (read_csv(csv), in_csv),
        (by_dplpy(csv), in_csv),
    ):
        assert_frame_equal(read, expected, check_index_type=False, atol=1e-9, rtol=0)
    assert np.nanmax(np.abs(in_rwl - frame)) < 0.00151


def test_hundredths_of_a_millimetre_and_a_header(tmp_path):
    path = tmp_path / "old.rwl"
    path.write_text(
        "SITE  1 Somewhere                                    PCAB\n"
        "SITE  2 Saxony       Norway spruce    800  5040 01325          1997 2001\n"
        "OLD1    1997   123     0    57\n"
        "OLD1    2000     9   999\n"
        "NEW1    1998   999   999\n"  # 0.999 mm twice
        "NEW1    2000   999 -9999\n"
    )
    frame = read_rwl(path)
    assert frame["OLD1"].tolist()[:4] == [1.23, 0.0, 0.57, 0.09]
    assert frame["NEW1"].tolist()[1:] == [0.999, 0.999, 0.999]
    assert_frame_equal(
        frame, dplpy.readers(str(path), verbose=False), check_index_type=False, check_names=False
    )


def test_years_before_christ(tmp_path):
    frame = wide({"A": (-12, [1.0, 2.0, 3.0, 4.0])})
    path = write_rwl(frame, tmp_path / "old.rwl")
    assert_frame_equal(read_rwl(path), frame)
    assert_frame_equal(by_dplpy(path), frame, check_index_type=False)


def test_a_file_is_replaced_only_if_asked(tmp_path):
    frame = wide({"A": (2000, [1.0])})
    path = write_rwl(frame, tmp_path / "a.rwl")
    with pytest.raises(InputError, match="exists already"):
        write_rwl(frame + 1, path)
    assert read_rwl(path)["A"].tolist() == [1.0]
    write_rwl(frame + 1, path, overwrite=True)
    assert read_rwl(path)["A"].tolist() == [2.0]
    assert [p.name for p in tmp_path.iterdir()] == ["a.rwl"]


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (wide({"A": (2019, [1, 1, 1])}), "of 2021, after the present; .*start_year 1 years earl"),
        (wide({"A": (2000, [1, np.nan, 1])}), "'A' has a width of nan mm in 2001; .*0 for a miss"),
        (wide({"A": (2000, [1, -0.5])}), "'A' has a width of -0.5 mm in 2001"),
        (wide({"A": (2000, [np.inf])}), "'A' has a width of inf mm in 2000"),
        (wide({"A": (2000, [1]), "B": (2000, [np.nan])}), "series 'B' has no ring"),
        (wide({"A": (2000, [1]), "a": (2000, [1])}), "the same id"),
        (wide({"A_1": (2000, [1])}), "'A_1' is no id"),
        (wide({"A": (2000, [1, 2, 3])}).drop(index=2001), "years that follow"),
        (wide({"A": (2000, [1])}).drop(columns="A"), "no ring series"),
    ],
)
@pytest.mark.parametrize("write", [write_rwl, write_csv])
def test_refused_to_write(tmp_path, write, frame, message):
    with pytest.raises(InputError, match=message) as error:
        write(frame, tmp_path / "x", present_year=2020)
    assert "\n" not in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (wide({"LONGID1": (2000, [1])}), "'LONGID1' is too long; .*short_ids"),
        (wide({"A": (2000, [1, 100.0])}), "'A' has a width of 100 mm in 2001"),
        (wide({"A": (-1000, [1])}), "first year is -1000"),
    ],
)
def test_refused_in_tucson(tmp_path, frame, message):
    with pytest.raises(InputError, match=message):
        write_rwl(frame, tmp_path / "x.rwl")


def test_the_present_is_this_year(tmp_path):
    with pytest.raises(InputError, match="after the present"):
        write_rwl(wide({"A": (9000, [1.0])}), tmp_path / "x.rwl")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("A       2000  1000\n", "line 1: series 'A' ends with 1000; .*stop marker"),
        ("A       2000 -9999\n", "ends with -9999"),
        ("A       2000   -99 -9999\n", "a width of -99 in 2000"),
        ("A       2000 10 00 -9999\n", "no ring widths"),
        ("A       2000     1 -9999\nA       20x0\n", "line 2: no line of ring widths"),
        ("A       2009     1 -9999\n", "2 numbers from 2009 on; expected 1 to 1"),
        ("A       2008     1     2\nA       2011 -9999\n", "line 2: .*goes on in 2011; .*2010"),
        ("A       2008     1 -9999\nB       2008     1 -9999\nA       2010     1 -9999\n", "again"),
        ("", "no ring widths"),
    ],
)
def test_refused_to_read_tucson(tmp_path, text, message):
    path = tmp_path / "x.rwl"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_rwl(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no table"),
        ("Age,A\n1,2\n", "a column 'Year'"),
        ("Year,A\n2000,1\n2002,1\n", "do not follow each other"),
        ("Year,A\n2000,1\n2001,wide\n", "line 3: 'wide' in column 'A'"),
    ],
)
def test_refused_to_read_csv(tmp_path, text, message):
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_csv(path)


@pytest.mark.parametrize("read", [read_rwl, read_csv])
def test_a_file_that_is_not_there(tmp_path, read):
    with pytest.raises(InputError, match="no such file"):
        read(tmp_path / "none")
