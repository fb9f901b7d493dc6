"""What `airtruth trace` says of input that it cannot trace: one sentence, the right exit code, no traceback."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trace_flights as flights

from airtruth import cli
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError, LogError
from airtruth.logs import atomic
from airtruth.logs.store import write_log
from airtruth.physics.terms import Change, SensorTerm
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing import run as tracing
from airtruth.tracing.model import reading
from airtruth.tracing.prepare import prepare
from airtruth.units import DEG

FEW = ("elevator_delay", "gyro_scale")


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Three records without an effect."""
    return flights.log_of(flights.fly(tmp_path_factory.mktemp("plain") / "null"))


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """The command as a user runs it: exit code, stdout, stderr."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["airtruth", "trace", *map(str, arguments)])
        code = 0
        try:
            cli.main()
        except SystemExit as end:
            code = end.code
        out, err = capsys.readouterr()
        return code or 0, out, err

    return run


def stored(folder, log, name="log"):
    path = folder / f"{name}.parquet"
    write_log(path, log, dtype="float64")
    return path


def with_channel(log, name, values):
    return replace(log, channels={**log.channels, name: values})


def without(log, name):
    return replace(log, channels={k: v for k, v in log.channels.items() if k != name})


def one(log, run=0, samples=None):
    """One run, or its first samples."""
    rows = log.rows(run)
    rows = slice(rows.start, rows.stop if samples is None else rows.start + samples)
    return replace(
        log,
        run_ids=(log.run_ids[run],),
        offsets=np.array([0, rows.stop - rows.start]),
        t_s=log.t_s[rows],
        channels={k: v[rows] for k, v in log.channels.items()},
    )


def refused(command, path, tmp_path, *more):
    """Exit code 2, one message on stderr (what a log's validation finds stands in a list), nothing written."""
    code, out, err = command(path, "--aircraft", "gtm", "--out", tmp_path / "out", "--quiet", *more)
    assert code == 2, (code, out, err)
    assert "Traceback" not in err
    assert not (tmp_path / "out" / "trace.json").exists()
    lines = err.strip().splitlines()
    assert lines[0].startswith("airtruth: ")
    assert all(line.startswith("  - ") for line in lines[1:])
    return " ".join(lines)


@pytest.mark.slow
def test_one_record_works_and_is_provisional(command, log, tmp_path):
    path = stored(tmp_path, one(log))
    code, out, err = command(
        path,
        "--aircraft",
        "gtm",
        "--out",
        tmp_path / "out",
        "--quiet",
        "--json",
        "--effect",
        FEW[0],
        "--jobs",
        "1",
    )
    assert (code, err) == (0, "")
    answer = json.loads(out)
    assert answer["provisional"] is True
    assert answer == json.loads((tmp_path / "out" / "trace.json").read_text())


@pytest.mark.long
@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_json_on_a_full_stdout_is_one_message(log, tmp_path):
    command = [sys.executable, "-m", "airtruth", "trace", stored(tmp_path, one(log)), "--aircraft", "gtm"]
    command += ["--out", tmp_path / "out", "--quiet", "--json", "--effect", FEW[0]]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("airtruth: standard output: not written; the disk is full")
    assert len(done.stderr.splitlines()) == 1
    assert (tmp_path / "out" / "trace.json").exists()


@pytest.mark.slow
def test_no_elevator_movement(command, log, tmp_path):
    still = with_channel(log, "elevator_rad", np.full_like(log.t_s, 0.002))
    message = refused(command, stored(tmp_path, still), tmp_path)
    assert "elevator" in message
    assert "deg" in message or "constant" in message


def test_records_of_two_aircraft(command, log, tmp_path):
    first = stored(tmp_path, log, "a")
    renamed = replace(
        log, run_ids=tuple(f"other-{r}" for r in log.run_ids), metadata={**log.metadata, "aircraft": "T38"}
    )
    message = refused(command, first, tmp_path, stored(tmp_path, renamed, "b"))
    assert "several aircraft (T38, gtm)" in message


def test_the_same_run_twice(command, log, tmp_path):
    message = refused(command, stored(tmp_path, log, "a"), tmp_path, stored(tmp_path, log, "b"))
    assert "run 'blind-000000' is in" in message
    assert "give each run once, or rename one" in message


def refusal_or_answer(log, plane, options):
    try:
        return trace(log, plane, options).to_dict()
    except LogError as error:
        return str(error)


@pytest.mark.long
def test_an_aircraft_of_quite_another_kind(command, log, tmp_path):
    """A Cessna declared for records of a 26 kg model: refused, or an answer that says that much is missing."""
    found = refusal_or_answer(log, "c172x", TraceOptions(effects=FEW))
    if isinstance(found, str):
        assert "c172x" in found
        assert "gtm" in found or "another aircraft" in found or "right aircraft" in found
    else:
        assert found["verdict"] != "none"
        assert found["anomaly"]["p_value"] < 1e-6


@pytest.mark.long
@pytest.mark.slow
def test_an_aircraft_that_cannot_fly_there(command, log, tmp_path):
    """A T-38 at 75 kt: no trim."""
    code, _, err = command(stored(tmp_path, log), "--aircraft", "T38", "--out", tmp_path / "out", "--quiet")
    assert code == 2
    assert "T38" in err
    assert "Traceback" not in err


@pytest.mark.slow
def test_an_effect_whose_channel_the_log_lacks_is_untestable(log, monkeypatch):
    asking = replace(
        EFFECTS["vane_scale"],
        name="needs_flaps",
        describe=lambda values: Change(sensors=(SensorTerm("flap_rad", "scale", values["factor"]),)),
    )
    monkeypatch.setattr(tracing, "EFFECTS", {**EFFECTS, "needs_flaps": asking})
    answer = trace(log, "gtm", TraceOptions(effects=("needs_flaps", *FEW))).to_dict()
    row = next(c for c in answer["candidates"] if c["name"] == "needs_flaps")
    assert row["testable"] is False
    assert row["why_not"] == "the log lacks flap_rad"
    assert "needs_flaps" not in answer["detectability"]


@pytest.mark.slow
def test_effects_of_the_air_are_untestable_and_say_why(log):
    answer = trace(log, "gtm", TraceOptions(effects=("gust_level", *FEW))).to_dict()
    row = next(c for c in answer["candidates"] if c["name"] == "gust_level")
    assert row["testable"] is False
    assert "each record has its own gust level" in row["why_not"]


@pytest.mark.slow
def test_unknown_hold_out(command, log, tmp_path):
    message = refused(command, stored(tmp_path, log), tmp_path, "--hold-out", "blind-000009")
    assert "--hold-out 'blind-000009': no such run" in message
    assert "allowed: blind-000000, blind-000001, blind-000002" in message


def test_everything_held_out(command, log, tmp_path):
    more = [word for run in log.run_ids for word in ("--hold-out", run)]
    assert "leave at least one to fit" in refused(command, stored(tmp_path, log), tmp_path, *more)


def test_nan(command, log, tmp_path):
    q = log.channels["q_rad_s"].copy()
    q[17] = np.nan
    message = refused(command, stored(tmp_path, with_channel(log, "q_rad_s", q)), tmp_path)
    assert "q_rad_s" in message
    assert "blind-000000" in message


@pytest.mark.parametrize("channel", ["alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad", "airspeed_m_s"])
def test_missing_channel(command, log, tmp_path, channel):
    assert channel in refused(command, stored(tmp_path, without(log, channel)), tmp_path)


def test_neither_density_nor_altitude(command, log, tmp_path):
    less = replace(
        log, channels={k: v for k, v in log.channels.items() if k not in ("density_kg_m3", "altitude_m")}
    )
    message = refused(command, stored(tmp_path, less), tmp_path)
    assert "density_kg_m3" in message
    assert "altitude_m" in message


@pytest.mark.slow
@pytest.mark.parametrize("altitude", [True, False])
def test_density_in_another_unit(command, log, tmp_path, altitude):
    less = log if altitude else without(log, "altitude_m")
    slugs = with_channel(less, "density_kg_m3", np.full_like(log.t_s, 0.0019))
    message = refused(command, stored(tmp_path, slugs), tmp_path)
    assert "density_kg_m3: slug/ft3 taken as kg/m3 in all 3 runs" in message
    assert 'state unit = "slug_ft3" under [channels.density_kg_m3] in the import mapping' in message
    dense = with_channel(less, "density_kg_m3", np.full_like(log.t_s, 1.7))
    message = refused(command, stored(tmp_path, dense), tmp_path)
    assert "density_kg_m3: " in message
    assert "1.7" in message
    assert "unit" in message


@pytest.mark.slow
def test_an_accelerometer_whose_z_points_up(command, log, tmp_path):
    up = with_channel(log, "az_m_s2", -log.channels["az_m_s2"])
    message = refused(command, stored(tmp_path, up), tmp_path)
    assert "az_m_s2: opposite sign in all 3 runs" in message
    assert "state sign = -1 under [channels.az_m_s2]" in message


@pytest.mark.slow
def test_an_acceleration_without_gravity(command, log, tmp_path):
    z = log.channels["az_m_s2"].copy()
    last = log.rows(2)
    z[last] -= z[last].mean() - 0.1
    path = stored(tmp_path, with_channel(log, "az_m_s2", z))
    code, out, err = command(path, "--aircraft", "gtm", "--out", tmp_path / "out", "--quiet")
    assert code == 0, err
    text = " ".join(out.split())
    assert "az_m_s2: no gravity in 1 of 3 runs ('blind-000002'): az_m_s2 averages 0.1 m/s2" in text
    assert "the other 2 runs exclude it as a mistake of the mapping" in text


def test_no_altitude_has_that_density(log):
    slugs = with_channel(without(log, "altitude_m"), "density_kg_m3", np.full_like(log.t_s, 0.0019))
    with pytest.raises(LogError, match=r"density_kg_m3 is 0\.0019 kg/m3"):
        reading.read(slugs)


@pytest.mark.parametrize("gone", ["throttle", "theta_rad", "ax_m_s2", "elevator_command_rad", "altitude_m"])
def test_channels_that_are_not_needed(log, gone):
    """The problem can be set up without each of those that contract 1 calls optional."""
    from airtruth import aircraft

    less = without(log, gone)
    effects = [EFFECTS[k] for k in FEW]
    case = prepare([less], aircraft.load("gtm"), effects, TraceOptions(model="linear"))
    assert len(case.fitted.records) == 2


def test_too_short(command, log, tmp_path):
    message = refused(command, stored(tmp_path, one(log, samples=30)), tmp_path)
    assert "30 samples" in message
    assert "blind-000000" in message


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ("out", "a file of that name is in the way"),
        ("out/deep", "a part of the path is a file, not a folder"),
        ("closed", "permission denied: choose a folder that you may write to"),
    ],
)
def test_a_folder_that_cannot_be_written_is_found_before_the_search(
    command, log, tmp_path, monkeypatch, place, why
):
    path = stored(tmp_path, log)
    (tmp_path / "out").write_text("a file")
    (tmp_path / "closed").mkdir()
    # root may write everywhere
    monkeypatch.setattr(
        atomic.os, "access", lambda path, mode: not (mode & os.W_OK and Path(path).name == "closed")
    )
    monkeypatch.setattr(tracing, "prepare", lambda *a: pytest.fail("searched before it was refused"))
    code, _, err = command(path, "--aircraft", "gtm", "--out", tmp_path / place, "--quiet")
    assert code == 2
    assert err.startswith(f"airtruth: {tmp_path / place}: not written")
    assert why in err
    assert len(err.splitlines()) == 1


