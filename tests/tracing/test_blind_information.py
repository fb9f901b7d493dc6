"""Noncentrality and the truth's own error: cases whose value is known."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.logs.store import read_log
from validation.blind import draw, information, refit, scoring, trials
from validation.blind.aircraft_xml import Body
from validation.blind.figures import BODY, CHANNELS, NOISE
from validation.blind.flight import Truth
from validation.blind.truths import Added, Parts, combined, model

pytestmark = pytest.mark.long


def test_noncentrality_of_a_sine_in_white_noise():
    """n a^2/(2 sigma^2) over whole periods, whatever constant is free."""
    n, a = 400, 0.3
    d = a * np.sin(2.0 * np.pi * 5.0 * np.arange(n) / n)
    ones = np.ones((n, 1))
    assert information.noncentrality(d + 7.0, ones, np.zeros((n, 0))) == pytest.approx(n * a**2 / 2.0)
    # a direction that is the effect itself, known to s: 1/(1/lambda + s^2), in units of the effect
    s = 0.1
    prior = s * d[:, None]
    own = n * a**2 / 2.0
    expected = 1.0 / (1.0 / own + s**2)
    assert information.noncentrality(d, ones, prior) == pytest.approx(expected)
    assert information.noncentrality(d, np.column_stack([ones, d]), prior) == pytest.approx(0.0, abs=1e-12)


def test_the_whitener_whitens_a_known_autoregression():
    rng = np.random.default_rng(2)
    a = np.array([[0.9, 0.1, 0.0], [0.0, 0.7, 0.2], [0.0, 0.0, -0.4]])
    root = np.array([[1.0, 0.0, 0.0], [0.5, 0.8, 0.0], [0.1, -0.2, 0.5]])
    y = np.zeros((20000, 3))
    for t in range(1, len(y)):
        y[t] = a @ y[t - 1] + root @ rng.standard_normal(3)
    whiten = information.autoregression([y[:9000], y[9000:]], order=2)
    # standard errors of about 1/sqrt(20000) = 0.007 times the ratio of scales
    assert whiten.coefficients[0] == pytest.approx(a, abs=0.06)
    assert whiten.coefficients[1] == pytest.approx(np.zeros((3, 3)), abs=0.06)
    assert whiten.root @ whiten.root.T == pytest.approx(root @ root.T, abs=0.04)
    e = whiten(y)
    assert e.T @ e / len(e) == pytest.approx(np.eye(3), abs=0.04)
    assert whiten(np.array([y[:50], y[50:100]])).shape == (2, 48, 3)


@pytest.fixture(scope="module")
def calm():
    """A trial in calm air, white noise, no draws."""
    return replace(
        draw.draw(1, 0, "null"), air="calm", noise="white", body=Body(), duration_s=5.0, composition="single"
    )


def test_in_calm_air_the_whitener_divides_by_the_declared_noise(calm):
    whiten = information.noise_model(calm, "calm")
    declared = np.array([NOISE[name] for name in CHANNELS])
    # 9000 samples: a standard error of about 0.01
    assert whiten.root / declared[:, None] == pytest.approx(np.eye(3), abs=0.04)


def test_what_is_declared_with_an_uncertainty_is_bounded_by_it(calm):
    """An effect equal to k prior deviations of a nuisance: lambda at most k^2, whatever the records say."""
    for key, values, std in (
        ("inertia_error", {"factor": 1.15}, BODY["inertia"]),
        ("mass_error", {"factor": 0.95}, BODY["mass"]),
        ("cg_shift", {"dx_mac": 0.02}, BODY["cg"]),
    ):
        effect = Added(key, values)
        size = values.get("factor", 1.0) - 1.0 if "factor" in values else values["dx_mac"]
        value = refit.lambdas(replace(calm, effects=(effect,)))[key]
        assert 0.2 < value < 1.05 * (size / std) ** 2


def test_a_refit_of_a_delay_is_the_projection_to_first_order(calm):
    """What moves no trim is linear: both ways to the same noncentrality."""
    trial = replace(calm, effects=(Added("elevator_delay", {"delay_s": 0.003}),))
    whiten = information.noise_model(trial, "calm")
    along = information.directions(trial, whiten)
    d = whiten(information.difference(trial, trial.effects[0])).ravel()
    linear = information.noncentrality(d, along.free, along.prior)
    assert linear > 30.0
    assert refit.refitted(trial, trial.effects[0], (), whiten) == pytest.approx(linear, rel=0.05)


def test_a_refit_takes_up_what_the_derivatives_and_the_trim_can_imitate(calm):
    """A heavier aircraft is one with smaller lift derivatives, but for their priors and the mass's own.

    Lift over mass: CLalpha, CLq, CLde each less by the same share s; prior deviations 0.05, 0.3, 0.1 and 0.01, so
    that lambda would be s^2/(0.01^2 + 1/(0.05^-2 + 0.3^-2 + 0.1^-2)) were the imitation exact; drag, thrust and the
    curvature of the tables tell a little more.
    """
    share = np.log(1.09)
    effect = Added("mass_error", {"factor": 1.09})
    imitated = share**2 / (0.01**2 + 1.0 / (0.05**-2 + 0.3**-2 + 0.1**-2))
    whiten = information.noise_model(calm, "calm")
    found = refit.refitted(calm, effect, (), whiten)
    assert imitated < found < 2.0 * imitated
    d = whiten(information.difference(calm, effect)).ravel()
    along = information.directions(calm, whiten)
    assert information.noncentrality(d, along.free, along.prior) > 5.0 * found


def test_constants_trim_the_aircraft_where_the_effect_does(calm):
    effect = combined((Added("cg_shift", {"dx_mac": -0.06}),))
    x = refit.trimmed_alike(calm, Parts(), effect)
    aim = Truth(model(calm.body, effect), information.COARSE_S)
    found = Truth(model(calm.body, refit.constants(x)), information.COARSE_S)
    assert found.alpha_rad == pytest.approx(aim.alpha_rad, abs=1e-5)
    assert found.elevator_rad == pytest.approx(aim.elevator_rad, abs=1e-5)


def test_noncentrality_grows_as_the_square_and_falls_with_gusts(calm):
    def of(x_m, air):
        effect = Added("vane_arm", {"x_m": x_m})
        return refit.lambdas(replace(calm, effects=(effect,), air=air))["vane_arm"]

    calm_air = of(0.2, "calm")
    assert of(0.4, "calm") / calm_air == pytest.approx(4.0, rel=0.02)
    assert of(0.2, "light") < 0.5 * calm_air


def test_a_lag_and_a_delay_are_apart_as_the_fourth_power(calm):
    """exp(-ts) and 1/(1 + ts) differ by (ts)^2/2 at first, so the records tell them apart by t^4, each of them by t^2."""
    whiten = information.noise_model(calm, "calm")
    along = information.directions(calm, whiten)

    def of(tau_s):
        effect = Added("gyro_lag", {"tau_s": tau_s})
        d = whiten(information.difference(calm, effect)).ravel()
        return information.noncentrality(d, along.free, along.prior), information.apart(
            calm, effect, d, whiten, along
        )

    (alone, least), (alone_twice, twice) = of(0.005), of(0.01)
    assert alone_twice / alone == pytest.approx(4.0, rel=0.05)
    assert twice / least == pytest.approx(16.0, rel=0.1)
    assert twice < 0.02 * alone_twice


def test_beside_another_effect_the_rival_of_a_set_is_apart(calm):
    """A grid of the delay that comes nearest to a lag, everything else by numpy's least squares."""
    whiten = information.noise_model(calm, "calm")
    along = information.directions(calm, whiten)
    lag, scale = Added("gyro_lag", {"tau_s": 0.01}), Added("gyro_scale", {"factor": 1.05})

    def flown(*effects):
        return information.responses(calm, effects, information.COARSE_S)

    size = whiten(flown(scale) - flown()).ravel()
    rows = along.prior.shape[1]
    top = np.column_stack([along.free, size, along.prior])
    x = np.vstack([top, np.hstack([np.zeros((rows, top.shape[1] - rows)), np.eye(rows)])])
    x /= np.linalg.norm(x, axis=0)

    def left(delay_s):
        delay = Added("sensor_delay:q_rad_s", {"delay_s": float(delay_s)})
        d = whiten(flown(lag, scale) - flown(delay, scale)).ravel()
        y = np.concatenate([d, np.zeros(rows)])
        return float(np.sum((y - x @ np.linalg.lstsq(x, y, rcond=1e-10)[0]) ** 2))

    expected = min(left(t) for t in np.linspace(0.0095, 0.0105, 21))
    d = whiten(information.difference(calm, lag, (scale,))).ravel()
    found = information.apart(calm, lag, d, whiten, along, (scale,))
    assert found == pytest.approx(expected, rel=0.02)


