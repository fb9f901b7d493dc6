"""An aircraft written from six derivatives flies them in JSBSim."""

import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from airtruth import aircraft
from airtruth.aircraft.create import from_estimates, trim_point, write_new
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.errors import ConfigurationError, StoreError
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import altitude_of_density_m, equivalent_airspeed_m_s
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import normal_force_row, system
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.linearise import linearise
from airtruth.simulation.simulator import Condition
from airtruth.simulation.trim import trim
from airtruth.units import DEG, G0

# A transport of 17.6 t and a light aircraft without a servo: figures of nobody's aircraft.
BARE = """schema = 1
name = "bare"
[geometry]
wing_area = {{ value = {s}, unit = "m2" }}
chord = {{ value = {c}, unit = "m" }}
span = {{ value = {b}, unit = "m" }}
[mass]
mass = {{ value = {m}, unit = "kg", std = 10.0 }}
inertia_yy = {{ value = {i}, unit = "kg_m2" }}
[derivatives]
CLalpha = {{ value = {cla}, std = 0.1, source = "a table" }}
CLq = {{ value = {clq} }}
CLde = {{ value = {clde} }}
Cmalpha = {{ value = {cma} }}
Cmq = {{ value = {cmq} }}
Cmde = {{ value = {cmde} }}
[sensors.alpha_rad]
x = {{ value = 2.0, unit = "m" }}
{more}"""
SERVO = """
[elevator_actuator]
bandwidth = { value = 4.0, unit = "hz" }
rate_limit = { value = 60.0, unit = "deg_s" }
minimum = { value = -25.0, unit = "deg" }
maximum = { value = 15.0, unit = "deg" }
delay = { value = 20.0, unit = "ms" }
"""
BIG = {"s": 64, "c": 3.16, "b": 21.5, "m": 17600, "i": 253000} | {
    "cla": 5.6, "clq": 8, "clde": 0.3, "cma": -1.0, "cmq": -24, "cmde": -1.5
}  # fmt: skip
SMALL = {"s": 0.8, "c": 0.3, "b": 2.8, "m": 14, "i": 1.1} | {
    "cla": 4.4, "clq": 5, "clde": 0.4, "cma": -0.2, "cmq": -9, "cmde": -0.9
}  # fmt: skip
CASES = {
    "big": (BIG | {"more": SERVO}, TrimPoint(129.0, 0.73, 2.3 * DEG, 2.2 * DEG)),
    "small": (SMALL | {"more": ""}, TrimPoint(60.0, 1.2, 6.0 * DEG, -4.0 * DEG)),
}


