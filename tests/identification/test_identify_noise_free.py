"""Noise-free records: what each estimator returns where the answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import METHODS, Options, Status, identify_batch, linear_auxiliary
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.short_period import system
from validation.linear_flight import DEG, GTM, SERVO_RAD_S, THETA, fly, gtm_scale

TIGHT = Options(tolerance=1e-9, covariance="none")


def bias_percent(batch, method, options=TIGHT):
    estimates = identify_batch(batch, GTM, method, options)
    assert estimates.converged.all()
    return 100.0 * (estimates.theta / THETA - 1.0)


@pytest.mark.parametrize("method", ["iv-f1", "iv-f2"])
@pytest.mark.parametrize("delay_s", [0.0, 0.005, 0.010, 0.015])
def test_dynamic_filters_are_unbiased(method, delay_s):
    """The bar is 0.1 % on Cm and 0.5 % on CL at 50 Hz; 0.02 % is reached, whatever the servo's delay."""
    assert np.abs(bias_percent(fly(delay_s=delay_s), method)).max() < 0.02


@pytest.mark.parametrize("method", ["iv-f1", "iv-f2", "iv-frequency"])
@pytest.mark.parametrize("delay_s", [0.015, 0.03])
def test_a_declared_servo_that_settles_within_three_samples_costs_no_accuracy(method, delay_s):
    """A servo of 5 Hz at 20 Hz: 0.1 % on Cmalpha, Cmq and Cmde, with steps inside cells."""
    batch = replace(fly(rate_hz=20, delay_s=delay_s, duration_s=8.0), servo_s=1.0 / SERVO_RAD_S)
    assert np.abs(bias_percent(batch, method)[0, 3:]).max() < 0.1


@pytest.mark.parametrize("method", ["iv-f1", "iv-f2"])
def test_dynamic_filters_take_a_record_that_starts_in_motion(method):
    """Cut at 1.7 s, in the middle of the manoeuvre: the start is no transient of the filter."""
    batch = fly(first_s=1.7, duration_s=7.0)
    assert np.abs(batch.channels["q_rad_s"][0, 0]) > 0.05
    assert np.abs(bias_percent(batch, method)).max() < 0.15


@pytest.mark.parametrize("method", ["iv-f1", "iv-f2"])
def test_a_trim_window_is_as_good(method):
    options = replace(TIGHT, trim="mean", trim_window_s=0.98)
    assert np.abs(bias_percent(fly(), method, options)).max() < 0.02


@pytest.mark.parametrize("method", ["ls", "iv-lowpass"])
def test_differencing_costs_what_central_differences_predict(method):
    """-1.15 % on Cmq and -0.81 % on Cmde at 50 Hz by independent prototypes; a sixteenth at 200 Hz."""
    at_50, at_100, at_200 = (bias_percent(fly(rate_hz=rate), method)[0] for rate in (50, 100, 200))
    assert at_50[4] == pytest.approx(-1.15, abs=0.01)
    assert at_50[5] == pytest.approx(-0.81, abs=0.01)
    for fine, ratio in ((at_100, 4.0), (at_200, 16.0)):
        assert at_50[4:] / fine[4:] == pytest.approx([ratio, ratio], rel=0.05)
    assert np.abs(at_50[[0, 2, 3]]).max() < 0.06
    assert abs(at_50[1]) < 0.3


def test_the_bias_of_ls_is_that_of_its_differences_alone():
    """The same regression on the exact q_dot, low-passed alike, is exact; the gap of the two right-hand
    sides, regressed on X, is the bias."""
    batch = fly()
    a, b = system(THETA, gtm_scale())
    names = ("alpha_rad", "q_rad_s", "elevator_rad")
    raw = np.stack([batch.channels[n][0] - batch.channels[n][0, 0] for n in names])
    sos = butterworth(5.0, 4, 0.02)
    smooth = zero_phase(raw, sos)
    x = np.vstack([smooth[:, 1:-1], np.ones(248)]).T
    exact = zero_phase((a[1] @ raw[:2] + b[1] * raw[2])[None], sos)[0]
    differences = (smooth[1, 2:] - smooth[1, :-2]) / 0.04
    by_exact = np.linalg.lstsq(x, exact[1:-1])[0]
    assert by_exact[:3] == pytest.approx([a[1, 0], a[1, 1], b[1]], rel=1e-9)
    gap = np.linalg.lstsq(x, differences - exact[1:-1])[0][:3]
    predicted = 100.0 * gap / by_exact[:3]
    assert bias_percent(batch, "ls")[0, 3:] == pytest.approx(predicted, abs=1e-6)


