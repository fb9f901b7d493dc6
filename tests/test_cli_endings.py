"""How the command line ends: unforeseen exceptions, signals, terminals without Unicode, help."""

import os
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import get_args

import pytest

from airtruth import cli
from airtruth.cli import arguments as choices
from airtruth.cli.application import ORDER, app
from airtruth.errors import AirtruthError

CAMPAIGN = Path(__file__).resolve().parents[1] / "data" / "campaigns" / "light.toml"


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["airtruth", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        text = capsys.readouterr()
        return end.value.code, text.out, text.err

    return run


def raises(error):
    def verb(*arguments, **named):
        raise error

    return verb


def test_an_empty_argument_is_not_the_current_folder(command):
    """A shell passes one for "$LOG" where the variable is not set."""
    code, out, err = command("identify", "", "--aircraft", "gtm")
    assert (code, out) == (2, "")
    assert "the argument after 'identify' is empty; state it, or leave it out" in err


def test_an_unforeseen_exception_is_one_sentence_and_a_report(command, monkeypatch, tmp_path):
    monkeypatch.setattr("airtruth.effects.listing.as_text", raises(ZeroDivisionError("by\nzero")))
    code, out, err = command("effects", "elevator_delay")
    assert (code, out) == (70, "")
    assert len(err.splitlines()) == 1
    assert "unexpected error (ZeroDivisionError: by)" in err
    (report,) = tmp_path.glob("airtruth-failure-*.txt")
    assert err.rstrip().endswith(str(report))
    text = report.read_text(encoding="utf-8")
    for words in (
        "airtruth effects elevator_delay",
        "Traceback (most recent call last)",
        "numpy",
        sys.version,
    ):
        assert words in text


def test_the_report_goes_to_the_temporary_folder_if_the_working_folder_is_gone(
    command, monkeypatch, tmp_path
):
    gone = tmp_path / "gone"
    gone.mkdir()
    other = tmp_path / "other"
    other.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(other))
    monkeypatch.setattr("airtruth.effects.listing.as_text", raises(ValueError()))
    monkeypatch.chdir(gone)
    gone.rmdir()
    code, _, err = command("effects")
    assert code == 70
    assert "unexpected error (ValueError)" in err
    assert len(list(other.iterdir())) == 1


def test_without_a_folder_to_write_the_traceback_is_printed(command, monkeypatch):
    monkeypatch.setattr("airtruth.effects.listing.as_text", raises(ValueError("odd")))
    monkeypatch.setattr(Path, "write_text", raises(PermissionError("no")))
    code, _, err = command("effects")
    assert code == 70
    assert "no report could be written" in err
    assert "ValueError: odd" in err.splitlines()[-1]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_exception_that_a_signal_causes_is_its_ending(command, monkeypatch, tmp_path, number, code):
    """An import that a signal interrupts may raise an ImportError."""

    def verb(*arguments, **named):
        try:
            signal.raise_signal(number)
        except BaseException:
            raise ImportError("most likely due to a circular import") from None

    monkeypatch.setattr("airtruth.effects.listing.as_text", verb)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    try:
        ended, _, err = command("effects")
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == code
    assert err.endswith("the same command starts again from the beginning\n")
    assert not list(tmp_path.iterdir())


def test_memory_and_known_errors_write_no_report(command, monkeypatch, tmp_path):
    for error, code, words in (
        (MemoryError(), 70, "out of memory"),
        (AirtruthError("a known one"), 2, "airtruth: a known one"),
    ):
        monkeypatch.setattr("airtruth.effects.listing.as_text", raises(error))
        ended, _, err = command("effects")
        assert ended == code
        assert words in err
    assert not list(tmp_path.iterdir())


ENVIRONMENTS = ({"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"})


def run(*arguments, **options):
    command = [sys.executable, "-m", "airtruth", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, encoding="utf-8", check=False, **options)