@pytest.fixture(scope="module", params=CASES)
def written(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("bare")
    figures, at = CASES[request.param]
    (folder / "aircraft.toml").write_text(BARE.format(**figures), encoding="utf-8")
    plane = aircraft.load(folder)
    new = write_new(plane, plane.file.derivatives, at, folder / "new" / request.param)
    eas = float(equivalent_airspeed_m_s(at.airspeed_m_s, at.density_kg_m3))
    found = trim(new, Condition(eas, float(altitude_of_density_m(at.density_kg_m3)), 0.0))
    return plane, new, at, found


def derivatives_of(plane):
    return np.array([plane.file.derivatives[name].value for name in LONGITUDINAL.parameters])


def test_it_trims_where_it_was_asked(written):
    _, new, at, found = written
    assert found.airspeed_m_s == pytest.approx(at.airspeed_m_s, rel=1e-3)
    # thrust along body x and gravity at height move the balance by less than this
    assert found.alpha_rad == pytest.approx(at.alpha_rad, abs=0.2 * DEG)
    assert found.elevator_rad == pytest.approx(at.elevator_rad, abs=0.2 * DEG)
    assert 0.2 < found.controls.throttle < 0.6
    assert found.mass_kg == pytest.approx(new.mass_kg, rel=1e-6)


def test_linearised_it_gives_its_derivatives_back(written):
    plane, new, _, found = written
    flown = linearise(new, found)
    for side in (flown.plus, flown.minus, flown.central):
        np.testing.assert_allclose(side, derivatives_of(plane), rtol=1e-4)


def test_a_doublet_flies_like_the_linear_model(written):
    """Smooth, because a step under an Adams-Bashforth rule acts half a step early.

    The linear model is integrated here by Runge and Kutta's rule from the surface that was flown. It holds
    airspeed and gravity's direction; alpha's second order, and az times cos(alpha_t), are what differs.
    """
    plane, new, _, found = written
    dt, n = 0.005, 501
    t = dt * np.arange(n)
    command = np.where((t >= 0.5) & (t < 1.5), np.sin(2.0 * np.pi * (t - 0.5)) ** 3, 0.0) * 0.3 * DEG
    still = np.zeros(n)
    flown = Flight(new, found, dt).fly(Inputs(command, still, still))
    scale = linearise(new, found).scale
    a, b = system(derivatives_of(plane), scale)
    de = flown["elevator_rad"] - found.elevator_rad
    assert np.ptp(de) > 0.2 * DEG
    x = np.zeros((n, 2))
    for k in range(n - 1):
        middle = 0.5 * (de[k] + de[k + 1])
        k1 = a @ x[k] + b * de[k]
        k2 = a @ (x[k] + 0.5 * dt * k1) + b * middle
        k3 = a @ (x[k] + 0.5 * dt * k2) + b * middle
        k4 = a @ (x[k] + dt * k3) + b * de[k + 1]
        x[k + 1] = x[k] + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    row = normal_force_row(derivatives_of(plane), scale)
    model = {"alpha_rad": x[:, 0], "q_rad_s": x[:, 1], "az_m_s2": x @ row[:2] + row[2] * de}
    for channel, most in (("alpha_rad", 0.01), ("q_rad_s", 0.01), ("az_m_s2", 0.02)):
        moved = flown[channel] - flown[channel][0]
        assert np.abs(moved - model[channel]).max() < most * np.abs(moved).max(), channel


def test_what_was_declared_is_kept(written):
    plane, new, _, _ = written
    assert new.file.sensors == plane.file.sensors
    assert new.file.mass == plane.file.mass
    assert new.file.derivatives["CLalpha"].std == 0.1
    assert new.file.elevator_actuator == plane.file.elevator_actuator
    assert new.inertia_yy_kg_m2 == pytest.approx(plane.inertia_yy_kg_m2, rel=1e-9)


def test_the_trim_is_the_start_of_every_run():
    t = np.arange(0.0, 3.0, 0.1)
    late = np.where(t > 1.05, 1.0, 0.0)
    channels = {
        "airspeed_m_s": np.concatenate([50.0 + late, 52.0 + late]),
        "altitude_m": np.zeros(60),
        "alpha_rad": np.concatenate([0.1 + late, 0.2 + late]),
        "elevator_rad": np.concatenate([late, 0.02 + late]),
        "az_m_s2": np.full(60, -G0),
    }
    log = FlightLog({}, ("a", "b"), np.array([0, 30, 60]), np.concatenate([t, t]), channels)
    at = trim_point(log)
    assert (at.airspeed_m_s, at.alpha_rad, at.elevator_rad) == pytest.approx((51.0, 0.15, 0.01))
    assert at.density_kg_m3 == pytest.approx(1.225, rel=1e-4)  # standard atmosphere, sea level


def table(**columns):
    rows = {"run_id": ["a", "b", "c"], "method": "ls", "converged": [True, True, False]}
    for name in LONGITUDINAL.parameters:
        rows |= {name: [1.0, 3.0, 99.0], f"{name}_std": 0.1}
    return pd.DataFrame(rows | columns)


def test_estimates_give_the_mean_of_what_converged():
    found = from_estimates(table())
    assert found["Cmq"].value == 2.0
    assert found["Cmq"].std == pytest.approx(np.sqrt(2.0) / np.sqrt(2.0))  # spread 1.414 of two runs
    assert found["Cmq"].source == "ls, 2 runs"


def test_ambiguous_or_missing_estimates_are_named():
    with pytest.raises(ConfigurationError, match=r"--method \(iv-f1, ls\)"):
        from_estimates(table(method=["ls", "iv-f1", "ls"]))
    with pytest.raises(ConfigurationError, match=r"--method 'lss'.*ls"):
        from_estimates(table(), "lss")
    with pytest.raises(ConfigurationError, match="no run of ls converged"):
        from_estimates(table(converged=False))


def test_bad_input_is_refused_before_anything_is_written(written, tmp_path):
    plane, _, at, _ = written
    stated = plane.file.derivatives
    some = {k: v for k, v in stated.items() if k != "Cmq"}
    for derivatives, point, said in (
        (some, at, "lack Cmq"),
        (stated | {"Cmx": stated["Cmq"]}, at, "'Cmx'"),
        (stated, TrimPoint(-1.0, 1.0, 0.0, 0.0), "above 0"),
        (stated, TrimPoint(50.0, 1.0, 3.0, 0.0), "degrees"),
    ):
        with pytest.raises(ConfigurationError, match=said):
            write_new(plane, derivatives, point, tmp_path / "new")
    assert not (tmp_path / "new").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a").touch()
    with pytest.raises(StoreError, match="not empty"):
        write_new(plane, stated, at, tmp_path / "full")


@pytest.mark.slow
def test_the_command_writes_and_flies_it(tmp_path):
    (tmp_path / "aircraft.toml").write_text(BARE.format(**CASES["big"][0]), encoding="utf-8")
    command = [sys.executable, "-m", "airtruth", "aircraft", "new", tmp_path, "--out", tmp_path / "fresh"]
    trimmed = ["--airspeed-m-s", "129", "--altitude-m", "5000", "--derivative", "Cmalpha=-1.2"]
    done = subprocess.run([*command, *trimmed], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "trimmed at 129" in done.stdout
    last = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines()[-6:]}
    assert last["Cmalpha"] == ["-1.2", "-1.2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "--log LOG, or --airspeed-m-s and --altitude-m" in done.stderr
