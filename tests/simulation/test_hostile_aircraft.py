"""A model that ends, blocks or fills its process: each command ends with one sentence and its exit code."""

import os
import sys
import time

import hostile_models as hostile
import numpy as np
import pytest
from fly_campaigns import command, runs_recorded, write
from tiers import sampled

from airtruth import aircraft
from airtruth.errors import AircraftError, FlightError
from airtruth.isolation import client
from airtruth.logs.verify import verify
from airtruth.simulation import disposable
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim

AT = Condition(38.6, 2100.0)
NEXT = "correct the JSBSim model, or choose another aircraft"
DIES = f"the trim of hostile ends the process of JSBSim (SIGSEGV); {NEXT}"
# Python imports this module at its start: a process then ends itself by an exit code at a stage.
ENDING = """
import os, sys
def ends(module, name, owner=None):
    import importlib
    home = importlib.import_module(module)
    home = getattr(home, owner) if owner else home
    def ended(*arguments, **named):
        os._exit(0)
    setattr(home, name, ended)
stage = os.environ.get("ENDS_IN")
if stage == "trim" and "airtruth.isolation.server" in sys.orig_argv:
    ends("airtruth.simulation.trim", "_newton")
if stage == "flight" and "airtruth.simulation.campaign.worker" in sys.orig_argv:
    ends("airtruth.simulation.flight", "_simulate", "Flight")
if "airtruth.simulation.campaign.worker" in sys.orig_argv:
    import airtruth.simulation.disposable as disposable
    disposable.SECONDS = float(os.environ.get("SECONDS_OF_A_RUN", disposable.SECONDS))
"""


@pytest.fixture
def plane(tmp_path):
    return hostile.copy(tmp_path / "hostile")


@pytest.fixture
def doubles(monkeypatch, tmp_path):
    """Child processes that read `ENDING` at their start."""
    (tmp_path / "path").mkdir()
    (tmp_path / "path" / "sitecustomize.py").write_text(ENDING)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "path"), *sys.path]))
    client.close()
    yield monkeypatch.setenv
    client.close()


def refused(*arguments):
    """The sentence with which a command refuses."""
    ended = command(*arguments)
    assert (ended.code, ended.out) == (2, ""), ended
    assert ended.err.count("\n") == 1, ended.err
    return ended.err.removeprefix("airtruth: ").rstrip("\n")


def campaign(tmp_path, plane, **changes):
    return write(tmp_path / "campaign.toml", aircraft=plane, **{"runs": 2, "gust": None} | changes)


def test_a_model_that_dies_while_it_is_loaded(plane):
    hostile.spoil(plane, hostile.recursion(hostile.ALWAYS))
    with pytest.raises(AircraftError, match=r"JSBSim died while loading the model \(SIGSEGV\); its output:"):
        aircraft.load(plane)


def test_a_model_that_fills_the_memory_while_it_is_loaded(plane):
    """JSBSim's exception on the lack of memory ends its process."""
    hostile.spoil(plane, hostile.delay(1e7))
    with pytest.raises(AircraftError, match=r"died while loading the model \(SIGABRT\)(.|\n)*std::bad_alloc"):
        aircraft.load(plane)


def test_a_model_that_dies_in_the_trim(tmp_path, plane):
    hostile.spoil(plane, hostile.recursion(hostile.IN_TRIM))
    file = campaign(tmp_path, plane)
    assert refused("fly", file, "--out", tmp_path / "out") == DIES
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("limit", "answer"),
    [("SECONDS", "no answer within 1 s"), ("COMPUTING_S", "no answer within 1 s of computing time")],
)
def test_an_endless_trim(limit, answer, tmp_path, plane, monkeypatch):
    hostile.spoil(plane, hostile.endless(hostile.IN_TRIM))
    monkeypatch.setattr(disposable, limit, 1.0)
    start = time.monotonic()
    said = refused("fly", campaign(tmp_path, plane), "--out", tmp_path / "out")
    assert said == f"the trim of hostile gives {answer}; {NEXT}"
    assert time.monotonic() - start < client.PATIENCE_S


def test_a_trim_that_fills_the_memory(tmp_path, plane):
    """The buffer has 120 MB at JSBSim's 120 Hz, with which a model is loaded first, and 10 GB at that of the campaign."""
    hostile.spoil(plane, hostile.delay(1.25e5))
    file = campaign(tmp_path, plane, simulation_hz=10_000.0, log_hz=50.0)
    said = refused("fly", file, "--out", tmp_path / "out")
    assert said == (
        "the trim of hostile ends the process of JSBSim (SIGABRT), or needs more than 4 GB of memory; " + NEXT
    )


@pytest.mark.slow
def test_a_trim_that_ends_its_process_with_exit_code_0(tmp_path, plane, doubles):
    doubles("ENDS_IN", "trim")
    said = refused("fly", campaign(tmp_path, plane), "--out", tmp_path / "out")
    assert said == (
        f"the trim of hostile ends the process of JSBSim (exit code 0, incomplete answer); {NEXT}"
    )


