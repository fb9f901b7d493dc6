"""Filter error and output error as methods of identification."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth import aircraft
from airtruth.identification import Options, Status, identify, identify_batch, identify_joint, quantities
from airtruth.identification.likelihood.cramer_rao import experiment_bound
from airtruth.identification.likelihood.fit import fit
from airtruth.identification.likelihood.method import sensor_noise
from airtruth.identification.likelihood.options import FilterOptions
from airtruth.identification.regression import solve as regression_module
from airtruth.logs.flight_log import Batch
from airtruth.units import G0
from validation.linear_flight import (
    AIRSPEED_M_S,
    GTM,
    LIGHT,
    NOISE,
    THETA,
    as_log,
    fly,
    gtm_scale,
    with_channel,
)

AIRSPEED_STD_M_S = 0.0309  # 0.06 kt
CONSTANT = Options(pressure="constant")


def declared(gust, **more):
    levels = (*NOISE[:3], LIGHT[0] * gust, LIGHT[1] * gust, LIGHT[2], LIGHT[3])
    return FilterOptions(*levels, **more)


def rmse(estimates):
    return np.sqrt(((estimates.theta - THETA) ** 2).mean(axis=0))


def covered(estimates):
    q = quantities(estimates)
    return ((q.lower[:, :6] < THETA) & (q.upper[:, :6] > THETA)).mean(axis=0)


@pytest.mark.slow
@pytest.mark.parametrize("gust", [0.0, 1.0, 4.3])
def test_levels_unknown_from_calm_to_severe(gust):
    """Nothing declared but the log: all converge, near the bound; 95 % of 150 runs is known to 1.8 points."""
    batch = fly(runs=150, gust=gust, noise=1.0, seed=81)
    estimates = identify_batch(batch, GTM, "filter-error", CONSTANT)
    assert estimates.converged.all()
    least = np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, declared(gust))[0]))
    # a spread of 150 runs is known to 6 %
    assert (rmse(estimates) < 1.3 * least).all(), rmse(estimates) / least
    assert (covered(estimates) > 0.88).all(), covered(estimates)


@pytest.mark.slow
def test_measured_airspeed_explains_the_gust_u():
    """Dynamic pressure follows the gust: near the bound of a filter with airspeed as an output."""
    batch = fly(runs=150, gust=2.0, noise=1.0, seed=82, acting=True, airspeed_std_m_s=AIRSPEED_STD_M_S)
    estimates = identify_batch(batch, GTM, "filter-error")
    options = declared(2.0, airspeed_std_m_s=AIRSPEED_STD_M_S, airspeed_m_s=AIRSPEED_M_S)
    least = np.sqrt(np.diag(experiment_bound(fly(), GTM, THETA, options)[0]))
    assert estimates.converged.all()
    assert (rmse(estimates) < 1.3 * least).all(), rmse(estimates) / least
    assert (covered(estimates) > 0.88).all(), covered(estimates)
    constant = identify_batch(batch, GTM, "filter-error", CONSTANT)
    assert (rmse(constant)[:3] > 2.0 * rmse(estimates)[:3]).all()


def in_a_gust_u(still, u_m_s, rate_hz):
    """The elevator of a record flown through a gust u(t): Newton's law over ground, forces by the air.

    The aircraft keeps its speed over ground; what climbs in the air is its vertical speed over V + u.
    """
    s = gtm_scale()
    t_s, elevator = still.t_s[0], still.channels["elevator_rad"][0]
    elevator = elevator - elevator[0]

    def air(t, pitch, climb_m_s, q):
        v = 1.0 + u_m_s(t) / AIRSPEED_M_S
        alpha = pitch - climb_m_s / (AIRSPEED_M_S * v)
        x = np.array([alpha, s.half_chord_time * q / v, np.interp(t, t_s, elevator)])
        return alpha, v**2 * (s.normal * (THETA[:3] @ x) + G0), v**2 * s.moment * (THETA[3:] @ x)

    def slope(t, state):
        _, lift, moment = air(t, *state)
        return [state[2], lift - G0, moment]

    kept = t_s[:: round(1.0 / (rate_hz * still.dt_s))]
    solved = solve_ivp(
        slope, (0.0, t_s[-1]), [0.0, 0.0, 0.0], t_eval=kept, rtol=1e-9, atol=1e-12, max_step=0.005
    )
    alpha, lift, _ = np.array([air(t, *state) for t, state in zip(kept, solved.y.T, strict=True)]).T
    made = {"alpha_rad": alpha, "q_rad_s": solved.y[2], "az_m_s2": -lift}
    made |= {"airspeed_m_s": AIRSPEED_M_S + u_m_s(kept), "elevator_rad": np.interp(kept, t_s, elevator)}
    made["density_kg_m3"] = np.full(kept.size, still.channels["density_kg_m3"][0, 0])
    return Batch(("gust",), 1.0 / rate_hz, kept[None], {n: x[None].copy() for n, x in made.items()})


def test_measured_pressure_gives_the_truth_without_noise():
    """Airspeed rises by 7 %; what is left is the turn of the path by that, gamma V'/V, and interpolation."""
    batch = in_a_gust_u(fly(rate_hz=1000), lambda t: 3.0 * np.sin(2.0 * np.pi * 0.05 * t), 50)
    options = declared(0.0, level_prior=None, tolerance=1e-6)
    start = THETA[None] * 1.1
    measured = fit(batch, GTM, start, replace(options, pressure="measured"))
    np.testing.assert_allclose(measured.theta[0], THETA, rtol=5e-3)
    assert (np.abs(fit(batch, GTM, start, options).theta[0] / THETA - 1.0) > 0.02).any()


