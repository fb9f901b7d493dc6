"""Effects in the model: a record less the response to known increments is the linear aircraft's record."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from airtruth import aircraft
from airtruth.effects.change import AeroTerm, Change, SensorTerm, StateTerm, SurfaceTerm
from airtruth.errors import ConfigurationError
from airtruth.identify import Options, identify_log
from airtruth.logs.flight_log import FlightLog
from airtruth.physics import short_period
from airtruth.physics.short_period import PARAMETERS
from airtruth.trace import TraceOptions, traced
from airtruth.trace.corrected import (
    Correction,
    check,
    corrected_log,
    correction,
    identify_corrected,
    increments,
    response,
    state,
    trim_alpha,
)
from airtruth.trace.prepare import prepare
from airtruth.units import DEG, G0

GTM = aircraft.load("gtm")
TRUTH = np.array([4.79, 31.8, 0.48, -1.785, -41.2, -1.787])
V, DENSITY = 42.852, 0.993
TRIM_ALPHA, TRIM_ELEVATOR = 5.56 * DEG, 0.1 * DEG
TERMS = (
    AeroTerm("Cm", "alpha", "above", 0.46, 0.44 * DEG),
    AeroTerm("CL", "alpha", "above", -0.31, 0.44 * DEG),
    AeroTerm("Cm", "elevator", "below", -0.15),
)
"""Those of docs/paper.md, in round figures."""
SCALE = short_period.scale(
    GTM.constants.wing_area_m2,
    GTM.constants.chord_m,
    GTM.constants.mass_kg,
    GTM.constants.inertia_yy_kg_m2,
    V,
    DENSITY,
)
FINE = 20


def elevator(t, amplitude, start=1.0):
    """A doublet of 0.5 s steps through a first-order servo of 5 Hz [rad], about zero."""
    edges = start + np.array([0.0, 0.5, 1.0])
    steps = amplitude * np.array([1.0, -2.0, 1.0])
    after = [np.where(t > e, 1.0 - np.exp(-2.0 * np.pi * 5.0 * np.maximum(t - e, 0.0)), 0.0) for e in edges]
    return sum(s * a for s, a in zip(steps, after, strict=True))


def command(n, amplitude, start=1.0):
    """What the servo follows."""
    t = 0.02 * np.arange(n)
    first, second = (t >= start) & (t < start + 0.5), (t >= start + 0.5) & (t < start + 1.0)
    return amplitude * (first.astype(float) - second)


def shape(term, s):
    return {
        "above": max(0.0, s - term.at),
        "below": min(0.0, s - term.at),
        "linear": s - term.at,
        "quadratic": (s - term.at) ** 2,
    }[term.shape]


def fly(terms, amplitude, duration_s=6.0, dt_s=0.02):
    """Runge-Kutta at 1 kHz of the short period with further terms, apart from the code under test."""
    h = dt_s / FINE
    n = round(duration_s / dt_s) + 1
    s, hat = SCALE, float(SCALE.half_chord_time)
    rest = TRIM_ELEVATOR

    def coefficients(x, de):
        motion = np.array([x[0], hat * x[1], de])
        lift, moment = float(TRUTH[:3] @ motion), float(TRUTH[3:] @ motion)
        for term in terms:
            signal = x[0] if term.signal == "alpha" else rest + de
            more = term.amplitude * (
                shape(term, signal) - shape(term, 0.0 if term.signal == "alpha" else rest)
            )
            lift, moment = (lift + more, moment) if term.coefficient == "CL" else (lift, moment + more)
        return lift, moment

    def slope(x, de):
        lift, moment = coefficients(x, de)
        return np.array([x[1] - float(s.lift) * lift, float(s.moment) * moment])

    de = elevator(np.arange(2 * (n - 1) * FINE + 1) * 0.5 * h, amplitude)
    x = np.zeros(2)
    rows = []
    for k in range((n - 1) * FINE + 1):
        if k % FINE == 0:
            rows.append((*x, -float(s.normal) * coefficients(x, de[2 * k])[0], de[2 * k]))
        if k == (n - 1) * FINE:
            break
        a, m, b = de[2 * k], de[2 * k + 1], de[2 * k + 2]
        k1 = slope(x, a)
        k2 = slope(x + 0.5 * h * k1, m)
        k3 = slope(x + 0.5 * h * k2, m)
        k4 = slope(x + h * k3, b)
        x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return np.array(rows)


def log_of(terms, amplitudes, noise=None, duration_s=6.0):
    rng = np.random.default_rng(5)
    runs = [fly(terms, a, duration_s) for a in amplitudes]
    n = len(runs[0])
    rows = np.concatenate(runs)
    channels = {
        "airspeed_m_s": np.full(len(rows), V),
        "alpha_rad": TRIM_ALPHA + rows[:, 0],
        "q_rad_s": rows[:, 1],
        "az_m_s2": -G0 + rows[:, 2],
        "elevator_rad": TRIM_ELEVATOR + rows[:, 3],
        "elevator_command_rad": TRIM_ELEVATOR + np.concatenate([command(n, a) for a in amplitudes]),
        "density_kg_m3": np.full(len(rows), DENSITY),
    }
    for name, std in (noise or {}).items():
        channels[name] = channels[name] + std * rng.standard_normal(len(rows))
    return FlightLog(
        metadata={"aircraft": "gtm"},
        run_ids=tuple(f"run-{i}" for i in range(len(runs))),
        offsets=np.arange(len(runs) + 1, dtype=np.int64) * n,
        t_s=np.tile(np.arange(n) * 0.02, len(runs)),
        channels=channels,
    )


KNOWN = Correction(TERMS, TRUTH, from_trim=True)
BENT = log_of(TERMS, (1.0 * DEG, -1.5 * DEG))
STRAIGHT = log_of((), (1.0 * DEG, -1.5 * DEG))
METHODS = ("ls", "iv-lowpass", "iv-reference", "iv-actuator", "iv-f1", "iv-f2", "frequency", "output-error")


def test_record_less_the_response_is_the_linear_aircrafts():
    found = corrected_log(BENT, GTM.constants, KNOWN)
    for name in ("alpha_rad", "q_rad_s", "az_m_s2"):
        effect = np.abs(BENT.channels[name] - STRAIGHT.channels[name]).max()
        left = np.abs(found.channels[name] - STRAIGHT.channels[name]).max()
        # increments are linear between samples of 20 ms, the truth's are not: corners at the break
        assert left < 0.01 * effect, name
    for name in ("elevator_rad", "elevator_command_rad", "airspeed_m_s", "density_kg_m3"):
        assert np.array_equal(found.channels[name], BENT.channels[name])


@pytest.mark.parametrize("name", METHODS)
def test_every_method_recovers_the_derivatives(name):
    names = list(PARAMETERS)
    bent = identify_log(BENT, GTM, [name], Options())[names].to_numpy()
    straight = identify_log(STRAIGHT, GTM, [name], Options())[names].to_numpy()
    after = identify_corrected(BENT, GTM, [name], KNOWN)[names].to_numpy()
    # what a method makes of 50 Hz samples is in `straight`; the effect is taken out to a hundredth of it
    moment = [3, 4, 5]
    assert np.all(np.abs(bent[:, 3] / TRUTH[3] - 1.0) > 0.06)
    assert np.all(np.abs(after[:, moment] / straight[:, moment] - 1.0) < 2e-3)
    assert np.all(np.abs(after[:, 0] / straight[:, 0] - 1.0) < 2e-3)


@pytest.mark.parametrize(("name", "tolerance"), [("iv-f1", 0.01), ("iv-f2", 0.01), ("frequency", 0.01)])
def test_moment_derivatives_of_a_known_break_are_the_truth(name, tolerance):
    after = identify_corrected(BENT, GTM, [name], KNOWN)[list(PARAMETERS)].to_numpy()
    assert np.all(np.abs(after[:, [0, 3, 4, 5]] / TRUTH[[0, 3, 4, 5]] - 1.0) < tolerance)


def test_derivatives_that_are_off_enter_by_the_share_of_the_motion():
    off = replace(KNOWN, derivatives=1.1 * TRUTH)
    once = identify_corrected(BENT, GTM, ["iv-f1"], off)[list(PARAMETERS)].to_numpy()
    error = np.abs(once[:, 3] / TRUTH[3] - 1.0)
    assert np.all(error < 0.03)
    again = replace(off, derivatives=once.mean(axis=0))
    twice = identify_corrected(BENT, GTM, ["iv-f1"], again)[list(PARAMETERS)].to_numpy()
    assert np.all(np.abs(twice[:, 3] / TRUTH[3] - 1.0) < np.maximum(0.5 * error, 0.005))


def test_response_is_the_integral_of_the_equations():
    t = np.arange(0.0, 3.0001, 0.02)
    lift, moment = 0.05 * np.interp(t, [0.5, 1.0], [0.0, 1.0]), -0.01 * np.interp(t, [0.3, 0.7], [0.0, 1.0])
    found = response(TRUTH, scales(1), lift[None], moment[None], 0.02)[:, 0]
    a, _ = short_period.system(TRUTH, SCALE)

    def slope(time, x):
        more = np.interp(time, t, lift), np.interp(time, t, moment)
        return a @ x + np.array([-float(SCALE.lift) * more[0], float(SCALE.moment) * more[1]])

    exact = solve_ivp(slope, (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-13, max_step=0.01).y
    assert np.allclose(found[:2], exact, atol=1e-9)
    az = -float(SCALE.normal) * (
        TRUTH[0] * exact[0] + float(SCALE.half_chord_time) * TRUTH[1] * exact[1] + lift
    )
    assert np.allclose(found[2], az, atol=1e-7)


def scales(runs):
    return short_period.Scale(
        *(np.full(runs, float(getattr(SCALE, f))) for f in short_period.Scale.__dataclass_fields__)
    )


@given(seed=st.integers(0, 2**31), factor=st.floats(-3.0, 3.0))
@settings(max_examples=20, deadline=None)
def test_response_is_linear_and_runs_are_apart(seed, factor):
    rng = np.random.default_rng(seed)
    lift, moment = 1e-2 * rng.standard_normal((2, 3, 40))
    whole = response(TRUTH, scales(3), lift, moment, 0.02)
    assert np.allclose(response(TRUTH, scales(3), factor * lift, factor * moment, 0.02), factor * whole)
    one = response(TRUTH, scales(1), lift[1:2], moment[1:2], 0.02)
    assert np.allclose(one[:, 0], whole[:, 1], rtol=0.0, atol=1e-14)


def test_increments_by_hand():
    terms = (
        AeroTerm("Cm", "alpha", "above", 2.0, 0.1),
        AeroTerm("Cm", "alpha", "quadratic", 3.0),
        AeroTerm("CL", "elevator", "below", 4.0, 0.01),
        AeroTerm("CL", "qhat", "linear", 5.0),
    )
    signals = {"alpha": [0.05, 0.2], "elevator": [-0.03, 0.02], "qhat": [0.001, -0.002]}
    found = increments(terms, {name: np.array(values) for name, values in signals.items()})
    # CL: 4 min(0, de - 0.01) + 5 qhat; Cm: 2 max(0, alpha - 0.1) + 3 alpha^2
    assert np.allclose(found[0], [4.0 * -0.04 + 0.005, -0.01])
    assert np.allclose(found[1], [0.0075, 0.2 + 0.12])


def test_states_answer_a_ramp_as_the_books_say():
    t = np.arange(0.0, 2.0, 0.02)
    ramp = 0.3 + 0.5 * t[None, :]
    lag = state(StateTerm("late", "lag", "alpha", 0.08), ramp, 0.02)[0]
    # tau x' = s - x on s = s0 + r t from equilibrium: s0 + r (t - tau (1 - exp(-t/tau)))
    assert np.allclose(lag, 0.3 + 0.5 * (t - 0.08 * (1.0 - np.exp(-t / 0.08))), atol=1e-12)
    wn, zeta = 12.0, 0.2
    mode = state(StateTerm("bends", "mode", "alpha", 1.0 / wn, zeta), ramp, 0.02)[0]
    wd = wn * np.sqrt(1.0 - zeta**2)
    # its ramp response (Ogata, Modern Control Engineering, ch. 5): t - 2 zeta/wn plus a decaying sine
    decay = np.exp(-zeta * wn * t)
    free = decay * (2.0 * zeta / wn * np.cos(wd * t) + (2.0 * zeta**2 - 1.0) / wd * np.sin(wd * t))
    assert np.allclose(mode, 0.3 + 0.5 * (t - 2.0 * zeta / wn + free), atol=1e-10)


def test_late_lift_is_taken_out():
    late = StateTerm("late", "lag", "alpha", 0.1)
    taken = Correction((AeroTerm("CL", "late", "linear", 0.0),), TRUTH, from_trim=True, states=(late,))
    assert np.array_equal(
        corrected_log(STRAIGHT, GTM.constants, taken).channels["q_rad_s"], STRAIGHT.channels["q_rad_s"]
    )
    moved = replace(
        taken, aero=(AeroTerm("CL", "late", "linear", 0.5), AeroTerm("CL", "alpha", "linear", -0.5))
    )
    off = corrected_log(STRAIGHT, GTM.constants, moved).channels["az_m_s2"] - STRAIGHT.channels["az_m_s2"]
    assert 0.01 < np.abs(off).max() < 2.0


def test_alpha_counts_from_where_a_linear_trace_counts():
    case = prepare([BENT], GTM, [], TraceOptions(model="linear"))
    alpha = BENT.channels["alpha_rad"].reshape(2, -1)
    shifts = {r.signals.run_id: r.plant.alpha_shift_rad for r in case.fitted.records}
    for run, value in zip(BENT.run_ids, trim_alpha(alpha, 0.02), strict=True):
        if run in shifts:
            assert value == pytest.approx(shifts[run], abs=1e-12)


def test_from_trace_to_estimate():
    noise = {"alpha_rad": 0.03 * DEG, "q_rad_s": 0.2 * DEG, "az_m_s2": 0.05}
    break_alone = (AeroTerm("Cm", "alpha", "above", 0.46, 0.44 * DEG),)
    log = log_of(break_alone, (1.0 * DEG, -1.0 * DEG, 1.5 * DEG, -1.5 * DEG), noise)
    keys = ("cm_alpha_nonlinear:break", "elevator_delay")
    found = traced([log], GTM, TraceOptions(model="linear", effects=keys))
    taken = correction(found)
    assert [t.shape for t in taken.aero] == ["above"]
    assert taken.from_trim
    before = identify_log(log, GTM, ["iv-f1"])["Cmalpha"].mean()
    after = identify_corrected(log, GTM, ["iv-f1"], taken)["Cmalpha"].mean()
    assert abs(before / TRUTH[3] - 1.0) > 0.06
    assert abs(after / TRUTH[3] - 1.0) < 0.02


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (Change(surface=(SurfaceTerm("delay", 0.02),)), "surface"),
        (Change(sensors=(SensorTerm("alpha_rad", "lag", 0.02),)), "sensors"),
        (Change(aero=(AeroTerm("Cm", "alpha_dot_hat", "linear", -20.0),)), "alpha_dot_hat"),
    ],
)
def test_what_is_no_increment_in_measured_signals_is_refused(change, told):
    with pytest.raises(ConfigurationError, match=told):
        check(change)
