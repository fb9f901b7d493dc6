"""Effects in the model: a record less the response to known increments is the linear aircraft's record."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from airtruth import aircraft
from airtruth.effects.registry import EFFECTS
from airtruth.identification import Options, identify
from airtruth.logs.flight_log import FlightLog
from airtruth.loop import identify_without_effects
from airtruth.physics import short_period
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.readings import state_of
from airtruth.physics.terms import AeroTerm, Change, SensorTerm, StateTerm, SurfaceTerm
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.compensate import (
    Compensation,
    Condition,
    compensated_log,
    compensation_of,
    treatment_of,
    trim_alpha,
    updated_constants,
)
from airtruth.tracing.increment_response import increments, response
from airtruth.tracing.prepare import prepare
from airtruth.units import DEG, G0

pytestmark = pytest.mark.slow

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


KNOWN = Compensation((Condition(V, TRUTH),), TERMS, from_trim=True)
BENT = log_of(TERMS, (1.0 * DEG, -1.5 * DEG))
STRAIGHT = log_of((), (1.0 * DEG, -1.5 * DEG))
METHODS = ("ls", "iv-lowpass", "iv-reference", "iv-actuator", "iv-f1", "iv-f2", "frequency", "output-error")


def test_record_less_the_response_is_the_linear_aircrafts():
    found = compensated_log(BENT, GTM.constants, KNOWN)
    for name in ("alpha_rad", "q_rad_s", "az_m_s2"):
        effect = np.abs(BENT.channels[name] - STRAIGHT.channels[name]).max()
        left = np.abs(found.channels[name] - STRAIGHT.channels[name]).max()
        # increments are linear between samples of 20 ms, the truth's are not: corners at the break
        assert left < 0.01 * effect, name
    for name in ("elevator_rad", "elevator_command_rad", "airspeed_m_s", "density_kg_m3"):
        assert np.array_equal(found.channels[name], BENT.channels[name])


@pytest.mark.parametrize("name", METHODS)
def test_every_method_recovers_the_derivatives(name):
    names = list(LONGITUDINAL.parameters)
    bent = identify(BENT, GTM, [name], Options()).to_frame()[names].to_numpy()
    straight = identify(STRAIGHT, GTM, [name], Options()).to_frame()[names].to_numpy()
    after = identify_without_effects([BENT], GTM, [name], KNOWN).to_frame()[names].to_numpy()
    # what a method makes of 50 Hz samples is in `straight`; the effect is taken out to a hundredth of it
    moment = [3, 4, 5]
    assert np.all(np.abs(bent[:, 3] / TRUTH[3] - 1.0) > 0.06)
    assert np.all(np.abs(after[:, moment] / straight[:, moment] - 1.0) < 2e-3)
    assert np.all(np.abs(after[:, 0] / straight[:, 0] - 1.0) < 2e-3)


@pytest.mark.parametrize(("name", "tolerance"), [("iv-f1", 0.01), ("iv-f2", 0.01), ("frequency", 0.01)])
def test_moment_derivatives_of_a_known_break_are_the_truth(name, tolerance):
    after = (
        identify_without_effects([BENT], GTM, [name], KNOWN)
        .to_frame()[list(LONGITUDINAL.parameters)]
        .to_numpy()
    )
    assert np.all(np.abs(after[:, [0, 3, 4, 5]] / TRUTH[[0, 3, 4, 5]] - 1.0) < tolerance)


def test_derivatives_that_are_off_enter_by_the_share_of_the_motion():
    off = replace(KNOWN, conditions=(Condition(V, 1.1 * TRUTH),))
    once = (
        identify_without_effects([BENT], GTM, ["iv-f1"], off)
        .to_frame()[list(LONGITUDINAL.parameters)]
        .to_numpy()
    )
    error = np.abs(once[:, 3] / TRUTH[3] - 1.0)
    assert np.all(error < 0.03)
    again = replace(off, conditions=(Condition(V, once.mean(axis=0)),))
    twice = (
        identify_without_effects([BENT], GTM, ["iv-f1"], again)
        .to_frame()[list(LONGITUDINAL.parameters)]
        .to_numpy()
    )
    assert np.all(np.abs(twice[:, 3] / TRUTH[3] - 1.0) < np.maximum(0.5 * error, 0.005))


def test_response_is_the_integral_of_the_equations():
    t = np.arange(0.0, 3.0001, 0.02)
    lift, moment = 0.05 * np.interp(t, [0.5, 1.0], [0.0, 1.0]), -0.01 * np.interp(t, [0.3, 0.7], [0.0, 1.0])
    found = response(TRUTH, scales(1), np.stack([lift[None], moment[None]]), 0.02)[:, 0]
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
    both = np.stack([lift, moment])
    whole = response(TRUTH, scales(3), both, 0.02)
    assert np.allclose(response(TRUTH, scales(3), factor * both, 0.02), factor * whole)
    one = response(TRUTH, scales(1), both[:, 1:2], 0.02)
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
    lag = state_of(StateTerm("late", "lag", "alpha", 0.08), ramp, 0.02)[0]
    # tau x' = s - x on s = s0 + r t from equilibrium: s0 + r (t - tau (1 - exp(-t/tau)))
    assert np.allclose(lag, 0.3 + 0.5 * (t - 0.08 * (1.0 - np.exp(-t / 0.08))), atol=1e-12)
    wn, zeta = 12.0, 0.2
    mode = state_of(StateTerm("bends", "mode", "alpha", 1.0 / wn, zeta), ramp, 0.02)[0]
    wd = wn * np.sqrt(1.0 - zeta**2)
    # its ramp response (Ogata, Modern Control Engineering, ch. 5): t - 2 zeta/wn plus a decaying sine
    decay = np.exp(-zeta * wn * t)
    free = decay * (2.0 * zeta / wn * np.cos(wd * t) + (2.0 * zeta**2 - 1.0) / wd * np.sin(wd * t))
    assert np.allclose(mode, 0.3 + 0.5 * (t - 2.0 * zeta / wn + free), atol=1e-10)


def test_late_lift_is_taken_out():
    late = StateTerm("late", "lag", "alpha", 0.1)
    taken = Compensation(
        (Condition(V, TRUTH),), (AeroTerm("CL", "late", "linear", 0.0),), (late,), from_trim=True
    )
    assert np.array_equal(
        compensated_log(STRAIGHT, GTM.constants, taken).channels["q_rad_s"], STRAIGHT.channels["q_rad_s"]
    )
    moved = replace(
        taken, aero=(AeroTerm("CL", "late", "linear", 0.5), AeroTerm("CL", "alpha", "linear", -0.5))
    )
    off = compensated_log(STRAIGHT, GTM.constants, moved).channels["az_m_s2"] - STRAIGHT.channels["az_m_s2"]
    assert 0.01 < np.abs(off).max() < 2.0


def test_alpha_counts_from_where_a_linear_trace_counts():
    case = prepare([BENT], GTM, [], TraceOptions(model="linear"))
    alpha = BENT.channels["alpha_rad"].reshape(2, -1)
    shifts = {r.signals.run_id: r.plant.alpha_shift_rad for r in case.fitted.records}
    for run, value in zip(BENT.run_ids, trim_alpha(alpha, 0.02), strict=True):
        if run in shifts:
            assert value == pytest.approx(shifts[run], abs=1e-12)


@pytest.mark.long
def test_from_trace_to_estimate():
    noise = {"alpha_rad": 0.03 * DEG, "q_rad_s": 0.2 * DEG, "az_m_s2": 0.05}
    break_alone = (AeroTerm("Cm", "alpha", "above", 0.46, 0.44 * DEG),)
    log = log_of(break_alone, (1.0 * DEG, -1.0 * DEG, 1.5 * DEG, -1.5 * DEG), noise)
    keys = ("cm_alpha_nonlinear:break", "elevator_delay")
    found = trace(log, GTM, TraceOptions(model="linear", effects=keys))
    taken = compensation_of(found)
    assert [t.shape for t in taken.aero] == ["above"]
    assert taken.from_trim
    before = identify(log, GTM, ["iv-f1"]).to_frame()["Cmalpha"].mean()
    after = identify_without_effects([log], GTM, ["iv-f1"], taken).to_frame()["Cmalpha"].mean()
    assert abs(before / TRUTH[3] - 1.0) > 0.06
    assert abs(after / TRUTH[3] - 1.0) < 0.02


def sine(t, late=0.0):
    return np.sin(3.0 * (t - late))


def test_errors_of_sensors_are_undone():
    """Scale, bias and a delay of 40 ms on the vane, whose arm of 0.5 m adds q x/V: the true alpha again."""
    t = BENT.t_s
    alpha, q = 0.1 + 0.05 * sine(t), 0.2 * np.cos(3.0 * t)
    late = 0.1 + 0.05 * sine(t, 0.04) - 0.5 * 0.2 * np.cos(3.0 * (t - 0.04)) / V
    log = replace(BENT, channels=BENT.channels | {"q_rad_s": q, "alpha_rad": 1.1 * late + 0.02})
    terms = (("scale", 1.1), ("bias", 0.02), ("delay", 0.04), ("arm", 0.5))
    taken = Compensation(
        (Condition(V, TRUTH),), sensors=tuple(SensorTerm("alpha_rad", kind, value) for kind, value in terms)
    )
    found = compensated_log(log, GTM.constants, taken)
    inside = (t > 0.1) & (t < t.max() - 0.1)  # the last 40 ms of a late channel are unknown
    # linear interpolation by whole samples is exact
    np.testing.assert_allclose(found.channels["alpha_rad"][inside], alpha[inside], atol=1e-12)
    np.testing.assert_array_equal(found.channels["q_rad_s"], q)


def test_the_arm_of_an_accelerometer_is_undone():
    """az = az_cg - x q_dot with q = 0.2 cos(3 t): q_dot = -0.6 sin(3 t), the low-pass at 5 Hz leaves it to 1e-3."""
    t = BENT.t_s
    log = replace(
        BENT,
        channels=BENT.channels
        | {"q_rad_s": 0.2 * np.cos(3.0 * t), "az_m_s2": -G0 + 0.4 * 0.6 * np.sin(3.0 * t)},
    )
    taken = Compensation((Condition(V, TRUTH),), sensors=(SensorTerm("az_m_s2", "arm", 0.4),))
    found = compensated_log(log, GTM.constants, taken).channels["az_m_s2"]
    inside = (t > 0.5) & (t < t.max() - 0.5)
    np.testing.assert_allclose(found[inside], -G0, atol=2e-3)


def test_the_elevator_becomes_the_surface_that_the_air_sees():
    t = BENT.t_s
    log = replace(BENT, channels=BENT.channels | {"elevator_rad": 0.03 * sine(t)})
    taken = Compensation((Condition(V, TRUTH),), surface=(SurfaceTerm("delay", 0.06),))
    found = compensated_log(log, GTM.constants, taken).channels["elevator_rad"]
    inside = t > 0.06
    np.testing.assert_allclose(found[inside], 0.03 * sine(t, 0.06)[inside], atol=1e-12)


def test_mass_and_inertia_change_the_constants():
    taken = Compensation((Condition(V, TRUTH),), declared={"mass": 1.1, "inertia": 0.9})
    heavier = updated_constants(GTM, taken)
    assert heavier.mass_kg == pytest.approx(1.1 * GTM.mass_kg)
    assert heavier.inertia_yy_kg_m2 == pytest.approx(0.9 * GTM.inertia_yy_kg_m2)
    assert updated_constants(GTM, replace(taken, declared={"mass": 1.0, "inertia": 1.0})) is GTM


def test_each_record_takes_the_derivatives_of_its_flight_condition():
    """Two conditions: the nearest airspeed counts."""
    other = Condition(1.5 * V, 3.0 * TRUTH)
    both = replace(KNOWN, conditions=(other, *KNOWN.conditions))
    one, two = (compensated_log(BENT, GTM.constants, c).channels["q_rad_s"] for c in (KNOWN, both))
    np.testing.assert_array_equal(one, two)
    away = compensated_log(BENT, GTM.constants, replace(KNOWN, conditions=(other,))).channels["q_rad_s"]
    assert np.abs(away - one).max() > 1e-4


@pytest.mark.parametrize(
    ("key", "kind"),
    [
        ("cm_alpha_nonlinear:break", "subtracted"),
        ("lift_lag", "subtracted"),
        ("vane_lag", "undone"),
        ("elevator_delay", "replaced"),
        ("mass_error", "declared"),
        ("cg_shift", "kept"),
        ("downwash_lag", "kept"),
    ],
)
def test_every_kind_of_effect_has_its_treatment(key, kind):
    effect = EFFECTS[key]
    change = effect.change({p.name: 0.5 * (p.low + p.high) for p in effect.parameters})
    found = treatment_of(key, change)
    assert (found.effect, found.kind) == (key, kind)
    assert found.sentence.startswith(f"{key}: ")


def test_an_axial_force_is_kept():
    """CX moves none of alpha, q and az, which a regression reads."""
    drag = Change(aero=(AeroTerm("CX", "alpha", "linear", -0.2),))
    assert treatment_of("drag", drag).kind == "kept"
    with_lift = Change(aero=(*drag.aero, AeroTerm("CL", "alpha", "quadratic", 1.0)))
    assert treatment_of("separation", with_lift).kind == "subtracted"