def test_the_truths_own_error_is_the_noise(tmp_path):
    """A null in calm air: what its own model leaves is white noise of the declared size."""
    numbers = [k for k in range(40) if (t := draw.draw(2, k, "null")).air == "calm" and t.noise == "white"]
    trial = draw.draw(2, numbers[0], "null")
    log = read_log(trials.frozen(2, numbers[:1], "null", tmp_path)[0] / "log.parquet")
    assert log.metadata["aircraft"] == "gtm"
    assert log.run_ids == ("r1", "r2", "r3", "r4", "r5", "r6")
    records = [np.column_stack([log.channels[n][log.rows(k)] for n in CHANNELS]) for k in range(6)]
    found = information.oracle(trial, records)
    for name in CHANNELS:
        assert found["free_run"][name] == pytest.approx(NOISE[name], rel=0.12)  # 500 samples a channel
        assert found["signal"][name] > 3.0 * NOISE[name]


def test_the_bound_is_the_power_of_a_two_sided_normal_test():
    """Phi(sqrt(lambda) - z) + Phi(-sqrt(lambda) - z), z the quantile of 1 - level/2."""
    from scipy.stats import norm

    for value, level in ((4.0, 0.05), (16.0, 0.01), (30.0, 0.001)):
        z = norm.isf(level / 2.0)
        expected = norm.cdf(np.sqrt(value) - z) + norm.cdf(-np.sqrt(value) - z)
        assert scoring.bound(value, level) == pytest.approx(expected, rel=1e-9)
    assert scoring.bound(0.0, 0.01) == 0.01
