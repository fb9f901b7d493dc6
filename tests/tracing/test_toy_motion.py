"""A motion that the package does not know, through description, layouts, filter, fit and one effect."""

import json

import numpy as np
import pytest
from numba.core.caching import NullCache
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import least_squares
from toy_motion import ARM_M, HALF_CHORD_M, QBAR, TOY, ToyAircraft, ToyGrid, ToyPoint

from airtruth import aircraft
from airtruth.effects.effect import Effect, Parameter
from airtruth.effects.sensors import sensor_effects
from airtruth.physics import motion
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.anomalies.score_test import table
from airtruth.tracing.answer import Derivatives, Evidence, RecordNames, TraceAnswer
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.posterior import TraceProblem
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model import filter as record_filter
from airtruth.tracing.model import linearise
from airtruth.tracing.model.kernel_input import (
    EffectArrays,
    FilterModel,
    GustModel,
    KernelInput,
    SensorArrays,
)
from airtruth.tracing.model.parameters import ParameterLayout, Parameters, core_of, state_layout
from airtruth.tracing.model.plant import ForceTable, Plant
from airtruth.tracing.model.records import FINE as CELLS
from airtruth.tracing.model.records import Signals, TraceRecord
from airtruth.tracing.model.schedule import UNSCHEDULED
from airtruth.tracing.model.settings import Settings
from airtruth.tracing.model.steady import steady_filter
from airtruth.tracing.presentation.html import as_trace_html
from airtruth.tracing.presentation.text import as_trace_text
from airtruth.tracing.stage_errors import BySet, Errors, Rms

TRUTH = np.array([-0.12, -2.0, 0.05, -0.03, 0.004])
AIRSPEED_M_S, LENGTH_M, LEVEL = 40.0, 200.0, 1.5
DT_S, SUB, SAMPLES = 0.02, 4, 400
FINE = 40
"""Cells of a sample of the reference, in which the inputs are linear."""
STD = np.array([1e-3, 2e-3, 5e-2])
"""Noise of the outputs [rad, rad/s, m/s2]."""


@pytest.fixture(autouse=True)
def _uncached(monkeypatch):
    """The package's cache of compiled kernels holds none of a motion that exists here alone."""
    for kernel in (linearise._differences.__wrapped__, record_filter._innovations.__wrapped__):
        monkeypatch.setattr(kernel, "_cache", NullCache())


def model(derivatives, level=LEVEL):
    none, ints = np.empty(0), np.empty((0, 6), dtype=np.int64)
    three = np.zeros(3)
    sensors = SensorArrays(three, np.ones(3), three, three, three, STD**2, three, 1.0, three)
    return FilterModel(
        ToyAircraft(np.asarray(derivatives, dtype=float), HALF_CHORD_M),
        GustModel(level, LENGTH_M, 0.0, 0.0, 1.0),
        EffectArrays(ints, none, none, none, ints[:, :2], none, none, none),
        sensors,
        state_layout(np.empty(0, dtype=np.int64), core_of(2), three, three, slow=False),
    )


def given(y, derivatives, grid, start):
    mean = ToyPoint(*(float(x.mean()) for x in grid))
    return KernelInput(
        y, np.zeros_like(y), grid, np.empty((0, 0)), DT_S, SUB, start, 0.0, mean, model(derivatives)
    )


def inputs(sub=SUB):
    t = np.arange(SAMPLES * sub + 1) * DT_S / sub
    left, right = 0.05 * np.sin(3.0 * t), 0.04 * np.sin(1.3 * t + 1.0)
    return ToyGrid(left, right, 0.2 * np.cos(0.7 * t), np.full(t.size, AIRSPEED_M_S), np.zeros(t.size))


def linear(derivatives):
    """A, B by the controls and the wind, C and D of the four states that matter, by hand."""
    d, a = derivatives, AIRSPEED_M_S / LENGTH_M
    gain = 2.0 * QBAR
    row = gain * np.array([d[0], d[1] * HALF_CHORD_M / AIRSPEED_M_S, 0.0, d[4] * LEVEL])
    system = np.array([[0.0, 1.0, 0.0, 0.0], row, [0.0, 0.0, -a, 0.0], [0.0, 0.0, a, -a]])
    by = np.zeros((4, 3))
    by[1] = gain * d[[2, 3, 4]]
    out = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], ARM_M * row])
    direct = np.zeros((3, 3))
    direct[2] = ARM_M * by[1]
    return system, by, out, direct


def discrete(system, by, h):
    """Exact step with inputs that are linear over it: transition, gains of the values at both ends, noise of the step."""
    n, m = by.shape
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[:n, :n], whole[:n, n : n + m], whole[n : n + m, n + m :] = system, by, np.eye(m) / h
    step = expm(whole * h)
    late = step[:n, n + m :]
    noise = np.zeros((n, n))
    noise[2, 2] = 2.0 * AIRSPEED_M_S / LENGTH_M
    loan = expm(np.block([[-system, noise], [np.zeros((n, n)), system.T]]) * h)
    phi = loan[n:, n:].T
    return phi, step[:n, n : n + m] - late, late, phi @ loan[:n, n:]


