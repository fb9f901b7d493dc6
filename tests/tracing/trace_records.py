"""Records of the linear short period, simulated apart from the code under test, for the tests of the tracer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.linalg import expm
from scipy.signal import lfilter

from airtruth import aircraft
from airtruth.physics import short_period
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.model.parameters import SHORT_PERIOD, Parameters
from airtruth.tracing.model.plant import Engines, linear
from airtruth.tracing.model.records import FINE, Signals, TraceRecord
from airtruth.tracing.model.response import filter_inputs, filter_model, respond
from airtruth.tracing.model.settings import initial_per_record, settings_of
from airtruth.units import DEG, G0

GTM = aircraft.load("gtm")
C = GTM.constants
V, DENSITY = 42.852, 0.993
TRUTH = np.array([4.79, 31.8, 0.48, -1.785, -41.2, -1.787])
DT = 0.02
LENGTH_W = 160.0
SETTINGS = settings_of(GTM, 0.05)
ROOT_1, ROOT_2 = np.sqrt(1.5), np.sqrt(1.5) * (1.0 / np.sqrt(3.0) - 1.0)
"""w/sigma = ROOT_1 x1 + ROOT_2 x2 of MIL-F-8785C's vertical Dryden filter, states of unit drive."""
CORNERS, LEADS = np.array([2.1, 21.0, 217.0]), np.array([0.58, 0.84, 1.39])
"""rad/s and gains of what a rolloff adds: gain s/(s + corner) of x1 each."""


def plant(derivatives=TRUTH, alpha=0.0, elevator=0.0, v=V):
    weight = np.array([0.0, -C.mass_kg * G0, 0.0])
    start = np.array([alpha, 0.0, elevator])
    return linear(GTM, LONGITUDINAL, np.asarray(derivatives), 0.5 * DENSITY * v**2, start, weight)


def doublet(t, amplitude=2.0 * DEG, start=0.5, step=0.4):
    """Corners on whole samples; linear in between."""
    corners = start + np.array([0.0, 0.1, step, step + 0.2, 2.0 * step + 0.1, 2.0 * step + 0.2])
    return amplitude * np.interp(t, corners, [0.0, 1.0, 1.0, -1.0, -1.0, 0.0])


def record(y, elevator, theta=None, sub=2, dt=DT, v=V, density=DENSITY, ground=None, name="a", plant_=None):
    """A record as `records.read` makes it: y (samples, 3); elevator, theta, v, ... callables of time or constants."""
    samples = len(y)
    grid = np.arange((samples - 1) * sub + 1) * dt / sub
    fine = np.arange((samples - 1) * sub * FINE + 1) * dt / (sub * FINE)

    def on(x, t):
        return x(t) if callable(x) else np.full(t.size, float(x))

    speed = on(v, grid)
    signals = Signals(
        run_id=name,
        dt_s=dt,
        sub=sub,
        y=np.ascontiguousarray(y),
        controls_rad=on(elevator, fine)[None],
        airspeed_m_s=speed,
        ground_m_s=speed if ground is None else on(ground, grid),
        density_kg_m3=on(density, grid),
        theta_rad=on(0.0 if theta is None else theta, grid),
        altitude_m=2133.6,
        throttle=None,
    )
    return TraceRecord(signals, plant_ or plant(), LENGTH_W)


def motion(theta=TRUTH, sigma_w=0.0, rotary=0.5, rolloff=0.5, v=V):
    """A (8, 8), B (8,), C (3, 8), D (3,) of [alpha, q, w1, w2, w late, three copies of w1] about the trim, by hand.

    The air's alpha is alpha + w/V, its pitch rate q - rotary (w - late)/(tau V), tau = 4 b/(pi V).
    """
    scale = short_period.scale(C.wing_area_m2, C.chord_m, C.mass_kg, C.inertia_yy_kg_m2, v, DENSITY)
    a2, b2 = short_period.system(theta, scale)
    row = short_period.normal_force_row(theta, scale)
    tau = 4.0 * C.span_m / (np.pi * v)
    # the kernel's late gust is in units of sigma
    w = gust_row(rolloff)
    slow = rotary * sigma_w / (tau * v)
    a = np.zeros((8, 8))
    by_alpha, by_q = a2[:, 0], a2[:, 1] - np.array([1.0, 0.0])
    a[:2] = np.outer(by_alpha * sigma_w / v - by_q * slow, w)
    a[:2, :2] = a2
    a[:2, 4] = by_q * slow
    rate = v / LENGTH_W
    a[2, 2], a[3, 2], a[3, 3] = -rate, rate, -rate
    a[4] = w / tau
    a[4, 4] = -1.0 / tau
    a[5:, 2], a[5:, 5:] = CORNERS, -np.diag(CORNERS)
    c = np.zeros((3, 8))
    c[0] = sigma_w / v * w
    c[2] = (row[0] * sigma_w / v - row[1] * slow) * w
    c[0, 0], c[1, 1] = 1.0, 1.0
    c[2, :2] = row[:2]
    c[2, 4] = row[1] * slow
    return a, np.array([*b2, *np.zeros(6)]), c, np.array([0.0, 0.0, row[2]])


