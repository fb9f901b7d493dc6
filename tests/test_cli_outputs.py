"""Every command and its --out: nothing of the user is replaced, and the same command can be repeated."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from airtruth import cli
from airtruth.logs.store import read_log, write_log, write_table

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["airtruth", *map(str, arguments)])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code or 0
        text = capsys.readouterr()
        return code, text.out, text.err

    return run


@pytest.fixture
def log(tmp_path):
    """One record of the shipped undeclared flights, as a log of the user."""
    source = read_log(ROOT / "data" / "undeclared" / "a.parquet")
    path = tmp_path / "flight7.parquet"
    write_log(path, source.select(run_ids=source.run_ids[:1]))
    return path


def test_identify_does_not_replace_its_input(command, log):
    before = log.read_bytes()
    for option in ((), ("--force",)):
        code, _, err = command("identify", log, "--aircraft", "gtm", "--method", "ls", "--out", log, *option)
        assert (code, err) == (2, f"airtruth: {log}: is an input of this command; choose another --out\n")
    assert log.read_bytes() == before


@pytest.mark.parametrize(
    ("name", "offered"), [("e", "e.parquet"), ("e.csv", "e.parquet"), ("e.v2", "e.parquet")]
)
def test_a_file_of_estimates_is_named_parquet(command, log, name, offered):
    code, out, err = command("identify", log, "--aircraft", "gtm", "--method", "ls", "--out", name)
    assert (code, out) == (2, "")
    assert err == f"airtruth: {name}: estimates are a Parquet file; name it {offered}\n"
    assert not Path(name).exists()


def test_estimates_are_known_by_their_content(command, log):
    assert command("identify", log, "--aircraft", "gtm", "--method", "ls", "--out", "e.parquet")[0] == 0
    Path("e.parquet").rename("renamed")
    assert command("export", "renamed", "--out", "m.json")[0] == 0
    assert command("report", "renamed", "--out", "r.html")[0] == 0


def test_identify_can_be_repeated_and_keeps_other_files(command, log, tmp_path):
    arguments = ("identify", log, "--aircraft", "gtm", "--method", "ls", "--out", "e.parquet")
    assert command(*arguments)[0] == 0
    first = Path("e.parquet").read_bytes()
    assert command(*arguments)[0] == 0
    assert Path("e.parquet").read_bytes() == first
    assert command("verify", tmp_path)[1].count("extra    flight7.parquet") == 1
    Path("e.parquet").write_bytes(b"mine")
    code, _, err = command(*arguments)
    assert (code, err.count("\n")) == (2, 1)
    assert (
        "e.parquet: changed since airtruth wrote it; choose another --out, or replace it with --force" in err
    )
    assert Path("e.parquet").read_bytes() == b"mine"
    assert command(*arguments, "--force")[0] == 0
    assert Path("e.parquet").read_bytes() == first


def test_report_does_not_replace_the_csv_of_a_flight(command, log):
    assert command("identify", log, "--aircraft", "gtm", "--method", "ls", "--out", "e.parquet")[0] == 0
    Path("flight7.csv").write_text("t,alpha\n")
    code, _, err = command("report", "e.parquet", "--out", "flight7.html")
    assert (code, err.count("\n")) == (2, 1)
    assert "flight7.csv: exists and was not written by airtruth; choose another --out" in err
    assert Path("flight7.csv").read_text() == "t,alpha\n"
    assert not Path("flight7.html").exists()
    for _ in range(2):
        assert command("report", "e.parquet", "--out", "report.html")[0] == 0
    assert command("report", "e.parquet", "--out", "flight7.html", "--force")[0] == 0


def test_import_does_not_replace_its_input_or_another_log(command, log):
    Path("map.toml").write_text(
        '[source]\nformat = "parquet"\n[time]\ncolumn = "t_s"\nunit = "s"\n'
        + "".join(
            f'[channels.{name}]\ncolumn = "{name}"\nunit = "{unit}"\n'
            for name, unit in (
                ("airspeed_m_s", "m/s"),
                ("alpha_rad", "rad"),
                ("q_rad_s", "rad/s"),
                ("az_m_s2", "m/s2"),
                ("elevator_rad", "rad"),
                ("altitude_m", "m"),
            )
        )
    )
    write_table("other.parquet", read_log(log).to_frame().drop(columns="run_id"))
    for out, words in (
        (Path("other.parquet"), "is an input"),
        (Path("map.toml"), "is an input"),
        (log, "was not written"),
    ):
        before = out.read_bytes()
        code, _, err = command("import", "other.parquet", "--mapping", "map.toml", "--out", out)
        assert (code, words in err, err.count("\n")) == (2, True, 1), err
        assert out.read_bytes() == before


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["trace", "loop"])
def test_trace_refuses_before_its_search_and_keeps_what_a_user_added(command, log, verb, monkeypatch):
    def searches(*arguments, **named):
        raise AssertionError("the search began")

    monkeypatch.setattr("airtruth.tracing.trace", searches)
    monkeypatch.setattr("airtruth.loop.close_loop", searches)
    folder = Path("out") / "trace" if verb == "loop" else Path("out")
    updated = folder / "aircraft" / "gtm"
    updated.mkdir(parents=True)
    (updated / "notes.txt").write_text("mine")
    code, _, err = command(verb, log, "--aircraft", "gtm", "--out", "out")
    assert (
        code,
        "notes.txt: was not written by airtruth, and the whole folder would be replaced" in err,
    ) == (2, True)
    (updated / "notes.txt").unlink()
    (folder / "trace.json").write_text("{}")
    code, _, err = command(verb, log, "--aircraft", "gtm", "--out", "out")
    assert (code, "trace.json: exists and was not written by airtruth" in err) == (2, True)
    code, _, err = command(verb, log, "--aircraft", "gtm", "--out", "out", "--force")
    assert (code, "the search began" in err) == (70, True)


@pytest.mark.slow
def test_temporary_files_of_others_stay(command, tmp_path):
    out = tmp_path / "out"
    arguments = (
        "fly",
        ROOT / "data" / "campaigns" / "light.toml",
        "--out",
        out,
        "--runs",
        "1",
        "--jobs",
        "1",
    )
    assert command(*arguments)[0] == 0
    (out / "logs" / ".notes.tmp").write_text("mine")
    (out / "logs" / f".00001.parquet.{os.getpid()}-0-00000000.tmp").write_text("of a process that is alive")
    assert command(*arguments)[0] == 0
    assert len(list((out / "logs").glob(".*.tmp"))) == 2


def test_a_new_aircraft_appears_whole_and_is_not_replaced(command):
    arguments = ("aircraft", "new", "gtm", "--airspeed-m-s", "40", "--altitude-m", "500", "--out", "small")
    assert command(*arguments)[0] == 0
    assert command("verify", "small")[0] == 0
    code, _, err = command(*arguments)
    assert (code, "small: is not empty; choose a new folder" in err) == (2, True)
    assert np.all([not p.name.endswith(".tmp") for p in Path.cwd().iterdir()])
