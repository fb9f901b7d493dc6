"""Text as recorders write it, and clocks that repeat, wrap or restart: small twins of files that were refused or shifted."""

import os
from pathlib import Path

import numpy as np
import pytest

from airtruth.errors import LogError, StoreError
from airtruth.foreign.text import WHITESPACE, TextFormat, read_text
from airtruth.importers.clock import increasing
from airtruth.importers.convert import convert
from airtruth.importers.mapping import MappingFile
from airtruth.importers.sources import Place, Source, column, open_source

T = np.arange(40) * 0.02
ROWS = np.column_stack([T, np.sin(T), 20.0 + T])
FIELD = Path(os.environ.get("AIRTRUTH_FIELD", "/nowhere"))


def table(*head, delimiter=",", end="\n"):
    rows = [delimiter.join(f"{x:.5f}" for x in row) for row in ROWS]
    return end.join([*head, *rows]) + end


def read(folder, content, delimiter=",", **layout):
    path = folder / "f.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_text(path, TextFormat(delimiter, **layout))


def holds_the_rows(source, names):
    assert list(source.arrays) == names
    np.testing.assert_allclose(np.column_stack(list(source.arrays.values())), ROWS, atol=1e-5)


def test_a_row_of_units(tmp_path):
    source = read(tmp_path, table("time,alpha,tas", "s,deg,m/s"))
    holds_the_rows(source, ["time", "alpha", "tas"])
    assert source.units == {"time": "s", "alpha": "deg", "tas": "m/s"}
    assert source.line(0) == 3


@pytest.mark.parametrize(
    "head",
    ["time [s]  alpha [rad]  Va [m / s]", "time [s] alpha [rad] Va [m / s]", '"time [s]" "alpha [rad]" "Va [m / s]"'],
)  # fmt: skip
def test_units_in_a_header_between_blanks_do_not_shift_the_names(tmp_path, head):
    source = read(tmp_path, table(head, delimiter=" "), WHITESPACE)
    holds_the_rows(source, ["time [s]", "alpha [rad]", "Va [m / s]"])
    values, name = column(source, Place(column="alpha"))
    assert name == "alpha [rad]"
    np.testing.assert_allclose(values, np.sin(T), atol=1e-5)


def test_prose_before_the_names(tmp_path):
    head = [
        "Data file: flight 7",
        "3 variables with 40 values each",
        "",
        "  TIME  ALPHA  TAS",
        "  S  DEG  M/S",
    ]
    source = read(tmp_path, table(*head, delimiter=" "), WHITESPACE)
    holds_the_rows(source, ["TIME", "ALPHA", "TAS"])
    assert source.units == {"TIME": "S", "ALPHA": "DEG", "TAS": "M/S"}
    assert source.notes == ("f.txt: 2 lines before the names of the columns were left out",)
    assert source.line(0) == 6


def test_comments_before_and_in_the_table_keep_the_numbers_of_lines(tmp_path):
    text = table("# one", "Flight of today", "# two", "t,a,v").replace("0.02000,", "# three\n0.02000,", 1)
    source = read(tmp_path, text)
    holds_the_rows(source, ["t", "a", "v"])
    assert [source.line(0), source.line(1)] == [5, 7]


@pytest.mark.parametrize(
    ("head", "delimiter", "words"),
    [
        ("time alpha", WHITESPACE, "the first row has 3 values and the header 2 words"),
        ("time alpha beta tas", WHITESPACE, "state .source. skip_rows = 1 and header = false"),
        ("time,alpha", ",", "the first row has 3 values and the header 2 names"),
        ("time,alpha,beta,tas", ",", "correct the header to 3 names"),
    ],
)
def test_a_header_that_does_not_fit_is_refused(tmp_path, head, delimiter, words):
    with pytest.raises(StoreError, match=words):
        read(tmp_path, table(head, delimiter=" " if delimiter == WHITESPACE else ","), delimiter)


def test_a_row_between_blanks_that_lacks_a_value_is_refused(tmp_path):
    text = table("t a v", delimiter=" ") + "0.8 0.2\n"
    with pytest.raises(StoreError, match="a row has 2 values where the table has 3 columns"):
        read(tmp_path, text, WHITESPACE)


