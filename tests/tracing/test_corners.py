"""Corners of the elevator that its samples do not show: their variance, and the filter that allows for them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scipy.linalg import expm, solve_discrete_are

from airtruth.effects.registry import EFFECTS
from airtruth.physics.terms import Change, SensorTerm, SurfaceTerm
from airtruth.tracing.calibration.corner_share import corner_share
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.reading import read
from airtruth.tracing.model.response import filter_inputs, respond
from airtruth.tracing.model.surface_path import corner_variance, read_between
from airtruth.units import DEG, G0


def test_a_step_at_a_sample_and_one_between_two():
    """The mean over a cell lies anywhere between its ends: the square of their difference over 12."""
    at_sample = corner_variance(np.array([0.0, 0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 1.0]), 0.0)
    assert at_sample == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.25 / 12, 0.25 / 12, 0.0, 0.0, 0.0])
    between = corner_variance(np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]), 0.0)
    assert between == pytest.approx([0.0, 0.0, 0.0, 0.0, 1.0 / 12, 0.0, 0.0, 0.0])


def test_what_the_samples_show_has_no_variance():
    t = np.arange(200) * 0.02
    assert corner_variance(np.sin(2.0 * np.pi * 3.0 * t), 0.0).size == 0
    noise = 0.01 * np.random.default_rng(1).standard_normal(200)
    assert corner_variance(np.sin(2.0 * np.pi * t) + noise, 0.01).size == 0
    assert corner_variance(np.zeros(200), 0.0).size == 0


def test_a_delay_of_the_surface_carries_the_corner_to_later_cells():
    made = tr.record(np.zeros((6, 3)), 0.0)
    made = replace(
        made, signals=replace(made.signals, corner_rad2=np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]))
    )
    late = filter_inputs(made, Change(surface=(SurfaceTerm("delay", 1.5 * tr.DT),)))
    assert late.corner_rad2[0] == pytest.approx([0.0, 0.0, 0.0, 0.5, 0.5, 0.0], abs=0.05)
    assert late.corner_rad2.sum() == pytest.approx(1.0, rel=0.02)
    plain = filter_inputs(made, Change())
    assert (plain.corner_rad2 == made.signals.corner_rad2).all()
    assert late.grid is not plain.grid
    assert (
        filter_inputs(made, EFFECTS["elevator_asymmetry"].change({"dCmde": 0.1})).grid is plain.grid
    )  # a term of the aircraft changes no input


def test_a_servo_that_the_samples_show_is_no_corner():
    from airtruth.logs.flight_log import FlightLog

    t = np.arange(150) * 0.02
    surface = np.where(t > 0.5, -np.expm1(-np.maximum(t - 0.5, 0.0) / 0.03), 0.0) * DEG
    for elevator, empty in ((surface, True), (np.where(t > 0.5, DEG, 0.0), False)):
        channels = {
            name: np.zeros(150) for name in ("alpha_rad", "q_rad_s", "az_m_s2", "theta_rad", "altitude_m")
        }
        channels |= {"airspeed_m_s": np.full(150, tr.V), "elevator_rad": elevator}
        log = FlightLog({}, ("a",), np.array([0, 150]), t, channels)
        assert (read(log)[0].corner_rad2.size == 0) == empty


@pytest.mark.parametrize("rate_deg_s", [250.0, 1000.0])
def test_a_servo_at_its_rate_limit_has_a_corner(rate_deg_s):
    """A step of 10 deg of a servo of 25 ms asks for 400 deg/s. Beyond the limit the mean over a cell is uncertain."""
    cells, dt, tau, fine = 16, 0.02, 0.025, 50
    rate, step = rate_deg_s * DEG, 10.0 * DEG
    path = np.zeros(100 * cells * fine + 1)
    for k in range(path.size - 1):
        command = step if k >= round(40.3 * cells * fine) else 0.0
        path[k + 1] = path[k] + np.clip((command - path[k]) / tau, -rate, rate) * dt / (cells * fine)
    samples = path[:: cells * fine]
    unlimited = read_between(samples, dt, cells, 1e-5, tau)
    assert unlimited.corner_rad2.size == 0
    made = read_between(samples, dt, cells, 1e-5, tau, rate)
    assert (made.corner_rad2.size == 0) == (rate_deg_s == 1000.0)
    np.testing.assert_array_equal(made.surface_rad, unlimited.surface_rad)
    error = (made.surface_rad - path[::fine])[:-1].reshape(100, cells).mean(axis=1)
    if rate_deg_s == 1000.0:
        assert np.abs(error[38:]).max() < 0.01 * step
        return
    limited = made.corner_rad2[1:] > 0.0
    assert set(np.flatnonzero(limited)) <= {39, 40, 41, 42}
    assert np.abs(error[40]) > 0.005 * step
    assert (np.abs(error[limited]) < 3.0 * np.sqrt(made.corner_rad2[1:][limited])).all()


def test_a_surface_at_rest_beside_a_step_stays_at_rest():
    """A step between two samples: the cubic through four samples would bend the cells beside it by a twenty-fourth of it."""
    from airtruth.logs.flight_log import FlightLog

    t = np.arange(150) * 0.05
    channels = {
        name: np.zeros(150) for name in ("alpha_rad", "q_rad_s", "az_m_s2", "theta_rad", "altitude_m")
    }
    channels |= {"airspeed_m_s": np.full(150, tr.V), "elevator_rad": np.where(t > 1.02, DEG, 0.0)}
    (signals,) = read(FlightLog({}, ("a",), np.array([0, 150]), t, channels))
    cells = (signals.elevator_rad.size - 1) // 149
    before, after = signals.elevator_rad[: 20 * cells + 1], signals.elevator_rad[21 * cells :]
    assert (before == 0.0).all()
    assert (after == DEG).all()


def test_a_step_that_two_cells_share_is_in_the_middle_of_a_ramp_and_a_step():
    """Through a sample at half of the step: a ramp has means of 1/4 and 3/4 over the two cells, a step 0 and 1."""
    from airtruth.logs.flight_log import FlightLog

    t = np.arange(150) * 0.02
    elevator = DEG * np.select([t < 0.999, t < 1.001], [0.0, 0.5], 1.0)
    channels = {
        name: np.zeros(150) for name in ("alpha_rad", "q_rad_s", "az_m_s2", "theta_rad", "altitude_m")
    }
    channels |= {"airspeed_m_s": np.full(150, tr.V), "elevator_rad": elevator}
    (signals,) = read(FlightLog({}, ("a",), np.array([0, 150]), t, channels))
    cells = (signals.elevator_rad.size - 1) // 149
    means = [
        np.trapezoid(signals.elevator_rad[k * cells : (k + 1) * cells + 1]) / cells / DEG
        for k in range(47, 53)
    ]
    assert means == pytest.approx([0.0, 0.0, 0.125, 0.875, 1.0, 1.0], abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("late", "low", "high"), [("at the samples", 0.0, 0.01), ("anywhere", 0.3, 1.0)])
def test_the_records_show_their_share_of_a_corner(late, low, high):
    """Surfaces that move in straight lines between samples, and surfaces that step once anywhere between them."""
    quiet = replace(tr.SETTINGS, noise=0.05 * tr.SETTINGS.noise)
    rng = np.random.default_rng(5)
    records = []
    for number in range(4):
        made = sharply_stepped(rng, late == "anywhere", quiet.noise, str(number))
        records.append(made)
    problem = TraceProblem(tuple(records), quiet)
    found = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    assert low <= corner_share(problem, tr.NOTHING, found.point) <= high


def kalman(made, u, corner, sigma_w):
    """Innovations over their own Cholesky factors, by a Kalman filter with a covariance of its own at each sample."""
    a, b, c, d = tr.motion(sigma_w=sigma_w)
    drive = np.zeros(8)
    drive[2] = 2.0 * tr.V / tr.LENGTH_W
    variance = np.diag(tr.SETTINGS.noise**2)
    phi, early, late = tr.discrete(a, b, tr.DT)
    noise = tr.noise_step(a, tr.DT, drive)
    share = (np.arange(400) + 0.5) / 400
    columns = np.array([expm(a * (1.0 - s) * tr.DT) @ b for s in share])
    after = (
        tr.DT * (6.0 * share * (1.0 - share)) @ columns / 400
    )  # a parabola of unit mean, zero at both samples
    spread = np.outer(after, after)
    p, x, found = solve_discrete_are(phi.T, c.T, noise, variance), np.zeros(8), []
    for k in range(made.samples):
        s = c @ p @ c.T + variance
        e = made.signals.y[k] + [0.0, 0.0, G0] - c @ x - d * u[k]
        found.append(np.linalg.solve(np.linalg.cholesky(s), e))
        gain = np.linalg.solve(s, c @ p).T
        x, p = x + gain @ e, p - gain @ c @ p
        if k + 1 < made.samples:
            x = phi @ x + early * u[k] + late * u[k + 1]
            p = phi @ p @ phi.T + noise + corner[k + 1] * spread
    return np.array(found)


def stepped(rng, sigma_w=0.3, amplitude=DEG, noise=tr.SETTINGS.noise):
    """A record whose elevator steps at two samples; the grid is linear between the samples, as a log suggests."""
    samples, parts = 100, 8
    u = np.zeros(samples)
    u[20], u[21:60], u[60] = 0.5 * amplitude, amplitude, 0.5 * amplitude
    fine = np.where(
        (np.arange(samples * parts) >= 20 * parts) & (np.arange(samples * parts) < 60 * parts), 1.0, 0.0
    )
    a, b, c, d = tr.motion(sigma_w=sigma_w)
    dt = tr.DT / parts
    phi, early, late = tr.discrete(a, b, dt)
    root = np.linalg.cholesky(
        tr.noise_step(a, dt, np.array([0, 0, 2.0 * tr.V / tr.LENGTH_W, *np.zeros(5)])) + 1e-18 * np.eye(8)
    )
    x, y = np.zeros(8), []
    for k, now in enumerate(fine * amplitude):
        if k % parts == 0:
            y.append(c @ x + d * u[k // parts] + noise * rng.standard_normal(3) - [0.0, 0.0, G0])
        x = phi @ x + (early + late) * now + root @ rng.standard_normal(8)
    t = np.arange(samples) * tr.DT
    made = tr.record(np.array(y), lambda at: np.interp(at, t, u))
    return made, u


def sharply_stepped(rng, anywhere, noise, name):
    """A record with a step every half second, in one cell each, which is a ramp or a step anywhere in it."""
    samples, parts = 200, 8
    u = np.zeros(samples)
    for k, level in zip(range(20, samples, 25), (1.0, -1.0, 0.5, -0.5, 1.5, 0.0, -1.0, 0.0), strict=True):
        u[k:] = level * DEG
    a, b, c, d = tr.motion(sigma_w=0.0)
    phi, early, late = tr.discrete(a, b, tr.DT / parts)
    x, y = np.zeros(8), []
    for k in range(samples):
        y.append(c @ x + d * u[k] + noise * rng.standard_normal(3) - [0.0, 0.0, G0])
        after = u[min(k + 1, samples - 1)]
        share = np.linspace(0.0, 1.0, parts + 1)
        path = np.where(share > rng.uniform(), 1.0, 0.0) if anywhere else share
        for j in range(parts):
            x = (
                phi @ x
                + early * (u[k] + path[j] * (after - u[k]))
                + late * (u[k] + path[j + 1] * (after - u[k]))
            )
    t = np.arange(samples) * tr.DT
    made = tr.record(np.array(y), lambda at: np.interp(at, t, u), name=name)
    return replace(made, signals=replace(made.signals, corner_rad2=corner_variance(u, 0.0)[None]))


def whitened(made, sigma_w=0.3):
    common, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(sigma_w)
    found = respond(made, tr.SETTINGS, Change(), common, per_record)
    return found.e @ found.white.T, found


def test_innovations_are_those_of_the_kalman_filter_with_the_corner_in_its_noise():
    made, u = stepped(np.random.default_rng(2))
    corner = corner_variance(u, 0.0)
    known = replace(made, signals=replace(made.signals, corner_rad2=corner[None]))
    r, found = whitened(known)
    expected = kalman(made, u, corner, 0.3)
    assert np.abs(r - expected).max() < 0.05  # curvature of the sines at a degree
    assert found.more_logdet > 0.0
    assert found.logdet == pytest.approx(np.linalg.slogdet(found.covariance)[1] + found.more_logdet / 100)


def test_a_step_between_samples_leaves_no_spike():
    """Quiet sensors see the error of an interpolated step at ten standard deviations; the corner explains it."""
    quiet = replace(tr.SETTINGS, noise=0.05 * tr.SETTINGS.noise)
    rng = np.random.default_rng(4)
    worst = {True: 0.0, False: 0.0}
    for _ in range(5):
        made, u = stepped(rng, sigma_w=0.02, noise=quiet.noise)
        common, per_record = tr.still()
        per_record[SHORT_PERIOD.per_record.log_gust] = np.log(0.02)
        for aware in worst:
            corner = corner_variance(u, 0.0) if aware else np.zeros(0)
            known = replace(made, signals=replace(made.signals, corner_rad2=corner[None]))
            found = respond(known, quiet, Change(), common, per_record)
            r = found.e @ found.white.T
            worst[aware] = max(worst[aware], float(np.abs(r[15:30]).max()))
    assert worst[False] > 8.0
    assert worst[True] < 5.0


def test_a_smooth_residual_below_the_resolution_is_no_information():
    """Innovations of a hundredth of their stated size, however smooth, keep their stated covariance."""
    from airtruth.tracing.inference.whitening import autoregression

    t = np.arange(300) * 0.05
    smooth = 0.01 * np.stack([np.sin(t), np.cos(2.0 * t), np.sin(3.0 * t)], axis=1)
    assert autoregression([smooth, smooth]).order == 0
    assert (
        autoregression([100.0 * smooth + 0.1 * np.random.default_rng(1).standard_normal((300, 3))]).order > 0
    )


def test_a_sensor_late_by_little_does_not_read_the_corner():
    """The surface is known at the samples: as a lag goes to zero, its covariance goes to that of no lag."""
    made, u = stepped(np.random.default_rng(2))
    known = replace(made, signals=replace(made.signals, corner_rad2=corner_variance(u, 0.0)[None]))
    common, own = tr.still()
    own[SHORT_PERIOD.per_record.log_gust] = np.log(0.3)
    more = [
        respond(known, tr.SETTINGS, change, common, own).more_logdet
        for change in (Change(), Change(sensors=(SensorTerm("az_m_s2", "lag", 1e-4),)))
    ]
    assert more[1] == pytest.approx(more[0], rel=0.02)


T38 = """
schema = 1
name = "t38"
aircraft = "T38"
runs = 6
seed = 77
duration_s = 8.0
log_hz = {rate}
[condition]
eas_kt = 300
altitude_ft = 10000
[gust]
level = "light"
figures = "mil-f-8785c"
[sensors]
ideal = true
[[effect]]
name = "vane_lag"
tau_s = 0.08
[[manoeuvre]]
kind = "3211"
amplitude_deg = 1.0
start_s = 1.03
step_s = 0.43
[[manoeuvre]]
kind = "doublet"
amplitude_deg = -1.0
start_s = 1.01
step_s = 0.51
"""


@pytest.mark.long
@pytest.mark.parametrize("rate", [50, 25, 20])
def test_steps_between_the_samples_of_ideal_sensors(rate, tmp_path):
    """The JSBSim T-38 has no servo, so that its surface steps. Its derivatives are those of its own linearisation."""
    from airtruth.simulation.campaign.plan import make
    from airtruth.simulation.campaign.run import fly
    from airtruth.tracing import TraceOptions, trace

    (tmp_path / "t38.toml").write_text(T38.format(rate=rate))
    fly(make(tmp_path / "t38.toml"), tmp_path / "out")
    answer = trace(tmp_path / "out", "T38", TraceOptions()).to_dict()
    (lag,) = answer["effects"]
    assert lag["name"] == "vane_lag"
    assert abs(lag["parameters"]["tau_s"]["value"] - 0.08) < 2.0 * lag["parameters"]["tau_s"]["std"]
    assert not answer["provisional"]
    found = answer["derivatives"]
    for name, std in found["after_std"].items():
        assert abs(found["after"][name] - found["declared"][name]) < 2.0 * std, name