def gust_row(rolloff):
    """(8,) w/sigma of the states of `motion`."""
    lead = rolloff * LEADS
    return np.array([0.0, 0.0, ROOT_1 + lead.sum(), ROOT_2, 0.0, *-lead])


def discrete(a, b, dt):
    """phi, early, late of x+ = phi x + early u + late u+, exact for u linear in between (augmented expm)."""
    n = len(a)
    big = np.zeros((n + 2, n + 2))
    big[:n, :n], big[:n, n], big[n, n + 1] = a * dt, b * dt, 1.0
    e = expm(big)
    return e[:n, :n], e[:n, n] - e[:n, n + 1], e[:n, n + 1]


def noise_step(a, dt, intensity):
    """Covariance of a step's process noise (C. F. Van Loan, IEEE Trans. Automatic Control 23, 1978).

    Of a 256th of the step, doubled: exp(-a dt) has no digits left where a sensor is quick.
    """
    n = len(a)
    e = expm(np.block([[-a, np.diag(intensity)], [np.zeros((n, n)), a.T]]) * dt / 256)
    phi, q = e[n:, n:].T, e[n:, n:].T @ e[:n, n:]
    for _ in range(8):
        phi, q = phi @ phi, q + phi @ q @ phi.T
    return 0.5 * (q + q.T)


def run(a, b, c, d, u, dt, start=None, kicks=None):
    """Outputs (samples, outputs) and states of the exact discretisation."""
    phi, early, late = discrete(a, b, dt)
    x = np.zeros(len(a)) if start is None else np.array(start, dtype=float)
    states = [x]
    for k in range(len(u) - 1):
        x = phi @ x + early * u[k] + late * u[k + 1]
        if kicks is not None:
            x = x + kicks[k]
        states.append(x)
    states = np.array(states)
    return states @ c.T + np.outer(u, d), states


def fly(
    rng,
    theta=TRUTH,
    sigma_w=0.3,
    samples=200,
    noise=SETTINGS.noise,
    amplitude=2.0 * DEG,
    bias=(0.0, 0.0, 0.0),
    name="a",
    rotary=0.5,
    dt=DT,
    slow_share=0.0,
    slow_time_s=0.08,
    v=V,
    plant_=None,
):
    """A noisy record of the linear aircraft in stationary gusts, between Dryden's and von Karman's; az counts gravity.

    ``slow_share`` of the sensors' variance is correlated over ``slow_time_s``.
    """
    a, b, c, d = motion(theta, sigma_w, rotary, v=v)
    t = np.arange(samples) * dt
    intensity = np.array([0.0, 0.0, 2.0 * v / LENGTH_W, *np.zeros(5)])
    step = noise_step(a, dt, intensity)
    values, vectors = np.linalg.eigh(step)
    kicks = rng.standard_normal((samples, 8)) @ (vectors * np.sqrt(np.maximum(values, 0.0))).T
    start = np.zeros(8)
    start[2:4] = np.linalg.cholesky(np.array([[1.0, 0.5], [0.5, 0.5]])) @ rng.standard_normal(2)
    start[5:] = start[2]
    start[4] = start @ gust_row(0.5)
    y, states = run(a, b, c, d, doublet(t, amplitude), dt, start, kicks)
    attitude = np.concatenate([[0.0], np.cumsum(0.5 * dt * (states[1:, 1] + states[:-1, 1]))])
    y = (
        y
        + np.array(bias)
        + [0.0, 0.0, -9.80665]
        + np.asarray(noise) * sensor_noise(rng, y.shape, slow_share, slow_time_s, dt)
    )
    return record(
        y,
        lambda at: doublet(at, amplitude),
        lambda at: np.interp(at, t, attitude),
        name=name,
        dt=dt,
        v=v,
        plant_=plant_,
    )