def test_a_trim_in_a_disposable_process_has_the_same_bits(gtm):
    assert disposable.isolated("the trim", trim, gtm, AT) == trim(gtm, AT)


def test_relative_paths_mean_the_folder_of_the_caller(plane, monkeypatch):
    monkeypatch.chdir(plane.parent)
    relative = aircraft.load("hostile")
    assert not relative.folder.is_absolute()
    assert disposable.isolated("the trim", trim, relative, AT) == trim(relative, AT)


def test_a_model_that_ends_the_simulation_is_a_failed_flight(plane):
    """No model may do so by its file; this one is changed after it was inspected."""
    loaded = aircraft.load(plane)
    hostile.spoil(plane, hostile.ending(1.0))
    flight = Flight(loaded, trim(loaded, AT), 1 / 200)
    with pytest.raises(FlightError, match=r"the model ended the flight at 1\.0"):
        flight.fly(Inputs(*np.zeros((3, 401))))


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.parametrize("jobs", [2, 1])
def test_flights_that_exit_with_code_0_are_failed_runs(tmp_path, plane, doubles, jobs):
    doubles("ENDS_IN", "flight")
    fails(tmp_path, campaign(tmp_path, plane), jobs, "the flight ends its process each time (exit code 0)")


@pytest.mark.slow
@pytest.mark.parametrize("jobs", sampled([2, 1], 2))
def test_flights_that_die_are_failed_runs(tmp_path, plane, jobs):
    hostile.spoil(plane, hostile.recursion(hostile.IN_FLIGHT))
    fails(tmp_path, campaign(tmp_path, plane), jobs, "the flight ends its process each time (SIGSEGV)")


@pytest.mark.long
@pytest.mark.slow
def test_endless_flights_are_failed_runs(tmp_path, plane, doubles, monkeypatch):
    doubles("SECONDS_OF_A_RUN", "1.0")
    monkeypatch.setattr(disposable, "SECONDS", 1.0)
    hostile.spoil(plane, hostile.endless(hostile.IN_FLIGHT))
    reason = "the flight does not end within 5 s of computing time"  # 1 s and 10 ms for each of 401 samples
    fails(tmp_path, campaign(tmp_path, plane), 1, reason)


def fails(tmp_path, file, jobs, reason):
    """Both runs of a campaign fail for a reason, and the next command keeps that."""
    out = tmp_path / "out"
    ended = command("fly", file, "--out", out, "--jobs", jobs, "--quiet")
    assert (ended.code, ended.out) == (1, f"2 runs in {out} (2 flown now, 2 failed)\n")
    assert sorted(ended.err.splitlines()) == [f"airtruth: small-00000{k} failed: {reason}" for k in (0, 1)]
    assert [(r["status"], r["reason"]) for r in runs_recorded(out)] == [("failed", reason)] * 2
    assert verify(out).intact
    again = command("fly", file, "--out", out)
    assert (again.code, "0 flown now" in again.out) == (1, True)


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    """Records of the sound aircraft under the name of the hostile one, and estimates from them."""
    folder = tmp_path_factory.mktemp("sound")
    sound = hostile.copy(folder / "hostile")
    file = campaign(folder, sound, duration_s=5.0)
    assert command("fly", file, "--out", folder / "out", "--quiet").code == 0
    estimates = ("--out", folder / "estimates.parquet", "--method", "ls")
    ended = command("identify", folder / "out", "--aircraft", sound, *estimates)
    assert ended.code == 0, ended.err
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("name", ["trace", "loop", "plan", "plan --split", "report"])
def test_other_commands_that_trim(tmp_path, plane, logs, name):
    hostile.spoil(plane, hostile.recursion(hostile.IN_TRIM))
    out = tmp_path / "out"
    arguments = {
        "trace": (logs / "out", "--aircraft", plane, "--out", out, "--quiet"),
        "loop": (logs / "out", "--aircraft", plane, "--out", out, "--quiet"),
        "plan": (campaign(tmp_path, plane),),
        "plan --split": (
            campaign(tmp_path, plane),
            "--split",
            "elevator_delay,tail_effectiveness",
            "--out",
            f"{out}.toml",
            "--quiet",
        ),
        "report": (
            logs / "estimates.parquet",
            "--log",
            logs / "out",
            "--aircraft",
            plane,
            "--out",
            f"{out}.html",
        ),
    }[name]
    assert DIES in refused(name.split()[0], *arguments)


@pytest.mark.slow
def test_a_survey_of_a_model_that_dies_in_the_trim(tmp_path, plane):
    hostile.spoil(plane, hostile.recursion(hostile.IN_TRIM))
    said = refused("new", "aircraft", "--jsbsim", plane / "gtm.xml", "--out", tmp_path / "new")
    assert "gtm: the survey of this model ended the process of JSBSim (SIGSEGV)" in said
    assert not (tmp_path / "new").exists()
