"""The gate and the mapping of a log: the evidence of all runs, odd runs, and what the mapping states."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth import aircraft as planes
from airtruth.checks.gate import admit, inspect
from airtruth.checks.motions import check_motions
from airtruth.checks.stated import KEY
from airtruth.errors import LogError
from airtruth.identification import identify
from airtruth.logs.flight_log import PRESCRIBED, FlightLog
from airtruth.logs.store import iter_logs, read_log
from airtruth.physics.reconstruction import COLUMNS, ReconstructionPriors, reconstruct
from airtruth.simulation.campaign import run as campaign
from airtruth.units import DEG, G0

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def log():
    return read_log(ROOT / "data" / "undeclared" / "a.parquet")


@pytest.fixture(scope="module")
def nine():
    """Nine runs of nine lengths, as manoeuvres that are cut from a flight."""
    runs = []
    for name in "ab":
        one = read_log(ROOT / "data" / "undeclared" / f"{name}.parquet")
        one = replace(one, run_ids=tuple(f"{name}{i}" for i in range(len(one))), metadata={})
        runs += [one.select(run_id) for run_id in one.run_ids]
    return FlightLog.concat([one.select(t_s=(0.0, 3.6 + 0.15 * k)) for k, one in enumerate(runs[:9])])


def scaled(log, factors, runs=None, stated=None):
    channels = {name: values.copy() for name, values in log.channels.items()}
    for name, factor in factors.items():
        for run in range(len(log)) if runs is None else runs:
            channels[name][log.rows(run)] *= factor
    mapping = {name: {"unit": unit} for name, unit in (stated or {}).items()}
    return replace(log, channels=channels, metadata={**log.metadata, KEY: mapping})


def certain(log, aircraft=None):
    return [fault for fault in inspect(log, aircraft) if fault.certain]


def test_one_odd_run_of_nine_is_named_and_left_out(nine, gtm):
    bad = scaled(nine, {"q_rad_s": -1.0}, runs=[6])
    admitted = admit(bad, gtm)
    assert admitted.log.run_ids == tuple(r for r in nine.run_ids if r != nine.run_ids[6])
    (sentence,) = admitted.left_out
    assert (
        f"left out 1 of 9 runs ({nine.run_ids[6]!r}), the other 8 are used: q_rad_s: opposite sign"
        in sentence
    )
    assert "import mapping" not in sentence  # which serves the other eight
    assert len(admit(bad, gtm, force=True).log) == 9


def test_a_mistake_of_the_mapping_is_one_of_runs_of_any_length(nine, gtm):
    (fault,) = certain(scaled(nine, {"elevator_rad": -1.0}), gtm)
    assert (fault.channel, fault.code, fault.run_ids) == ("elevator_rad", "sign", nine.run_ids)
    with pytest.raises(LogError, match="elevator_rad: opposite sign in all 9 runs"):
        admit(scaled(nine, {"elevator_rad": -1.0}), gtm)


def test_clean_runs_of_any_length_pass(nine, gtm):
    assert certain(nine, gtm) == []
    assert certain(nine) == []


DEGREES = {"alpha_rad": "deg", "theta_rad": "deg", "q_rad_s": "deg_s", "elevator_rad": "deg"}


def test_channels_that_share_a_mistake_beside_one_that_does_not(log, gtm):
    """A header says degrees, and theta, q and elevator are in radians; ax was blamed."""
    names = ("theta_rad", "q_rad_s", "elevator_rad")
    faults = certain(scaled(log, dict.fromkeys(names, DEG), stated=DEGREES), gtm)
    assert {(f.channel, f.code) for f in faults} == {(name, "unit") for name in names}
    for fault in faults:
        unit = DEGREES[fault.channel]
        cure = f'state unit = "{unit.replace("deg", "rad")}" in place of "{unit}"'
        assert cure in fault.sentence


def test_a_hundredth_of_the_stated_unit_is_named(log, gtm):
    (fault,) = certain(scaled(log, {"elevator_rad": 100.0}, stated=DEGREES), gtm)
    assert fault.sentence.startswith("elevator_rad: 1/100 deg taken as degrees in all 6 runs")
    assert "state scale = 0.01 under" in fault.sentence
    assert 'unit = "deg"' not in fault.sentence


def test_a_stated_sign_is_turned_and_not_repeated(log, gtm):
    bad = scaled(log, {"q_rad_s": -1.0})
    bad = replace(bad, metadata={KEY: {"q_rad_s": {"unit": "rad_s", "sign": -1}}})
    (fault,) = certain(bad, gtm)
    assert "state sign = 1 in place of -1" in fault.sentence


def test_pulse_widths_of_a_servo_are_recognised(log):
    """1500 us at the centre and 20 us for each degree, stated as degrees."""
    pulses = (1500.0 + 20.0 * log.channels["elevator_rad"] / DEG) * DEG
    channels = {n: v for n, v in log.channels.items() if n != "elevator_command_rad"}
    bad = replace(
        log, channels={**channels, "elevator_rad": pulses}, metadata={KEY: {"elevator_rad": {"unit": "deg"}}}
    )
    (fault,) = certain(bad)
    assert fault.sentence.startswith("elevator_rad: pulse widths of a servo in microseconds taken as degrees")
    assert "as scale" in fault.sentence


def test_a_fault_that_rests_on_declared_numbers_blames_them_too(log, gtm):
    """The wing area a hundred times too large moves CLalpha and Cmde, and no other test."""
    wrong = gtm.model_copy(
        update={"constants": gtm.constants.model_copy(update={"wing_area_m2": 100.0 * gtm.wing_area_m2})}
    )
    assert certain(log) == []
    faults = certain(log, wrong)
    assert faults
    for fault in faults:
        assert "or the declared " in fault.sentence
        assert "wing_area" in fault.sentence
        assert "gravity and the path" not in fault.sentence  # a test that agrees


def test_another_aircraft_than_that_of_the_log_is_a_warning(log):
    (fault,) = (f for f in inspect(log, planes.load("c172x")) if f.code == "aircraft")
    assert not fault.certain
    assert "name the aircraft 'gtm', and the declared one is 'c172x'" in fault.sentence


def test_a_prescribed_surface_is_its_command(log, gtm):
    same = replace(log, channels={**log.channels, "elevator_command_rad": log.channels["elevator_rad"]})
    assert [f.code for f in certain(same, gtm)] == ["copy"]
    assert certain(replace(same, metadata={**log.metadata, PRESCRIBED: True}), gtm) == []


REPLAY = """
schema = 1
name = "again"
aircraft = "gtm"
runs = 1
seed = 1
duration_s = 6.0
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "replay"
file = "{file}"
run_id = "r1"
channel = "elevator_rad"
start_s = 0.0
[sensors]
ideal = true
"""


def test_a_surface_that_was_replayed_with_ideal_sensors_is_identified(tmp_path):
    (tmp_path / "again.toml").write_text(REPLAY.format(file=ROOT / "data" / "undeclared" / "a.parquet"))
    campaign.fly(tmp_path / "again.toml", tmp_path / "again")
    (again,) = iter_logs(tmp_path / "again")
    np.testing.assert_array_equal(again.channels["elevator_rad"], again.channels["elevator_command_rad"])
    assert identify(again, "gtm", ("ls",)).of("ls").converged.all()


def vaneless(log, airspeed, theta):
    """The log with an airspeed that is wrong by a factor, and the alpha that follows from it."""
    channels = {n: v for n, v in log.channels.items() if theta or n != "theta_rad"}
    channels["airspeed_m_s"] = airspeed * channels["airspeed_m_s"]
    made = {name: np.empty_like(log.t_s) for name in ("alpha_rad", *COLUMNS)}
    for run in range(len(log)):
        rows = log.rows(run)
        own = {n: v[rows] for n, v in channels.items()}
        one = reconstruct(own, 0.02, ReconstructionPriors(0.02 * G0, 0.1 * DEG, 0.02))
        made["alpha_rad"][rows] = one.alpha_rad
        for name, values in zip(COLUMNS, one.directions_rad, strict=True):
            made[name][rows] = values
    return replace(log, channels={**channels, **made})


@pytest.mark.parametrize("theta", [True, False])
def test_a_reconstructed_alpha_is_no_evidence(log, gtm, theta):
    """With 0.8 of the airspeed every channel agreed with the alpha that was computed from it."""
    result = check_motions([("", vaneless(log, 0.8, theta))], gtm, motion="longitudinal")["longitudinal"]
    assert result.verdict == "cannot_tell"
    text = result.summary()
    assert "agree" not in text
    assert "which is no evidence" in result.sentences[0]
    assert not any("airspeed" in finding.name for finding in result.findings)
    assert text.count("alpha_rad was computed from") == 1