def kalman(y, derivatives, start):
    """Innovations of a textbook filter with the steady gain: all three outputs in one update."""
    system, by, out, direct = linear(derivatives)
    u = np.column_stack(inputs(FINE)[:3])
    phi, _, _, noise = discrete(system, by, DT_S)
    p = solve_discrete_are(phi.T, out.T, noise, np.diag(STD**2))
    s = out @ p @ out.T + np.diag(STD**2)
    gain = p @ out.T @ np.linalg.inv(s)
    cell, early, late, _ = discrete(system, by, DT_S / FINE)
    x, found = start.copy(), []
    for k in range(SAMPLES):
        e = y[k] - out @ x - direct @ u[k * FINE]
        found.append(e)
        x = x + gain @ e
        for i in range(k * FINE, (k + 1) * FINE):
            x = cell @ x + early @ u[i] + late @ u[i + 1]
    return np.array(found), s


def flown(seed):
    """Outputs of the toy in gusts, with noise."""
    rng = np.random.default_rng(seed)
    system, by, out, direct = linear(TRUTH)
    u = np.column_stack(inputs()[:3])
    cell, early, late, noise = discrete(system, by, DT_S / SUB)
    root = np.linalg.cholesky(noise + 1e-18 * np.eye(4))
    x, y = np.zeros(4), []
    for k in range(SAMPLES):
        y.append(out @ x + direct @ u[k * SUB] + STD * rng.standard_normal(3))
        for i in range(k * SUB, (k + 1) * SUB):
            x = cell @ x + early @ u[i] + late @ u[i + 1] + root @ rng.standard_normal(4)
    return np.array(y)


def innovations(y, derivatives):
    one = given(y, derivatives, inputs(), np.zeros(4))
    steady = steady_filter(one, UNSCHEDULED)
    e = np.empty_like(y)
    sound, _ = record_filter.innovations(one, steady, e)
    assert sound
    return e, steady


