"""Text as recorders write it, and clocks that repeat, wrap or restart: small twins of files that were refused or shifted."""

import os
from pathlib import Path

import numpy as np
import pytest

from airtruth.errors import LogError, StoreError
from airtruth.foreign.text import WHITESPACE, TextFormat, read_text
from airtruth.importers.build import sentences
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


@pytest.mark.parametrize(("delimiter", "names"), [(",", "t,a,v"), (WHITESPACE, "t a v")])
@pytest.mark.parametrize("end", ["\n", "\n\n\n", "\n  \n", "\n\t", "\r\n\r\n"])
def test_blank_lines_at_the_end_are_no_rows(tmp_path, delimiter, names, end):
    content = table(names, delimiter="," if delimiter == "," else " ").rstrip("\n") + end
    holds_the_rows(read(tmp_path, content, delimiter=delimiter), ["t", "a", "v"])


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


LONG = np.arange(300) * 0.02
SPEED = {"time": {"column": "t"}, "channels": {"airspeed_m_s": {"column": "v", "unit": "m/s"}}}


def restarted(*starts, rows=300):
    t = np.concatenate([start + LONG[:rows] for start in starts])
    return Source(Path("f.csv"), {"t": t, "v": 20.0 + np.arange(len(t)) * 0.01, "m": np.arange(len(t)) + 1.0})


def test_a_clock_that_starts_again_divides_the_record_into_runs():
    source = restarted(100.0, 0.0, 40.0, 0.1)  # the step to 40 s is a pause
    log = convert(
        source, MappingFile.model_validate({**SPEED, "resample": {"rate_hz": 50, "method": "previous"}})
    )
    assert log.run_ids == ("f-1", "f-2", "f-3")
    assert np.diff(log.offsets).tolist() == [300, 2300, 300]
    np.testing.assert_array_equal(log.channels["airspeed_m_s"][:300], source.arrays["v"][:300])
    np.testing.assert_array_equal(log.channels["airspeed_m_s"][-300:], source.arrays["v"][-300:])
    np.testing.assert_allclose(log.t_s[-300:], LONG, atol=1e-9)
    # parts count on in whole seconds, 10 s or more after the end: 105.98 -> 116, 161.98 -> 172 less 0.1
    assert log.metadata["reading"] == [
        "f.csv: the clock starts again at 0 s: part 2 counts on from 116 s, and is a run of its own",
        "f.csv: the clock starts again at 0.1 s: part 3 counts on from 172.1 s, and is a run of its own",
    ]


def test_the_parts_have_constants_of_their_own():
    stated = {**SPEED, "constants": {"mass_kg": {"column": "m", "unit": "kg"}}}
    log = convert(restarted(100.0, 0.0), MappingFile.model_validate(stated))
    assert {run: facts["mass_kg"] for run, facts in log.metadata["record_constants"].items()} == {
        "f-1": pytest.approx(150.5),  # the means of 1 ... 300 and 301 ... 600
        "f-2": pytest.approx(450.5),
    }


def test_manoeuvres_count_on_the_continued_clock():
    cut = [{"run_id": "late", "start_s": 117.0, "end_s": 118.0}]
    log = convert(restarted(100.0, 0.0), MappingFile.model_validate({**SPEED, "manoeuvre": cut}))
    np.testing.assert_allclose(log.channels["airspeed_m_s"], 20.0 + (350 + np.arange(51)) * 0.01)


def test_a_part_that_is_shorter_than_a_run_is_left_out_and_named():
    one = restarted(100.0)
    arrays = {name: np.concatenate([values[:12], values]) for name, values in one.arrays.items()}
    arrays["t"][:12] = LONG[:12] + 300.0
    log = convert(Source(Path("f.csv"), arrays), MappingFile.model_validate(SPEED))
    assert log.run_ids == ("f-2",)
    assert len(log.t_s) == 300
    assert any("part 1" in text and "shorter than a run" in text for text in log.metadata["reading"])


@pytest.mark.parametrize("last_s", [1e30, 1.7e308])
def test_a_damaged_time_before_a_restart_is_refused(last_s):
    source = restarted(100.0, 0.0)
    source.arrays["t"][299] = last_s
    with pytest.raises(LogError, match=r"f\.csv"):
        convert(source, MappingFile.model_validate(SPEED))


@pytest.mark.parametrize("order", [[0, 2, 1, 3], [0, 1, 3, 2]])
def test_rows_out_of_order_are_refused(order):
    source = restarted(100.0)
    arrays = {name: values.copy() for name, values in source.arrays.items()}
    arrays["t"][50:54] = arrays["t"][50:54][order]
    with pytest.raises(LogError, match="if rows are out of order, sort the file by the time"):
        convert(Source(Path("f.csv"), arrays), MappingFile.model_validate(SPEED))


def test_channels_whose_clocks_start_again_at_different_times_are_refused():
    arrays = {"t": np.concatenate([LONG + 100.0, LONG]), "own": np.arange(600) * 0.02, "v": LONG.repeat(2)}
    stated = {**SPEED, "resample": {"rate_hz": 50, "method": "linear"}}
    stated["channels"] = {
        **SPEED["channels"],
        "q_rad_s": {"column": "v", "unit": "rad/s", "clock": {"column": "own"}},
    }
    with pytest.raises(LogError, match="if the recorder started again there"):
        convert(Source(Path("f.csv"), arrays), MappingFile.model_validate(stated))


def test_jitter_is_stated_with_the_method():
    t = LONG + 0.004 * np.sin(np.arange(300))
    source = Source(Path("f.csv"), {"t": t, "v": 20.0 + t})
    for method, words in (
        ("linear", "linear interpolation"),
        ("cubic", "cubic splines"),
        ("previous", "holding the previous sample"),
    ):
        log = convert(
            source, MappingFile.model_validate({**SPEED, "resample": {"rate_hz": 50, "method": method}})
        )
        # the largest step is 0.02 + 0.004 (sin i - sin(i - 1)), at most 0.02 + 0.008 sin(1/2), 19.2 % more
        assert sentences(log) == [
            f"the steps of the times differ by up to 19 %: channels are resampled to 50 Hz by {words}"
        ]
    even = convert(Source(Path("f.csv"), {"t": LONG, "v": 20.0 + LONG}), MappingFile.model_validate(SPEED))
    assert sentences(even) == []


@pytest.mark.skipif(not FIELD.is_dir(), reason="AIRTRUTH_FIELD names no folder")
@pytest.mark.parametrize("name", ["b6_unitsrow.csv", "b12_iso.csv", "b27_units_ws.txt", "b28_prose.asc"])
def test_the_files_of_the_field_are_tables_of_numbers(name):
    source = open_source(FIELD / name)
    assert len(source.arrays) == 9
    assert all(values.dtype.kind == "f" for values in source.arrays.values())
