"""Every command ends cleanly whatever its streams do: a closed pipe, a full disk, an ASCII terminal, Ctrl-C."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tiers import sampled

from airtruth.errors import FAILED_RUNS, INTERRUPTED, TERMINATED, USAGE
from validation.fuzz.logs import CAMPAIGN

FULL = Path("/dev/full")
QUICK = ("help", "version", "effects", "usage", "missing")
"""Commands that take less than a second; those of `SLOW` need a flown campaign."""
SLOW = (
    "dry",
    "fly",
    "plan",
    "identify",
    "tables",
    "trace",
    "loop",
    "guess",
    "import",
    "check",
    "report",
    "new",
    "verify",
)


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A folder with a name outside ASCII."""
    return tmp_path_factory.mktemp("Größe-ä")


@pytest.fixture(scope="module")
def campaign(home):
    """A flown and identified campaign in that folder, and an export of it with its mapping."""
    from airtruth.simulation.campaign.run import fly
    from validation.fuzz.foreign import csv
    from validation.fuzz.mutate import toml

    (home / "c.toml").write_text(CAMPAIGN, encoding="utf-8")
    fly(home / "c.toml", home / "c", jobs=1)
    estimating = ["identify", "c", "--aircraft", "gtm", "--method", "ls", "--method", "iv-f1"]
    subprocess.run([sys.executable, "-m", "airtruth", *estimating], cwd=home, check=True, capture_output=True)
    content, mapping = csv()[0]
    (home / "f.csv").write_bytes(content)
    (home / "m.toml").write_text(toml(mapping), encoding="utf-8")
    return home


def arguments(name, out):
    traced = ["c", "--aircraft", "gtm", "--model", "linear", "--effect", "elevator_delay", "--out", out]
    return {
        "help": ["fly", "--help"],
        "version": ["--version"],
        "effects": ["effects"],
        "usage": ["fly"],
        "missing": ["import", "--guess", "ü.csv"],
        "dry": ["fly", "c.toml", "--out", out, "--dry-run"],
        "fly": ["fly", "c.toml", "--out", out, "--jobs", "1"],
        "plan": ["plan", "c.toml", "--records", "2"],
        "identify": [
            "identify",
            "c",
            "--aircraft",
            "gtm",
            "--method",
            "ls",
            "--out",
            f"{out}.parquet",
            "--json",
        ],
        "tables": ["tables", "c", "--out", out],
        "trace": ["trace", *traced],
        "loop": ["loop", *traced, "--method", "ls"],
        "guess": ["import", "--guess", "f.csv"],
        "import": ["import", "f.csv", "--mapping", "m.toml", "--out", f"{out}.parquet", "--force"],
        "check": ["check", "c", "--json", "--force"],
        "report": ["report", "c", "--out", f"{out}.html"],
        "new": ["aircraft", "new", "gtm", "--airspeed-m-s", "42", "--altitude-m", "1000", "--out", out],
        "verify": ["verify", "c"],
    }[name]


def command(name, out):
    return [sys.executable, "-m", "airtruth", *arguments(name, out)]


def end(name, kind, home):
    """Exit code and stderr of a command whose streams are of a kind."""
    options = {"cwd": home, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL, "check": False}
    call = command(name, f"o-{name}-{kind}")
    if kind == "ascii":
        locale = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
        done = subprocess.run(call, stdout=subprocess.PIPE, env=os.environ | locale, **options)
        assert done.stdout.isascii()
        assert done.stderr.isascii()
    elif kind == "full":
        with FULL.open("w") as full:
            done = subprocess.run(call, stdout=full, **options)
    elif kind == "closed":
        done = subprocess.run(call, preexec_fn=lambda: os.close(1), **options)
    else:
        reading, writing = os.pipe()
        os.close(reading)
        with open(writing, "wb") as pipe:
            done = subprocess.run(call, stdout=pipe, **options)
    text = done.stderr.decode("utf-8")
    assert "Traceback" not in text
    assert "Exception ignored" not in text
    assert not list(home.glob("airtruth-failure-*"))
    return done.returncode, text


def check_endings(name, home):
    fails = name in ("usage", "missing")
    assert end(name, "pipe", home)[0] == (USAGE if fails else FAILED_RUNS)
    assert end(name, "closed", home)[0] == (USAGE if fails else 0)
    if FULL.exists():
        code, text = end(name, "full", home)
        assert code == USAGE
        assert fails or "standard output: not written; the disk is full" in text
    assert end(name, "ascii", home)[0] in (0, USAGE)


@pytest.mark.slow
@pytest.mark.parametrize("name", sampled(QUICK, 3))
def test_streams_of_quick_commands(name, home):
    check_endings(name, home)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_streams_of_every_command(name, campaign):
    check_endings(name, campaign)


STARTED = (
    "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); print('up', flush=True)\n"
    "from airtruth.__main__ import main; main()"
)
"""The program from the moment at which Python has started and `airtruth.__main__` has set the signal."""


def interrupted(name, delay, home):
    """Exit code and stderr of a command that gets Ctrl-C some seconds after its start, as a terminal sends it."""
    process = subprocess.Popen(
        [sys.executable, "-P", "-c", STARTED, *arguments(name, f"i-{name}-{delay:.4f}")],
        cwd=home,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    assert process.stdout.readline() == b"up\n"
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    _, error = process.communicate(timeout=60)
    return process.returncode, error.decode("utf-8")


CALLED = """
import ctypes, signal, time
signal.signal(signal.{signal}, signal.SIG_DFL)  # a job in the background of a shell ignores Ctrl-C
from airtruth.cli import entry
ring = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.{signal}))
def app(prog_name):
    ring()
    time.sleep(30.0)
entry.app = app
entry.main()
"""
"""The program, whose command gets a signal while C calls back into Python, as the compiled kernels do."""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", INTERRUPTED), ("SIGTERM", TERMINATED)])
def test_a_signal_in_a_callback_from_c_is_not_lost(name, code):
    call = [sys.executable, "-P", "-c", CALLED.format(signal=name)]
    done = subprocess.run(call, capture_output=True, timeout=25, text=True)
    assert done.returncode == code
    assert "the same command starts again" in done.stderr
    assert "Exception ignored" not in done.stderr


def check_interrupt(name, delay, home):
    code, text = interrupted(name, delay, home)
    assert code in (0, FAILED_RUNS, USAGE, INTERRUPTED, -signal.SIGINT), text
    assert "Traceback" not in text
    assert "Exception ignored" not in text
    assert not list(home.glob("airtruth-failure-*"))


def test_python_does_not_raise_during_the_imports(monkeypatch):
    """The program begins with the default action of Ctrl-C; the handler that raises comes after the imports."""
    from airtruth import __main__, cli

    before = signal.getsignal(signal.SIGINT)
    actions = []
    monkeypatch.setattr(cli, "main", lambda: actions.append(signal.getsignal(signal.SIGINT)))
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        __main__.main()
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # of a shell's background job
        __main__.main()
    finally:
        signal.signal(signal.SIGINT, before)
    assert actions == [signal.SIG_DFL, signal.SIG_IGN]


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.25, 0.5])
def test_an_interrupt_during_the_imports(delay, home):
    check_interrupt("effects", delay, home)


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("name", SLOW)
def test_an_interrupt_of_every_command(name, campaign):
    rng = random.Random(name)
    for _ in range(4):
        check_interrupt(name, rng.uniform(0.0, 5.0), campaign)
