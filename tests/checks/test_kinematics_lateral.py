"""Kinematic check of roll, yaw and sideslip against an independent integration: equations, known errors, both motions."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from airtruth.checks.kinematics_fit import fit, limits_of, problem_of
from airtruth.checks.kinematics_lateral import check_lateral, side_records
from airtruth.checks.kinematics_side import ERRORS, LATERAL, compare
from airtruth.checks.motions import check_motions, chosen, supported
from airtruth.cli.application import app
from airtruth.errors import LogError
from airtruth.logs.store import write_log
from airtruth.physics.motion import LATERAL as LATERAL_MOTION
from airtruth.physics.motion import LONGITUDINAL
from validation.lateral_truth import Flight, log_of, record_pair, steps, with_effect

SPAN_M = 2.0875


def four(gust: float = 0.0) -> list[Flight]:
    return [*record_pair(gust=gust), *record_pair(gust=gust, seed=3)]


def quiet(share: float = 0.1) -> list[Flight]:
    """Two records with a tenth of the noise of the sensors and no bias."""
    return [f.quiet(share) for f in record_pair()]


def fitted(flights, errors, equations=("phi", "psi", "beta")):
    records, _ = side_records([log_of(*flights)])
    limits = limits_of(records, 3.0, LATERAL)
    problem = problem_of(records, equations, {}, limits, errors, kinematics=LATERAL)
    return fit(problem, tuple(errors))


@pytest.mark.parametrize("equation", ["phi", "psi", "beta"])
def test_an_exact_flight_obeys_the_equations(equation):
    """Banks of 24 deg and roll rates of 67 deg/s; what is left is the interpolation between samples of 25 Hz."""
    records, _ = side_records([log_of(*quiet(0.0))])
    for record in records:
        reading = getattr(record, equation)
        line = np.linspace(-1.0, 1.0, record.length)
        left = compare(record, {}, (equation,))[equation]
        left = left - np.polyval(np.polyfit(line, left, 1), line)
        assert np.ptp(left) < 3e-3 * np.ptp(reading)


@pytest.mark.parametrize(
    ("name", "size", "tolerance"),
    [
        ("vane_arm:beta_rad", 0.6, 0.05),
        ("vane_lag:beta_rad", 0.08, 0.002),
        ("sensor_delay:beta_rad", 0.08, 0.002),
        ("vane_scale:beta_rad", 1.12, 5e-3),
        ("gyro_scale:r_rad_s", 1.07, 5e-3),
        ("gyro_scale:p_rad_s", 1.07, 5e-3),
        ("gyro_lag:p_rad_s", 0.05, 1e-3),
        ("sensor_delay:phi_rad", 0.05, 1e-3),
        ("accelerometer_arm:ay_m_s2", 0.5, 0.05),
    ],
)
def test_an_error_of_a_quiet_record_is_found(name, size, tolerance):
    found = fitted([with_effect(f, name, size) for f in quiet()], {name: size})
    assert found.sound
    assert found.value[0] == pytest.approx(size, abs=tolerance)


def test_a_constant_error_of_alpha_is_no_arm():
    """1 deg of alpha turns roll into sideslip; it is free in every set of errors."""
    flights = [f.reading("alpha_rad", bias=np.radians(1.0)) for f in quiet()]
    found = fitted(flights, {"vane_arm:beta_rad": 0.0})
    assert found.value[0] == pytest.approx(0.0, abs=0.05)


def test_an_accelerometer_ahead_is_a_vane_behind():
    """int (x r_dot/V) dt = x r/V at constant V: the same motion of beta."""
    flights = [with_effect(f, "accelerometer_arm:ay_m_s2", 0.5) for f in quiet()]
    found = fitted(flights, {"vane_arm:beta_rad": -0.5})
    assert found.value[0] == pytest.approx(-0.5, abs=0.05)


def test_the_motions_of_a_log():
    both = [
        replace(f, elevator=steps(8.0, 0.5, 1, -1, 1), amplitudes=(*f.amplitudes[:2], 0.02))
        for f in record_pair()
    ]
    pitch = [replace(f, amplitudes=(0.0, 0.0, 0.02)) for f in both]
    assert supported([log_of(*both)]) == (LONGITUDINAL, LATERAL_MOTION)
    assert supported([log_of(*record_pair())]) == (LATERAL_MOTION,)
    assert supported([log_of(*pitch)]) == (LONGITUDINAL,)
    without = log_of(*both, leave_out=("ay_m_s2",))
    assert supported([without]) == (LONGITUDINAL,)
    with pytest.raises(LogError, match="the lateral motion needs ay_m_s2"):
        chosen([without], "lateral")
    with pytest.raises(LogError, match="motion 'laterl': unknown"):
        chosen([without], "laterl")
    result = check_motions([("", log_of(*pitch))], motion="lateral")["lateral"]
    assert result.verdict == "cannot_tell"
    assert "aileron_rad and rudder_rad do not move" in result.sentences[0]


@pytest.mark.slow
def test_without_an_error_only_the_bias_of_r_is_named():
    """The sensors of the GTM have a bias of r of -0.0286 deg/s; the arms are said to enter as their difference."""
    result = check_lateral([log_of(*four())], None, SPAN_M)
    assert [f.name for f in result.findings if f.state in ("present", "one of")] == ["gyro_bias:r_rad_s"]
    bias = result.finding("gyro_bias:r_rad_s")
    assert bias.lower < np.radians(-0.0286) < bias.upper
    assert "enter as their difference" in " ".join(result.sentences)


@pytest.mark.slow
def test_an_arm_in_calm_air_and_its_twin():
    flights = [with_effect(f, "vane_arm:beta_rad", 0.6) for f in four()]
    result = check_lateral([log_of(*flights)], None, SPAN_M)
    assert {c.name for c in result.possible} == {"vane_arm:beta_rad", "accelerometer_arm:ay_m_s2"}
    assert result.finding("vane_arm:beta_rad").value == pytest.approx(0.6, abs=0.05)
    known = check_lateral([log_of(*flights)], {"accelerometer_arm:ay_m_s2": 0.1}, SPAN_M)
    assert known.finding("vane_arm:beta_rad").value == pytest.approx(0.7, abs=0.05)
    assert "as declared" in " ".join(known.sentences)


@pytest.mark.slow
def test_in_gusts_an_arm_or_a_lag_is_a_pair():
    flights = [with_effect(f, "vane_arm:beta_rad", 0.6) for f in four(1.0)]
    result = check_lateral([log_of(*flights)], None, SPAN_M)
    assert {c.name for c in result.possible} >= {"vane_arm:beta_rad", "vane_lag:beta_rad"}
    assert result.verdict == "one_of"
    arm = result.finding("vane_arm:beta_rad")
    assert arm.lower < 0.6 < arm.upper
    without = check_lateral([log_of(*four(1.0), leave_out=("psi_rad",))], None, SPAN_M)
    assert "cannot be determined by the kinematics" in " ".join(without.sentences)


@pytest.mark.slow
def test_both_motions_at_the_command_line(tmp_path):
    both = [
        replace(f, elevator=steps(8.0, 0.5, 1, -1, 1), amplitudes=(*f.amplitudes[:2], 0.02))
        for f in record_pair()
    ]
    path = tmp_path / "a.parquet"
    write_log(path, log_of(*both))
    run = CliRunner().invoke(app, ["check", str(path), "--json", "--quiet"])
    assert run.exit_code == 0, run.output
    document = json.loads(run.stdout)
    assert list(document) == ["longitudinal", "lateral"]
    assert set(ERRORS) <= {f["name"] for f in document["lateral"]["findings"]}
    one = CliRunner().invoke(app, ["check", str(path), "--motion", "lateral", "--json", "--quiet"])
    assert json.loads(one.stdout)["findings"] == document["lateral"]["findings"]
    text = CliRunner().invoke(app, ["check", str(path), "--quiet"]).stdout
    assert text.index("Longitudinal motion") < text.index("Lateral-directional motion")
