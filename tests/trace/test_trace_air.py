"""The spectrum of the air: against covariances written by hand, and told from records in either air."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scipy.integrate import quad
from scipy.linalg import expm, solve_continuous_lyapunov

from airtruth.effects.change import Change
from airtruth.physics import short_period
from airtruth.trace import air
from airtruth.trace.air import DRYDEN, Air
from airtruth.trace.fit import begin, fit
from airtruth.trace.holdout import air_of, assess, explained
from airtruth.trace.lower import lower
from airtruth.trace.records import Record

SAMPLES, SIGMA = 120, 0.6
INNER = [0, 1, 4]


def von_karman(omega):
    """One-sided, unit variance, MIL-F-8785C 3.7.1.1."""
    x = (1.339 * tr.LENGTH_W * omega / tr.V) ** 2
    return tr.LENGTH_W / (np.pi * tr.V) * (1.0 + 8.0 / 3.0 * x) / (1.0 + x) ** (11.0 / 6.0)


def dryden(omega):
    """One-sided, unit variance, MIL-F-8785C 3.7.1.2."""
    x = (tr.LENGTH_W * omega / tr.V) ** 2
    return tr.LENGTH_W / (np.pi * tr.V) * (1.0 + 3.0 * x) / (1.0 + x) ** 2


def by_hand(spectrum, sigma):
    """Root mean squares of a free run in gusts once its own parameters are fitted, by dense covariances.

    The covariance of the outputs is the cosine transform of transfer function times spectrum, on a
    logarithmic grid; that of the residuals follows from the ridge regression on responses written by hand.
    """
    a, _, c, _ = tr.motion(sigma_w=sigma)
    drive = np.diag([0.0, 0.0, 2.0 * tr.V / tr.LENGTH_W, 0.0, 0.0])
    stationary = c @ solve_continuous_lyapunov(a, -drive) @ c.T
    weight = 1.0 / np.sqrt(np.diag(stationary) + tr.SETTINGS.noise**2)

    inner, by_gust, out_gust = a[np.ix_(INNER, INNER)], a[INNER, 2] / tr.ROOT_1, c[:, 2] / tr.ROOT_1
    edges = np.geomspace(1e-3, 1e4, 6001)
    omega = np.sqrt(edges[1:] * edges[:-1])
    g = np.linalg.solve(1j * omega[:, None, None] * np.eye(3) - inner, by_gust[:, None])
    g = (c[:, INNER] @ g)[..., 0] + out_gust
    power = g[:, :, None] * g[:, None, :].conj() * (spectrum(omega) * np.diff(edges))[:, None, None]
    lags = np.arange(SAMPLES) * tr.DT
    turn = np.exp(1j * np.outer(lags, omega))
    r = np.einsum("tf,fij->tij", turn, power).real
    full = np.empty((SAMPLES, 3, SAMPLES, 3))
    for i in range(SAMPLES):
        for j in range(SAMPLES):
            full[i, :, j, :] = r[i - j] if i >= j else r[j - i].T
    full = full.reshape(3 * SAMPLES, -1) + np.diag(np.tile(tr.SETTINGS.noise**2, SAMPLES))

    a2, c2 = a[:2, :2], c[:, :2]
    columns = [np.array([c2 @ expm(a2 * t) @ e for t in lags]) for e in np.eye(2)]
    columns += [np.tile(e, (SAMPLES, 1)) for e in np.eye(3)]
    for unit in (np.eye(6)[2], np.eye(6)[5]):  # CL, Cm: as an elevator of 1 rad with that derivative alone
        b = short_period.system(unit, tr.SCALE)[1]
        through = short_period.normal_force_row(unit, tr.SCALE)[2]
        settled = -np.linalg.solve(a2, b)
        response = np.array([c2 @ (settled - expm(a2 * t) @ settled) for t in lags])
        columns.append(response + np.array([0.0, 0.0, through]))
    t = np.array([(x * weight).ravel() for x in columns])
    std = np.concatenate([[0.05, 0.2], tr.SETTINGS.bias_std, tr.SETTINGS.offset_std])
    left = np.eye(3 * SAMPLES) - t.T @ np.linalg.solve(t @ t.T + np.diag(std**-2.0), t)
    scale = np.tile(weight, SAMPLES)
    spread = np.diag(left @ (full * np.outer(scale, scale)) @ left.T).reshape(SAMPLES, 3)
    return np.sqrt(spread.mean(axis=0)) / weight


@pytest.mark.parametrize(("kind", "spectrum"), [(DRYDEN, dryden), (Air(True, 1.0), von_karman)])
def test_explained_is_the_covariance_after_the_fit_of_the_record_s_own_parameters(kind, spectrum):
    made = tr.fly(np.random.default_rng(41), sigma_w=SIGMA, samples=SAMPLES)
    problem = tr.problem([made])
    shared, local = tr.still()
    local[9] = np.log(SIGMA)
    found = explained(made, problem, lower(Change()), shared, local, kind, 0)
    # 128 records: a standard error of 3 % with the few degrees of freedom of slow gusts
    np.testing.assert_allclose(found, by_hand(spectrum, SIGMA), rtol=0.1)


def test_level_scales_the_variance():
    made = tr.fly(np.random.default_rng(41), sigma_w=SIGMA, samples=SAMPLES)
    m = air.motion(made, tr.SETTINGS, lower(Change()), *tr.still())
    one = air.gusts(Air(True, 1.0), m, tr.DT, 50, 3, np.random.default_rng(1))
    four = air.gusts(Air(True, 4.0), m, tr.DT, 50, 3, np.random.default_rng(1))
    np.testing.assert_allclose(four, 2.0 * one, rtol=1e-12)


@pytest.mark.parametrize(("kind", "spectrum"), [(DRYDEN, dryden), (Air(True, 1.0), von_karman)])
def test_gusts_have_the_covariance_of_their_spectrum(kind, spectrum):
    """Increments over 0.02 to 1 s, up to the frequency to which lines are folded."""
    made = tr.fly(np.random.default_rng(41), sigma_w=SIGMA, samples=SAMPLES)
    m = air.motion(made, tr.SETTINGS, lower(Change()), *tr.still())
    w = air.gusts(kind, m, tr.DT, 400, 2000, np.random.default_rng(2))
    highest = np.log(4.5 * 2.0 * np.pi / tr.DT)
    for lag in (1, 5, 50):
        expected = quad(
            lambda s, lag=lag: (
                2.0 * np.exp(s) * spectrum(np.exp(s)) * (1.0 - np.cos(np.exp(s) * lag * tr.DT))
            ),
            -12.0,
            highest,
            limit=4000,
        )[0]
        assert ((w[lag:] - w[:-lag]) ** 2).mean() == pytest.approx(expected, rel=0.03)


def flown(spectrum, rng, name):
    """A record in air of any spectrum: a sum of waves of random phase, each with its own steady response."""
    made = tr.fly(rng, sigma_w=1e-6, samples=300, name=name)
    a, _, c, _ = tr.motion(sigma_w=SIGMA)
    inner, by_gust, out_gust = a[np.ix_(INNER, INNER)], a[INNER, 2] / tr.ROOT_1, c[:, 2] / tr.ROOT_1
    edges = np.geomspace(0.01, 600.0, 1500)
    omega = np.sqrt(edges[1:] * edges[:-1])
    g = np.linalg.solve(1j * omega[:, None, None] * np.eye(3) - inner, by_gust[:, None])
    g = (c[:, INNER] @ g)[..., 0] + out_gust
    size = np.sqrt(spectrum(omega) * np.diff(edges)) * (
        rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size)
    )
    y = (np.exp(1j * np.outer(np.arange(300) * tr.DT, omega)) @ (g * size[:, None])).real
    return Record(replace(made.signals, y=made.signals.y + y), made.plant)


@pytest.mark.parametrize("spectrum", [dryden, von_karman])
def test_the_air_is_known_by_the_innovations_and_the_floor_is_that_of_free_runs(spectrum):
    """Four records of 6 s: the spectrum is found, and measured free runs lie at the floor, not at 0.7 of it."""
    rng = np.random.default_rng(43)
    problem = tr.problem([flown(spectrum, rng, str(i)) for i in range(4)])
    found = fit(problem, tr.NOTHING, begin(problem, tr.NOTHING))
    none = np.zeros(0)
    assessed = [
        assess(problem, i, tr.NOTHING, found.point.shared, none, found.point.local[i]) for i in range(4)
    ]
    known = air_of(problem, tr.NOTHING, found.point.shared, none, assessed)
    assert known.von_karman == (spectrum is von_karman)
    low = lower(Change())
    floors = [
        explained(r, problem, low, found.point.shared, a.local, known, i)
        for i, (r, a) in enumerate(zip(problem.records, assessed, strict=True))
    ]
    measured = np.mean([a.free_run**2 for a in assessed], axis=0)
    ratio = np.sqrt(measured / np.mean(np.square(floors), axis=0))
    # four records of a few correlation times: 10 % is one standard error
    np.testing.assert_allclose(ratio, 1.0, atol=0.25)