def test_reference_as_instrument_is_right_and_as_regressor_is_not():
    """The finding of the fact sheet: de_r in X too gives Cm far off, as the paper's table 1 shows."""
    batch = fly(delay_s=0.015)
    assert np.abs(bias_percent(batch, "iv-reference")).max() < 1.5
    theta = identify_batch(batch, GTM, "iv-reference-regressor", TIGHT).theta[0]
    # the paper prints -1.325 (0.058), -21.04 (2.517), -1.293 (0.055)
    assert -1.55 < theta[3] < -1.3
    assert -24.0 < theta[4] < -19.0
    assert -1.4 < theta[5] < -1.15


@pytest.mark.parametrize("method", ["iv-actuator", "iv-actuator-regressor"])
def test_the_identified_actuator_stands_in_for_the_surface(method):
    """Without delay the servo is of first order, and the estimate that of the measured surface."""
    assert np.abs(bias_percent(fly(), method) - bias_percent(fly(), "iv-lowpass")).max() < 0.3


@pytest.mark.parametrize("method", [m for m in METHODS if m not in ("ls", "iv-kalman") and METHODS[m].pose])
def test_an_auxiliary_model_may_be_passed_in(method):
    """The linear model as a callable gives what the built-in one gives; another one is really used."""
    batch = fly(runs=2, gust=1.0, noise=1.0, seed=8)
    own = identify_batch(batch, GTM, method, TIGHT)
    passed = identify_batch(batch, GTM, method, replace(TIGHT, auxiliary=linear_auxiliary))
    np.testing.assert_allclose(passed.theta, own.theta, rtol=1e-9 if method[:4] != "iv-f" else 1e-2)

    def stiffer(theta, u, dt_s, scale):
        return linear_auxiliary(theta * 1.3, u, dt_s, scale)

    other = identify_batch(batch, GTM, method, replace(TIGHT, auxiliary=stiffer))
    assert (np.abs(other.theta - own.theta) > 1e-6).any()


@pytest.mark.parametrize("method", ["iv-reference", "iv-lowpass", "iv-f1"])
def test_an_auxiliary_model_may_move_the_elevator_itself(method):
    """A simulated loop returns the elevator too: here one of 1.1 times the input, as instrument alone."""
    batch = fly(runs=2, gust=1.0, noise=1.0, seed=9)

    def loop(theta, u, dt_s, scale):
        return (*linear_auxiliary(theta, u, dt_s, scale), u * 1.1)

    own = identify_batch(batch, GTM, method, TIGHT)
    passed = identify_batch(batch, GTM, method, replace(TIGHT, auxiliary=loop))
    # a scale of an instrument changes no IV estimate
    tolerance = (
        1e-9 if method != "iv-f1" else 2e-2
    )  # the elevator's instrument is then linear between samples
    np.testing.assert_allclose(passed.theta, own.theta, rtol=tolerance)

    def dead(theta, u, dt_s, scale):
        return (*linear_auxiliary(theta, u, dt_s, scale), np.zeros_like(u))

    assert (
        identify_batch(batch, GTM, method, replace(TIGHT, auxiliary=dead)).status == Status.SINGULAR
    ).all()


def test_a_statically_unstable_aircraft_is_identified():
    """Cmalpha +0.6: the motion diverges slowly, the filter is mirrored, the answer stays right."""
    theta = THETA.copy()
    theta[3] = 0.6
    batch = fly(theta=theta, amplitude_rad=0.5 * DEG)
    a, _ = system(theta, gtm_scale())
    assert np.linalg.eigvals(a).real.max() > 0.0
    for method in ("iv-f1", "iv-f2"):
        estimates = identify_batch(batch, GTM, method, TIGHT)
        assert estimates.converged.all()
        np.testing.assert_allclose(estimates.theta[0], theta, rtol=2e-3)