def test_encodings(tmp_path):
    text = table("time,Anstellwinkel [°],tas")
    for encoding, noted in (("utf-8", False), ("utf-8-sig", False), ("utf-16", False), ("cp1252", True)):
        source = read(tmp_path, text.encode(encoding))
        holds_the_rows(source, ["time", "Anstellwinkel [°]", "tas"])
        assert bool(source.notes) == noted
    assert "was read as Windows-1252" in source.notes[0]
    assert not read(tmp_path, text.encode("cp1252"), encoding="windows-1252").notes
    holds_the_rows(read(tmp_path, text.encode("utf-16-le"), encoding="utf-16"), list(source.arrays))
    with pytest.raises(StoreError, match="is not text in utf-8"):
        read(tmp_path, text.encode("cp1252"), encoding="utf-8")


def test_a_line_that_states_the_delimiter(tmp_path):
    source = read(tmp_path, table("sep=;", "t;a;v", delimiter=";", end="\r\n"))
    holds_the_rows(source, ["t", "a", "v"])


@pytest.mark.parametrize(
    ("form", "start"),
    [
        ("2023-05-01 12:00:{:06.3f}", 1682942400.0),  # date -u -d "2023-05-01 12:00" +%s
        ("2023-05-01T12:00:{:06.3f}Z", 1682942400.0),
        ("2023-05-01T14:00:{:06.3f}+02:00", 1682942400.0),
        ("12:00:{:06.3f}", 43200.0),
    ],
)
def test_iso_times(tmp_path, form, start):
    rows = [f"{form.format(t)},{a:.6f},{v:.6f}" for t, a, v in ROWS]
    source = read(tmp_path, "\n".join(["time,a,v", *rows]))
    np.testing.assert_allclose(source.arrays["time"], start + T, rtol=0.0, atol=5e-7)
    assert source.dates == ("time",)
    broken = read(tmp_path, "\n".join(["time,a,v", *rows, "soon,1,2"]))
    assert broken.arrays["time"][-1] == "soon"


def test_a_date_and_a_time_in_two_columns(tmp_path):
    rows = [f"2023-05-01,23:59:{59.5 + t:06.3f},{v:.6f}" for t, _, v in ROWS if t < 0.5]
    rows += [f"2023-05-02,00:00:{t - 0.5:06.3f},{v:.6f}" for t, _, v in ROWS if t >= 0.5]
    source = read(tmp_path, "\n".join(["Lcl Date, Lcl Time, IAS", *rows]))
    mapping = {"time": {"column": "Lcl Time"}, "channels": {"airspeed_m_s": {"column": "IAS", "unit": "kt"}}}
    log = convert(source, MappingFile.model_validate(mapping))
    np.testing.assert_allclose(log.t_s, T, atol=1e-9)
    assert "at 86400 s (midnight), and is continued" in log.metadata["reading"][0]


@pytest.mark.parametrize(("bits", "unit_s"), [(16, 1e-3), (24, 1e-6), (32, 1e-6), (32, 1e-3)])
def test_a_counter_that_wraps_is_continued(bits, unit_s):
    true = 2.0**bits * unit_s - 0.41 + T
    counter = np.mod(np.round(true / unit_s), 2.0**bits) * unit_s
    clocked = increasing(counter)
    np.testing.assert_allclose(clocked.t_s, true, atol=0.6 * unit_s)
    assert len(clocked.notes) == 1


def test_repeated_times_are_dropped_and_counted():
    t = T.copy()
    t[[5, 17, 18]] = t[[4, 16, 16]]
    clocked = increasing(t)
    np.testing.assert_array_equal(np.flatnonzero(~clocked.keep), [5, 17, 18])
    np.testing.assert_array_equal(clocked.t_s, np.delete(T, [5, 17, 18]))
    assert clocked.notes == ("3 repeated times are left out",)


def test_a_restart_is_refused_with_its_cure():
    t = np.concatenate([100.0 + T, T])
    assert increasing(t).notes == ()
    arrays = {"t": t, "v": 20.0 + t}
    mapping = {"time": {"column": "t"}, "channels": {"airspeed_m_s": {"column": "v", "unit": "m/s"}}}
    with pytest.raises(LogError, match="if the recorder started again there, name each run's rows"):
        convert(Source(Path("f.csv"), arrays), MappingFile.model_validate(mapping))


@pytest.mark.skipif(not FIELD.is_dir(), reason="AIRTRUTH_FIELD names no folder")
@pytest.mark.parametrize("name", ["b6_unitsrow.csv", "b12_iso.csv", "b27_units_ws.txt", "b28_prose.asc"])
def test_the_files_of_the_field_are_tables_of_numbers(name):
    source = open_source(FIELD / name)
    assert len(source.arrays) == 9
    assert all(values.dtype.kind == "f" for values in source.arrays.values())