@pytest.mark.slow
def test_the_filter_is_that_of_a_textbook_and_finds_the_derivatives():
    y = flown(1)
    e, steady = innovations(y, TRUTH)
    expected, covariance = kalman(y, TRUTH, np.zeros(4))
    np.testing.assert_allclose(steady.covariance, covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(e / STD, expected / STD, rtol=0.0, atol=1e-5)

    def white(derivatives):
        own, there = innovations(y, derivatives)
        return (own @ steady.white.T).ravel() if there else None

    found = least_squares(white, 0.8 * TRUTH, x_scale=np.abs(TRUTH))
    std = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    assert (np.abs(found.x - TRUTH) < 4.0 * std).all()
    assert (std[:4] < 0.2 * np.abs(TRUTH[:4])).all()


@pytest.mark.parametrize("early", [1, 2, 3])
def test_the_first_update_is_that_of_the_early_outputs(early):
    """Gain P C' S^-1 and regression of the late innovation, by numpy."""
    rng = np.random.default_rng(early)
    phi, c = 0.5 * np.eye(5), rng.standard_normal((early + 1, 5))
    noise, variance = np.eye(5), np.ones(early + 1)
    _, _, s, _, p, first = linearise.gain_of(phi, c, noise, variance)
    pc = p @ c.T
    inverse = np.linalg.inv(s[:early, :early])
    np.testing.assert_allclose(first.gain, pc[:, :early] @ inverse, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(first.share, s[early, :early] @ inverse, rtol=1e-9, atol=1e-12)


def test_parameters_follow_from_the_description():
    layout = ParameterLayout(TOY)
    assert layout.common.names[:8] == (
        *("Cptheta", "Cpq", "Cpdl", "Cpdr", "Cpw"),
        *("log_noise_theta", "log_noise_q", "log_noise_az"),
    )
    assert layout.per_record.names == (
        *("theta0", "q0", "w1", "w2", "bias_theta", "bias_q", "bias_az", "Cp0", "log_sigma_w"),
    )
    assert layout.common.step[:5].tolist() == [1e-4, 1e-2, 1e-4, 1e-4, 1e-4]
    point = Parameters(
        np.zeros(layout.common.size), np.zeros((2, layout.per_record.size)), np.zeros(1), layout
    )
    assert point.layout.total == layout.common.size + 1 + layout.per_record.size
    assert point.of_vector(point.vector).per_record.shape == (2, layout.per_record.size)


def test_effects_follow_from_the_description():
    stiffness = Effect(
        "stiffness",
        "dynamics",
        (Parameter("dCp", "-", "more of Cp by theta", -1.0, 1.0, 0.1),),
        lambda v: Change(aero=(AeroTerm("Cp", "theta", "quadratic", v["dCp"]),)),
        "A spring.",
        "None.",
    )
    assert stiffness.applies_to(TOY)
    assert not stiffness.applies_to(LONGITUDINAL)
    keys = [e.key for e in sensor_effects(TOY)]
    assert {
        "attitude_lag",
        "gyro_scale",
        "accelerometer_arm",
        "sensor_delay:left_rad",
        "sensor_delay:right_rad",
    } <= {*keys}


SETTINGS = Settings(
    noise=STD,
    noise_prior=0.1,
    bias_std=0.1 * STD,
    gust_m_s=LEVEL,
    log_gust_std=0.3,
    thrust_std=0.05,
    trim_std=np.array([1e-4]),
    resolution=np.zeros(3),
    layout=ParameterLayout(TOY),
)


def record(seed, scale):
    """A flight of the toy as the tracer reads it, with a scale of the gyro; the declared derivatives are 10 % small."""
    grid = np.arange((SAMPLES - 1) * SUB + 1) * DT_S / SUB
    fine = np.arange((SAMPLES - 1) * SUB * CELLS + 1) * DT_S / (SUB * CELLS)
    y = flown(seed)
    y[:, 1] *= scale
    signals = Signals(
        run_id=f"r{seed}",
        dt_s=DT_S,
        sub=SUB,
        y=y,
        controls_rad=np.stack([0.05 * np.sin(3.0 * fine), 0.04 * np.sin(1.3 * fine + 1.0)]),
        airspeed_m_s=np.full(grid.size, AIRSPEED_M_S),
        ground_m_s=np.full(grid.size, AIRSPEED_M_S),
        density_kg_m3=np.ones(grid.size),
        theta_rad=np.zeros(grid.size),
        altitude_m=0.0,
        throttle=None,
        motion=TOY,
        alpha_rad=0.2 * np.cos(0.7 * grid),
        control_std_rad=np.zeros(2),
        corner_rad2=np.zeros((2, 0)),
        surface_noise_rad2=np.zeros((2, 0)),
    )
    axis = np.array([-1.0, 1.0])
    plant = Plant(
        aircraft=aircraft.load("gtm"),
        motion=TOY,
        tables=(ForceTable(("alpha",), (axis,), np.zeros((2, 3))),),
        constant=np.zeros((2, 3)),
        trims=dict.fromkeys(("alpha", *(signal.name for signal in TOY.signals)), 0.0),
        neutral_rad=np.zeros(2),
        derivatives=0.9 * TRUTH,
        derivative_cov=np.diag((0.2 * TRUTH) ** 2),
        trim=None,
    )
    return TraceRecord(signals, plant, LENGTH_M)


@pytest.mark.slow
def test_a_scale_of_the_gyro_is_scored_named_and_estimated():
    problem = TraceProblem(tuple(record(seed, 1.1) for seed in (2, 3)), SETTINGS)
    effects = [e for e in sensor_effects(TOY) if e.key in ("gyro_scale", "gyro_bias", "accelerometer_scale")]
    nothing = Hypothesis(Change(), motion=TOY)
    null = fit(problem, nothing, initial_parameters(problem, nothing))
    assert null.converged
    scores = {s.effect.key: s.z for s in table(null, problem, effects, NO_WHITENER, 0).scores}
    assert max(scores, key=lambda key: abs(scores[key])) == "gyro_scale"
    (scale,) = (e for e in effects if e.key == "gyro_scale")
    with_scale = nothing.plus(scale)
    named = fit(problem, with_scale, initial_parameters(problem, with_scale))
    assert null.cost - named.cost > 10.0
    (values,) = named.hypothesis.values(named.point.sizes)
    step = scale.parameters[0].size(1.1) - scale.parameters[0].size(1.0)
    assert abs(values["factor"] - 1.1) < 4.0 * named.size_std(0) * 0.1 / abs(step)
    found = 0.9 * TRUTH + named.point.common[: TRUTH.size]
    assert (np.abs(found - TRUTH) < 4.0 * named.common_std[: TRUTH.size]).all()


def test_text_tables_and_page_follow_from_the_description(monkeypatch):
    monkeypatch.setitem(motion._MOTIONS, TOY.name, TOY)
    values = dict(zip(TOY.parameters, TRUTH.tolist(), strict=True))
    rms = Rms(dict.fromkeys(TOY.output_channels, 1.0), dict.fromkeys(TOY.output_channels, 1.0))
    effect = AcceptedEffect("gyro_scale", {"factor": ParameterEstimate(1.1, 0.01, (1.08, 1.12))}, 1e-9, 4.0)
    answer = TraceAnswer(
        verdict="traced",
        provisional=False,
        anomaly=Evidence(90.0, 1e-9),
        remaining=Evidence(5.0, 0.4),
        effects=(effect,),
        candidates=(),
        error=Errors(
            dict.fromkeys(TOY.output_channels, 2.0),
            dict.fromkeys(("declared", "before", "after", "floor"), BySet(held_out=rms)),
        ),
        derivatives=Derivatives(values, values, values, dict.fromkeys(values, 0.01)),
        updated_aircraft=None,
        detectability={},
        next_flight="",
        model="linear",
        records=RecordNames(("r1", "r2"), ("r3",)),
    )
    assert answer.motion is TOY
    text, page = as_trace_text(answer), as_trace_html(answer)
    assert "linear pendulum model" in text
    assert all(name in text for name in TOY.parameters)
    assert all(output.name in text and output.name in page for output in TOY.outputs)
    assert json.loads(answer.to_json())["derivatives"]["after"] == pytest.approx(values)
