"""The command line of fly: help, exit codes, and how little it imports before it works."""

import math
import subprocess
import sys
from pathlib import Path

import pytest

from airtruth import __version__, cli

CAMPAIGN = Path(__file__).resolve().parents[1] / "data" / "campaigns" / "light.toml"


@pytest.fixture
def command(monkeypatch, capsys):
    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["airtruth", *map(str, arguments)])
        try:
            cli.main()
            code = 0
        except SystemExit as end:
            code = end.code
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


def test_the_command_line_imports_nothing_heavy():
    script = (
        "import sys, airtruth.cli\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'pyarrow', 'jsbsim', 'numba', 'matplotlib', 'pydantic'}\n"
        "print(*sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


@pytest.mark.parametrize("arguments", [("--help",), ("-h",)])
def test_help_names_the_verbs(command, arguments):
    code, out, err = command(*arguments)
    assert (code, err) == (0, "")
    assert "fly" in out


def test_help_of_fly_has_an_example_and_each_option(command):
    code, out, _ = command("fly", "--help")
    assert code == 0
    for word in ("--out", "--jobs", "--seed", "--dry-run", "Example: airtruth fly"):
        assert word in out


def test_version(command):
    assert command("--version") == (0, f"{__version__}\n", "")


def test_module_runs_as_the_command():
    done = subprocess.run(
        [sys.executable, "-m", "airtruth", "--version"], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == __version__


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["flyy"], ["flyy"]),
        (["fly"], ["CAMPAIGN.toml"]),
        (["fly", CAMPAIGN], ["--out"]),
        (["fly", CAMPAIGN, "--out", "x", "--jobs", "0"], ["--jobs"]),
        (["fly", CAMPAIGN, "--out", "x", "--jobs", "two"], ["--jobs"]),
        (["fly", CAMPAIGN, "--out", "x", "--runs", "0"], ["--runs"]),
        (["fly", CAMPAIGN, "--out", "x", "--seed", "-1"], ["--seed"]),
        (["fly", CAMPAIGN, "--out", "x", "--runs", "1", "--seed", str(2**63)], ["seed"]),
        (["fly", CAMPAIGN, "--out", "x", "--runs", str(10**9), "--dry-run"], ["runs"]),
        (
            ["fly", "nowhere.toml", "--out", "x"],
            ["nowhere.toml: no such campaign file", "airtruth new campaign"],
        ),
        (["fly", ".", "--out", "x"], ["cannot be read"]),
    ],
)
def test_wrong_use_exits_2_and_says_what(command, tmp_path, monkeypatch, arguments, words):
    if str(10**9) in arguments:  # more runs than a file may ask for: refused before a table of them is drawn
        from airtruth.simulation.campaign import plan

        monkeypatch.setattr(plan, "_run_table", lambda *a: pytest.fail("drawn before it was refused"))
    monkeypatch.chdir(tmp_path)
    code, out, err = command(*arguments)
    assert (code, out) == (2, "")
    for word in words:
        assert word in err
    assert not (tmp_path / "x").exists()


def test_dry_run_prints_the_plan_and_writes_nothing(command, tmp_path):
    code, out, err = command("fly", CAMPAIGN, "--out", tmp_path / "x", "--dry-run", "--runs", 5, "--seed", 7)
    assert (code, err) == (0, "")
    for word in ("light", "gtm", "5 of 5 s, simulated at 200 Hz, logged at 50 Hz", "seed       7", "doublet"):
        assert word in out
    assert not (tmp_path / "x").exists()


@pytest.mark.slow
def test_short_work_leaves_stderr_silent_where_it_is_no_terminal(command, tmp_path, monkeypatch):
    """A line of progress appears every ten seconds, which a busy machine may take."""
    monkeypatch.setattr("airtruth.cli.progress.EVERY_S", math.inf)
    code, out, err = command("fly", CAMPAIGN, "--out", tmp_path / "x", "--runs", 2, "--jobs", 1)
    assert (code, err) == (0, "")
    assert out == f"2 runs in {tmp_path / 'x'} (2 flown now, 0 failed)\n"


FULL = Path("/dev/full")


@pytest.mark.slow
@pytest.mark.skipif(not FULL.exists(), reason="no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [("effects", "--json"), ("--version",)])
def test_full_stdout_is_one_message(monkeypatch, arguments, unbuffered):
    monkeypatch.setenv("PYTHONUNBUFFERED", unbuffered)
    command = [sys.executable, "-m", "airtruth", *arguments]
    with FULL.open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "airtruth: standard output: not written; the disk is full: free some space and run again\n"
    )


LOG = str(Path(__file__).resolve().parents[1] / "data" / "undeclared" / "a.parquet")


def stopped(*arguments, **named):
    raise KeyboardInterrupt


@pytest.mark.parametrize(
    ("arguments", "function", "step"),
    [
        (["fly", CAMPAIGN, "--out", "x", "--runs", "1"], "airtruth.simulation.campaign.run.fly", "resumes"),
        (
            ["identify", LOG, "--aircraft", "gtm"],
            "airtruth.identification.identified",
            "starts again from the beginning",
        ),
        (
            ["trace", LOG, "--aircraft", "gtm", "--out", "x"],
            "airtruth.tracing.trace",
            "starts again from the beginning",
        ),
        (
            ["loop", LOG, "--aircraft", "gtm", "--out", "x"],
            "airtruth.loop.close_loop",
            "starts again from the beginning",
        ),
    ],
    ids=["fly", "identify", "trace", "loop"],
)
def test_an_interrupted_command_says_what_the_same_one_does(command, monkeypatch, arguments, function, step):
    monkeypatch.setattr(function, stopped)
    code, out, err = command(*arguments)
    assert (code, out) == (130, "")
    assert err.endswith(f"airtruth: interrupted; the same command {step}\n")