def sensor_noise(rng, shape, slow_share, slow_time_s, dt):
    """Of unit variance, white and a first-order autoregression."""
    white = rng.standard_normal(shape)
    if slow_share == 0.0:
        return white
    pole = np.exp(-dt / slow_time_s)
    drive = rng.standard_normal(shape)
    drive[1:] *= np.sqrt(1.0 - pole**2)
    slow = lfilter([1.0], [1.0, -pole], drive, axis=0)
    return np.sqrt(1.0 - slow_share) * white + np.sqrt(slow_share) * slow


def problem(records, threads=1, settings=SETTINGS):
    return TraceProblem(tuple(records), settings, threads)


NOTHING = Hypothesis(Change())


def still():
    """Shared and local parameters at zero, gusts next to none."""
    local = np.zeros(SHORT_PERIOD.per_record.size)
    local[SHORT_PERIOD.per_record.log_gust] = -30.0
    return np.zeros(SHORT_PERIOD.common.size), local


def model(change=None, common=None, per_record=None, plant_=None, settings=SETTINGS):
    """The filter's model at V, without gusts and increments unless they are given."""
    none = still()
    given = filter_inputs(record(np.zeros((3, 3)), 0.0, plant_=plant_), change or Change())
    return filter_model(
        given, settings, none[0] if common is None else common, none[1] if per_record is None else per_record
    )


def point(records, sizes=(), settings=SETTINGS):
    """Where a search begins."""
    return Parameters(
        np.zeros(SHORT_PERIOD.common.size),
        np.stack([initial_per_record(r, settings) for r in records]),
        np.array(sizes, dtype=float),
    )


FORCE = 0.5 * DENSITY * V**2 * C.wing_area_m2
HALF = 0.5 * C.chord_m / V
SMALL = 1e-6 * DEG
"""Elevator so small that the filter's sines and cosines are straight to 1e-9."""
T = np.arange(151) * DT
U = doublet(T, SMALL)


def free(change=None, sub=8, amplitude=SMALL):
    """Outputs of a free run from the trim, deviations from its first sample."""
    made = record(np.zeros((len(T), 3)), lambda t: doublet(t, amplitude), sub=sub)
    common, per_record = still()
    y = -respond(made, SETTINGS, change or Change(), common, per_record, free_run=True).e
    return y - y[0]


def close(found, expected, tolerance):
    """Largest difference of a channel over its largest value."""
    error = np.abs(found - expected).max(axis=0) / np.abs(expected).max(axis=0)
    assert (error < tolerance).all(), error


def about(plant_, alpha):
    """A plant of the linear model whose tables count the angle of attack from zero, and its trim lies at ``alpha``."""
    (table,) = plant_.tables
    axes = (table.axes[0] + alpha, *table.axes[1:])
    return replace(plant_, tables=(replace(table, axes=axes),), trims={**plant_.trims, "alpha": alpha})


def curved():
    """A plant whose tables are one cell, so that forces are smooth products of the three signals."""
    rng = np.random.default_rng(3)
    (table,) = plant().tables
    base = table.values
    values = base * (1.0 + 0.2 * rng.standard_normal(base.shape))
    values[..., 0] = -0.05 + 0.02 * rng.standard_normal((2, 2, 2))
    values[..., 1] = base[..., 1] + 0.3 * rng.standard_normal((2, 2, 2))
    values[..., 2] = base[..., 2] + 0.02 * rng.standard_normal((2, 2, 2))
    axis = np.array([-1.0, 1.0])
    return replace(
        plant(),
        tables=(replace(table, axes=(axis, axis, axis), values=values),),
        constant=np.array([[30.0, -4.0, 1.5], [26.0, -7.0, 2.5]]),
        power=Engines(np.array([28.0, -5.0, 1.8]), np.array([25.0, 0.02])),
        trims={"alpha": 0.02, "elevator": -0.01, "qhat": 0.0},
        neutral_rad=np.array([-0.004]),
    )