def test_no_log_there(command, tmp_path):
    assert "no such file or folder" in refused(command, tmp_path / "nothing", tmp_path)
    (tmp_path / "empty").mkdir()
    assert "holds no flight log" in refused(command, tmp_path / "empty", tmp_path)


def test_a_file_that_is_no_log(command, tmp_path):
    path = tmp_path / "text.parquet"
    path.write_text("not a log")
    assert "text.parquet" in refused(command, path, tmp_path)


def test_unknown_aircraft(command, log, tmp_path):
    code, _, err = command(stored(tmp_path, log), "--aircraft", "gtn", "--out", tmp_path / "out", "--quiet")
    assert code == 2
    assert "gtn" in err
    assert "gtm" in err


def test_options_that_mean_nothing(log):
    with pytest.raises(ConfigurationError, match=r"--model 'liner': did you mean 'linear'\?"):
        TraceOptions(model="liner")
    with pytest.raises(ConfigurationError, match="--jobs 0: must be at least 1"):
        TraceOptions(threads=0)


def test_an_elevator_that_only_held_out_records_move(command, log, tmp_path):
    elevator = log.channels["elevator_rad"].copy()
    for run in (0, 1):
        elevator[log.rows(run)] = elevator[0]
    less = without(log, "elevator_command_rad")  # a command that moves shows a sensor that does not
    path = stored(tmp_path, with_channel(less, "elevator_rad", elevator))
    message = refused(command, path, tmp_path, "--hold-out", log.run_ids[2])
    assert (
        "no record that is not held out moves the elevator by 0.1 deg: elevator_rad has a range of 0 deg;"
        in message
    )


def test_an_elevator_that_is_noise(log, gtm):
    """The column has a range that the smoothed elevator has not, and the sentence states both."""
    noise = 0.01 * DEG * np.random.default_rng(1).standard_normal(log.t_s.size)
    still = without(with_channel(log, "elevator_rad", noise), "elevator_command_rad")
    with pytest.raises(
        LogError, match=r"range of 0\.0[5-9]\d* deg, all( but \S+ deg)? of it noise of its sensor; without"
    ):
        prepare([still], gtm, (), TraceOptions(effects=FEW))
