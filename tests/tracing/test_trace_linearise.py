"""The filter's linearisation, its steady gain and the Pade approximant of a delay."""

import math

import numpy as np
import pytest
import trace_records as tr
from scipy.linalg import block_diag, expm, solve_discrete_are

from airtruth.tracing.model.linearise import delay_system, gain, linearise, process_intensity
from airtruth.tracing.model.longitudinal.input import AirPoint
from airtruth.tracing.model.parameters import CORE, DELAY_ORDER, SHORT_PERIOD, state_layout

WHITE = np.array([0.0, 0.0, 0.0, 0.1])
SLOW = np.array([0.7 * tr.SETTINGS.noise[0], 0.0, 0.5 * tr.SETTINGS.noise[2], 0.08])
"""Standard deviations of the sensors' correlated noise, and its correlation time [s]."""


def linearised(lags=None, sigma_w=0.3, delays=None, colour=WHITE):
    """A, C and the model about the trim."""
    _, per_record = tr.still()
    per_record[SHORT_PERIOD.per_record.log_gust] = np.log(sigma_w)
    model = tr.model(None, None, per_record)
    lags = np.zeros(3) if lags is None else lags
    delays = np.zeros(3) if delays is None else delays
    sensors = model.sensors._replace(
        lag_s=lags, delay_s=delays, slow_std=colour[:3], slow_time_s=float(colour[3])
    )
    states = state_layout(model.states.effect, model.states.motion, lags, delays, bool(colour[:3].any()))
    model = model._replace(sensors=sensors, states=states)
    a, c = np.empty((states.size, states.size)), np.empty((3, states.size))
    at = AirPoint(0.0, tr.V, tr.V, 0.5 * tr.DENSITY * tr.V**2, 0.0, 0.0, 0.0, 0.0, 0.0)
    linearise(np.zeros(states.size), at, model, a, c)
    return a, c, model


def test_linearisation_is_the_linear_model_s():
    """Central differences over 0.01 rad: cosines cost h^2/6 of the slope."""
    a, c, _ = linearised()
    expected_a, _, expected_c, _ = tr.motion(sigma_w=0.3)
    scale = np.abs(expected_a).max(axis=1, keepdims=True)
    np.testing.assert_allclose(a / scale, expected_a / scale, atol=1e-4)
    np.testing.assert_allclose(c, expected_c, rtol=1e-4, atol=1e-6)


def test_linearisation_of_lagging_sensors():
    lags = np.array([0.05, 0.0, 0.02])
    a, c, _ = linearised(lags=lags)
    plain_a, plain_c, _ = linearised()
    np.testing.assert_array_equal(a[:8, :8], plain_a)
    np.testing.assert_allclose(a[8], [*plain_c[0] / 0.05, -20.0, 0.0])
    np.testing.assert_allclose(a[9], [*plain_c[2] / 0.02, 0.0, -50.0])
    np.testing.assert_array_equal(c, [[*np.zeros(8), 1, 0], [*plain_c[1], 0, 0], [*np.zeros(8), 0, 1]])


@pytest.mark.parametrize("sigma_w", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("colour", [WHITE, SLOW])
@pytest.mark.parametrize("delays", [np.zeros(3), np.array([0.01, 0.03, 0.0])])
def test_steady_gain_solves_the_riccati_equation(sigma_w, delays, colour):
    """K, S and the whitener against scipy's DARE with Van Loan's noise covariance; delays and correlated noise are states of
    their own.
    """
    a, c, model = linearised(sigma_w=sigma_w, delays=delays, colour=colour)
    variance = tr.SETTINGS.noise**2
    k_gain, white, s, logdet = gain(a, c, process_intensity(tr.V, model), variance, tr.DT)
    drive = np.zeros(len(a))
    drive[2] = 2.0 * tr.V / tr.LENGTH_W
    if colour is SLOW:
        drive[-3:] = 2.0 / 0.08
    q = tr.noise_step(a, tr.DT, drive)
    p = solve_discrete_are(expm(a * tr.DT).T, c.T, q + 1e-18 * np.eye(len(a)), np.diag(variance))
    expected = c @ p @ c.T + np.diag(variance)
    spread = np.sqrt(np.diag(expected))
    unit = np.outer(spread, spread)
    np.testing.assert_allclose(s / unit, expected / unit, atol=1e-6)
    scale = np.sqrt(np.diag(p))[:, None] / spread
    expected_gain = p @ np.linalg.solve(expected, c).T
    np.testing.assert_allclose(k_gain / scale, expected_gain / scale, atol=1e-5)
    np.testing.assert_allclose(white @ s @ white.T, np.eye(3), atol=1e-12)
    assert logdet == pytest.approx(np.linalg.slogdet(s)[1], rel=1e-12)


def test_linearisation_of_slow_noise():
    """Three states of their own behind the motion's and the sensors'."""
    lags = np.array([0.05, 0.0, 0.0])
    a, c, _ = linearised(lags=lags, colour=SLOW)
    plain_a, plain_c, _ = linearised(lags=lags)
    np.testing.assert_array_equal(a, block_diag(plain_a, -12.5 * np.eye(3)))
    np.testing.assert_array_equal(c, np.hstack([plain_c, np.diag(SLOW[:3])]))


def test_linearisation_of_late_sensors():
    """Transfer functions with and without the delay: their ratio is exp(-s d)."""
    delays = np.array([0.03, 0.0, 0.0])
    a, c, _ = linearised(delays=delays)
    plain_a, plain_c, _ = linearised()
    n = len(a)
    for w in (0.5, 5.0, 20.0):
        s = 1j * w
        late = c[0] @ np.linalg.inv(s * np.eye(n) - a)[:, 1]
        plain = plain_c[0] @ np.linalg.inv(s * np.eye(CORE) - plain_a)[:, 1]
        assert late / plain == pytest.approx(np.exp(-0.03 * s), abs=1e-9)


@pytest.mark.parametrize(("phase_rad", "error"), [(1.0, 1e-12), (5.0, 1e-6), (8.0, 1e-3), (11.0, 0.02)])
def test_a_delay_is_one_up_to_many_samples(phase_rad, error):
    """exp(-s) itself; and 60 ms at 25 Hz is a phase of 9.4 rad."""
    system = delay_system(0.02)
    taken = np.zeros(DELAY_ORDER)
    taken[1::2] = -2.0
    s = 1j * phase_rad / 0.02
    ratio = 1.0 + taken @ np.linalg.solve(s * np.eye(DELAY_ORDER) - system[:, :-1], system[:, -1])
    assert abs(ratio) == pytest.approx(1.0, abs=1e-12)
    assert ratio == pytest.approx(np.exp(-1j * phase_rad), abs=error)


def test_a_delay_is_pade_s_approximant():
    """Coefficients (2n - k)! n! / ((2n)! k! (n - k)!) of the diagonal approximant of order n."""
    n = DELAY_ORDER
    c = [math.comb(n, k) * math.factorial(2 * n - k) / math.factorial(2 * n) for k in range(n + 1)]
    system = delay_system(1.0)
    poles = np.linalg.eigvals(system[:, :-1])
    roots = np.roots(c[::-1])
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(roots), rtol=1e-8)