@pytest.mark.slow
@pytest.mark.parametrize("environment", ENVIRONMENTS, ids=["ioencoding", "locale"])
def test_a_name_outside_the_encoding_of_the_terminal_is_escaped(tmp_path, environment):
    done = run("effects", "Größe-α", cwd=tmp_path, env=os.environ | environment)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("airtruth: effect 'Gr\\u")
    assert "Traceback" not in done.stderr


@pytest.mark.long
@pytest.mark.slow
def test_a_guessed_mapping_is_valid_toml_on_any_terminal(tmp_path):
    log = tmp_path / "flight.csv"
    log.write_text("Zeit [s],α [°],q [°/s],Höhe 🛩 [m]\n0,1,2,3\n0.1,1,2,3\n", encoding="utf-8")
    plain = run("import", "--guess", log, env=os.environ | {"PYTHONIOENCODING": "utf-8"})
    assert "α [°]" in plain.stdout
    for environment in ENVIRONMENTS:
        done = run("import", "--guess", log, env=os.environ | environment)
        assert done.returncode == 0, done.stderr
        assert done.stdout.isascii()
        assert tomllib.loads(done.stdout) == tomllib.loads(plain.stdout)


@pytest.mark.long
@pytest.mark.slow
def test_sigterm_stops_the_workers_and_leaves_a_campaign_that_resumes(tmp_path):
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    text = CAMPAIGN.read_text(encoding="utf-8") + '\n[[effect]]\nname = "elevator_delay"\ndelay_s = 0.03\n'
    (tmp_path / "c.toml").write_text(text, encoding="utf-8")
    arguments = ["fly", "c.toml", "--out", "out", "--runs", "400", "--jobs", "2", "--quiet"]
    process = subprocess.Popen(
        [sys.executable, "-m", "airtruth", *arguments],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(temporary)},
    )
    deadline = time.monotonic() + 60.0
    while not list((tmp_path / "out").glob("logs/*.parquet")) and time.monotonic() < deadline:
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 143, err
    assert (out, err) == ("", "airtruth: terminated; the same command resumes\n")
    assert not list(temporary.iterdir())
    again = run(*arguments[:5], "400", "--jobs", "2", cwd=tmp_path)
    assert again.returncode == 0, again.stderr


def test_help_shows_the_choices_of_an_option(command):
    _, out, _ = command("identify", "--help")
    text = " ".join(out.split())
    for option in (
        "--condition <motion|record|window>",
        "--pressure <method|constant|measured>",
        "--trim <intercept|mean>",
        "--covariance <none|",
    ):
        assert option in text
    assert "--model <aircraft|linear>" in " ".join(command("trace", "--help")[1].split())


def test_choices_of_the_command_line_are_those_of_the_options():
    from airtruth.cli.completion import METHOD_NAMES
    from airtruth.cli.schema import Kind
    from airtruth.identification import METHODS
    from airtruth.identification import options as identification
    from airtruth.identification.likelihood import options as likelihood
    from airtruth.schemas import FILES
    from airtruth.tracing import options as tracing

    assert get_args(choices.Condition) == identification.CONDITIONS
    assert get_args(choices.Covariance) == identification.COVARIANCE_NAMES
    assert get_args(choices.Pressure) == identification.PRESSURES
    assert get_args(choices.PlanPressure) == tuple(likelihood.PRESSURES)
    assert get_args(choices.TraceModel) == tracing.MODELS
    assert get_args(choices.Trim) == identification.TRIMS
    assert tuple(METHODS) == METHOD_NAMES
    assert get_args(Kind) == tuple(FILES)


def test_commands_are_listed_in_the_order_of_the_data(command):
    _, out, _ = command("--help")
    listed = [line.split()[0] for line in out.split("Commands:")[1].splitlines() if line.strip()]
    names = {c.name or c.callback.__name__ for c in app.registered_commands} | {"aircraft"}
    assert set(names) <= set(listed)
    assert [name for name in listed if name in ORDER] == [name for name in ORDER if name in listed]