@pytest.mark.slow
def test_an_airspeed_that_shows_no_gust_costs_nothing():
    """The log's airspeed is constant while u acts on lift: the gust u stays in the model and explains it."""
    batch = fly(runs=60, gust=2.0, noise=1.0, seed=84)
    measured, constant = (identify_batch(batch, GTM, "filter-error", o) for o in (Options(), CONSTANT))
    assert measured.converged.all()
    np.testing.assert_allclose(rmse(measured), rmse(constant), rtol=0.05)


@pytest.mark.parametrize("name", ["filter-error", "output-error"])
def test_records_without_noise_converge_to_the_truth(name):
    estimates = identify_batch(fly(), GTM, name)
    assert estimates.converged.all()
    np.testing.assert_allclose(estimates.theta[0], THETA, rtol=2e-4)


def test_output_error_is_less_than_filter_error_in_gusts():
    batch = fly(runs=60, gust=2.0, noise=1.0, seed=85)
    both = [rmse(identify_batch(batch, GTM, n, CONSTANT)) for n in ("output-error", "filter-error")]
    assert (both[0] > 2.0 * both[1]).all()


@pytest.mark.parametrize("name", ["filter-error", "output-error"])
def test_joint_estimates_are_sharper(name):
    parts = [
        fly(runs=6, gust=1.0, noise=1.0, seed=86),
        fly(runs=5, gust=1.0, noise=1.0, seed=87, rate_hz=100),
    ]
    joint = identify_joint(parts, GTM, name)
    single = identify_batch(parts[0], GTM, name)
    assert joint.status[0] == Status.CONVERGED
    spread = np.sqrt(np.diag(joint.covariance[0]))
    each = np.sqrt(np.einsum("rii->ri", single.covariance)).mean(axis=0)
    assert (spread < 0.5 * each).all()


def test_noise_is_that_of_aircraft_toml_or_of_the_record():
    """The GTM's file states what the records have; without a file, third differences tell it in calm air."""
    batch = fly(runs=40, gust=2.0, noise=1.0, seed=88)
    gtm = aircraft.load("gtm")
    np.testing.assert_allclose(sensor_noise(batch, gtm), np.tile(NOISE[:3], (40, 1)), rtol=1e-3)
    calm = fly(runs=40, noise=1.0, seed=88)
    np.testing.assert_allclose(sensor_noise(calm, GTM).mean(axis=0), NOISE[:3], rtol=0.1)


def test_a_result_depends_on_its_run_alone(monkeypatch):
    batch = fly(runs=5, gust=2.0, noise=1.0, seed=89)
    whole = identify_batch(batch, GTM, "filter-error")
    monkeypatch.setattr(regression_module, "CHUNK_SAMPLES", 2 * 250)
    cut = identify_batch(batch, GTM, "filter-error")
    np.testing.assert_allclose(cut.theta, whole.theta, rtol=1e-9)
    assert cut.run_ids == whole.run_ids


def test_both_stand_in_a_table_of_estimates():
    log = as_log(fly(runs=2, gust=1.0, noise=1.0, seed=90))
    table = identify(log, GTM, ["iv-f1", "filter-error", "output-error"]).to_frame()
    assert list(table["method"]) == ["iv-f1", "filter-error", "output-error"] * 2
    assert table["converged"].all()
    assert (table["Cmq_lower"] < table["Cmq"]).all()


def test_a_start_that_fails_is_reported_with_a_sentence():
    batch = fly(runs=2, gust=1.0, noise=1.0, seed=91)
    dead = batch.channels["elevator_rad"].copy()
    dead[0] = 0.0
    for name in ("alpha_rad", "q_rad_s", "az_m_s2"):
        values = batch.channels[name].copy()
        values[0] = values[0, 0]
        batch = with_channel(batch, name, values)
    estimates = identify_batch(with_channel(batch, "elevator_rad", dead), GTM, "filter-error")
    assert not estimates.converged[0]
    assert estimates.converged[1]
