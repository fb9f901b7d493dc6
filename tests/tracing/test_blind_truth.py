"""The truth side of the blind trials: what it says it flies is what it flies."""

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from tiers import sampled

from airtruth.physics import dryden
from airtruth.simulation.flight import Flight, Inputs
from validation.blind import draw, gusts, sensors, surface
from validation.blind.aircraft_xml import Body, Shape
from validation.blind.figures import CHORD_M, DEG, DERIVATIVES, FT, KT, LB, NOISE, SLUG, SPAN_M, STEP_S
from validation.blind.flight import Model, Truth
from validation.blind.sensors import Fault
from validation.blind.surface import Manoeuvre
from validation.blind.truths import EFFECTS, Added, shrunk

ROOT = Path(__file__).resolve().parents[2]
V = 42.85
LENGTH = (911.218, 840.419)
AREA_M2 = 5.9018 * FT**2
INERTIA = 4.657102 * SLUG * FT**2
MASS = 57.75 * LB
Q_BAR = 0.5 * 1.225 * (75.0 * KT) ** 2
HOLD = Manoeuvre("doublet", 0.0, 1.0, 0.5)


def servo_doublet(t, amplitude, edges):
    """A first-order 5 Hz lag's answer to a doublet with these three edges."""
    steps = amplitude * np.array([1.0, -2.0, 1.0])
    after = [np.where(t > e, 1.0 - np.exp(-2.0 * np.pi * 5.0 * (t - e)), 0.0) for e in edges]
    return sum(s * a for s, a in zip(steps, after, strict=True))


@pytest.mark.parametrize("delay_s", [0.0, 0.00137, 0.0202])
def test_the_air_sees_the_surface_late_by_less_than_a_step(delay_s):
    edge = 1.00006  # takes effect at the next point of the 8 kHz grid
    manoeuvre = Manoeuvre("doublet", 0.02, edge, 0.5)
    _, measured, seen = surface.actuate(manoeuvre, 3.0, 0.2, (("delay", delay_s),))
    grid_edges = 1.000125 + 0.015 + 0.5 * np.arange(3)
    t = np.arange(len(seen)) * STEP_S - 0.2
    assert measured == pytest.approx(servo_doublet(np.arange(151) * 0.02, 0.02, grid_edges), abs=1e-12)
    # linear interpolation across an edge: at most rate/4 of a fine step, 0.04 * 31.4/s * 31 us
    assert seen == pytest.approx(servo_doublet(t - delay_s, 0.02, grid_edges), abs=4e-5)
    away = np.min(np.abs((t - delay_s)[:, None] - grid_edges), axis=1) > 2e-4
    assert seen[away] == pytest.approx(servo_doublet(t - delay_s, 0.02, grid_edges)[away], abs=1e-7)


def test_lag_of_a_ramp_is_exact():
    t, tau = np.arange(400) * 1e-3, 0.03
    expected = t - tau + tau * np.exp(-t / tau)  # of a first-order lag at rest
    assert surface.lagged(t, tau, 1e-3) == pytest.approx(expected, abs=1e-13)
    assert surface.lagged(np.full(9, 0.3), tau, 1e-3) == pytest.approx(0.3, abs=1e-15)


def test_play_and_rate_limit():
    t = np.arange(4000) * 1e-3
    x = 0.02 * np.sin(2.0 * np.pi * t)
    y = surface.played(x, 0.008)
    assert (y.max(), y.min()) == pytest.approx((0.016, -0.016), abs=1e-7)
    assert np.abs(y - x).max() <= 0.004 + 1e-15
    limited = surface.rate_limited(np.where(t > 0.5, 1.0, 0.0), 2.0, 1e-3)
    assert limited == pytest.approx(np.clip(2.0 * (t - 0.5), 0.0, 1.0), abs=1e-12)


def test_manoeuvre_beyond_the_servo_is_refused():
    with pytest.raises(ValueError, match="300 deg/s"):
        surface.actuate(Manoeuvre("doublet", 6.0 * DEG, 1.0, 0.5), 2.0, 0.2, ())


@pytest.mark.parametrize("kind", gusts.KINDS)
@pytest.mark.parametrize("axis", ["u", "w"])
def test_spectra_integrate_to_the_variance(kind, axis):
    def over_log(x):
        return float(gusts.spectrum(kind, axis, np.exp(x), 1.7, 900.0, V) * np.exp(x))

    # from -20: the constant below adds 1e-8; above 20 von Karman's -5/3 slope leaves 1e-7
    assert quad(over_log, -20.0, 20.0, limit=400, epsrel=1e-10)[0] == pytest.approx(1.7**2, rel=1e-4)


def test_dryden_is_that_of_the_specification():
    omega = np.geomspace(1e-3, 1e2, 50)
    house = dryden.spectrum(dryden.Dryden(1.1, 0.8, *LENGTH, V), omega)
    for i, axis in enumerate("uw"):
        own = gusts.spectrum("dryden", axis, omega, (1.1, 0.8)[i], LENGTH[i], V)
        assert own == pytest.approx(house[:, i], rel=1e-12)


def test_von_karman_in_the_inertial_range_is_isotropic():
    """Kolmogorov: slope -5/3, and the transverse spectrum 4/3 of the longitudinal one."""
    u, w = (gusts.spectrum("von_karman", axis, np.array([1e3, 2e3]), 1.0, 900.0, V) for axis in "uw")
    assert np.log2(u[1] / u[0]) == pytest.approx(-5.0 / 3.0, abs=1e-6)
    assert w / u == pytest.approx(4.0 / 3.0, rel=1e-6)


@pytest.mark.grid
@pytest.mark.parametrize("kind", gusts.KINDS)
def test_synthesised_gusts_have_the_spectrum_and_the_rotation(kind):
    n = 2**18
    u, w, rotation = gusts.synthesise(
        kind, (1.2, 0.8), LENGTH, V, SPAN_M, STEP_S, n, np.random.default_rng(4)
    )
    spacing = 2.0 * np.pi / (n * STEP_S)
    omega = spacing * np.arange(n // 2 + 1)
    for axis, values, sigma, length in (("u", u, 1.2, LENGTH[0]), ("w", w, 0.8, LENGTH[1])):
        lines = 2.0 * np.abs(np.fft.rfft(values) / n) ** 2 / spacing
        ratio = lines / gusts.spectrum(kind, axis, omega, sigma, length, V)
        for low, high in ((0.5, 5.0), (5.0, 50.0), (50.0, 500.0)):
            band = ratio[(omega > low) & (omega < high)]
            # each line is exponentially distributed with mean 1
            assert band.mean() == pytest.approx(1.0, abs=5.0 / len(band) ** 0.5)
    # MIL-F-8785C's H_q, its sign that of air that turns nose-up (dw/dx < 0)
    s = 1j * omega[1:-1]
    expected = -(s / V) / (1.0 + 4.0 * SPAN_M * s / (np.pi * V))
    assert np.fft.rfft(rotation)[1:-1] == pytest.approx(np.fft.rfft(w)[1:-1] * expected, rel=1e-6)


@pytest.mark.slow
def test_gust_variance_over_an_ensemble():
    rng = np.random.default_rng(9)
    values = [
        gusts.synthesise("von_karman", (1.2, 0.8), LENGTH, V, SPAN_M, 0.01, 2, rng)[:2, 0] for _ in range(100)
    ]
    # 100 independent samples: the variance has a relative deviation of sqrt(2/100) = 0.14
    assert np.var(values, axis=0) == pytest.approx([1.2**2, 0.8**2], rel=0.45)


def test_noise_is_the_declared_one_in_each_kind():
    for kind in sensors.NOISE_KINDS:
        x = sensors.noise("q_rad_s", kind, 40000, np.random.default_rng(1))
        assert x.std() == pytest.approx(NOISE["q_rad_s"], rel=0.03)
        lag1 = np.mean(x[1:] * x[:-1]) / np.mean(x * x)
        # half the variance is a Gauss-Markov process of 80 ms
        assert lag1 == pytest.approx(0.5 * np.exp(-0.25) if kind == "coloured" else 0.0, abs=0.02)


def test_sensor_faults_against_their_equations():
    t = np.arange(3000) * STEP_S
    q = 0.2 * np.sin(4.0 * t)
    base = {
        "airspeed_m_s": np.full_like(t, V),
        "alpha_rad": 0.1 + 0.0 * t,
        "q_rad_s": q,
        "q_dot_rad_s2": 0.8 * np.cos(4.0 * t),
        "az_m_s2": np.full_like(t, -9.8),
        "theta_rad": 0.1 + 0.0 * t,
    }
    placed = sensors.placed(base, [Fault("alpha_rad", "arm", 0.5), Fault("az_m_s2", "arm", 0.3)], 0.02)
    # first order of the vane's air angle; the CG 2 % aft leaves the sensors ahead of it
    x = 0.5 + 0.02 * CHORD_M
    assert placed["alpha_rad"] == pytest.approx(0.1 - q * x / V * np.cos(0.1), abs=3e-6)
    assert placed["az_m_s2"] == pytest.approx(-9.8 - (0.3 + 0.02 * CHORD_M) * base["q_dot_rad_s2"], rel=1e-12)
    late = sensors.measured(base, [Fault("q_rad_s", "delay", 0.00337)], 0.0, 0.2, STEP_S)["q_rad_s"]
    assert late == pytest.approx(0.2 * np.sin(4.0 * (0.2 + np.arange(len(late)) * 0.02 - 0.00337)), abs=1e-6)


def test_the_truth_without_draws_is_the_declared_aircraft(gtm, paper_trim):
    """The house's own simulator at 200 Hz, with its own trim, in smooth gusts."""
    truth = Truth(Model(Body()))
    assert truth.alpha_rad == pytest.approx(paper_trim.alpha_rad, abs=1e-8)
    assert truth.elevator_rad == pytest.approx(paper_trim.elevator_rad, abs=1e-8)
    _, _, seen = surface.actuate(Manoeuvre("doublet", 1.5 * DEG, 0.9999, 0.5), 5.0, 0.2, ())
    t = np.arange(len(seen)) * STEP_S
    air = np.array([1.5 * np.sin(1.3 * t), np.sin(3.0 * t), 0.05 * np.sin(5.0 * t)])
    own = truth.fly(seen, air)
    along, down, rotation = air[:, ::5]
    inputs = Inputs(seen[::5], along, down, {"q_rad_s": rotation}, surface=True)
    house = Flight(gtm, paper_trim, 0.005).fly(inputs)
    for name in ("alpha_rad", "q_rad_s", "az_m_s2", "airspeed_m_s"):
        theirs, ours = house[name], own[name][::5][: len(house[name])]
        # third-order Adams-Bashforth at 200 Hz errs by 0.2 % of q where the surface turns
        assert ours == pytest.approx(theirs, abs=2.5e-3 * np.ptp(theirs))


def start_rates(body, d_alpha, shapes=()):
    """Pitch acceleration and specific force at the start of a record, angle of attack off trim."""
    channels = Truth(Model(body, shapes)).fly(np.zeros(2), None, d_alpha)
    return np.array([channels["q_dot_rad_s2"][0], channels["az_m_s2"][0]])


def test_drawn_derivatives_act_about_the_cg():
    d = 0.1 * DEG
    plain = start_rates(Body(), d) - start_rates(Body(), 0.0)
    for name, expected in (
        ("Cmalpha", [0.1 * DERIVATIVES["Cmalpha"][0] * d * Q_BAR * AREA_M2 * CHORD_M / INERTIA, 0.0]),
        ("CLalpha", [0.0, -0.1 * DERIVATIVES["CLalpha"][0] * d * Q_BAR * AREA_M2 / MASS]),
    ):
        body = Body(derivatives={name: 0.1})
        change = start_rates(body, d) - start_rates(body, 0.0) - plain
        assert change == pytest.approx(expected, rel=2e-3, abs=1e-5)


def test_mass_inertia_and_cg_move_the_aircraft():
    d = 0.1 * DEG
    plain = start_rates(Body(), d) - start_rates(Body(), 0.0)
    heavy = start_rates(Body(inertia=1.1), d) - start_rates(Body(inertia=1.1), 0.0)
    assert heavy[0] == pytest.approx(plain[0] / 1.1, rel=1e-6)
    aft = start_rates(Body(cg=0.02), d) - start_rates(Body(cg=0.02), 0.0)
    # dCmalpha = CZalpha dx, CZalpha about -(CLalpha + CD); the trim moves by a little
    moment = 0.02 * 4.78 * d * Q_BAR * AREA_M2 * CHORD_M / INERTIA
    assert aft[0] - plain[0] == pytest.approx(moment, rel=0.05)


def test_downwash_lag_is_a_moment_by_alpha_dot():
    d, size = 0.3 * DEG, -20.0
    plain = Truth(Model(Body())).fly(np.zeros(6), None, d)
    late = Truth(Model(Body(), (Shape("Cm", "alphadot", size),))).fly(np.zeros(6), None, d)
    alpha_dot = np.gradient(plain["alpha_rad"], STEP_S)[3]
    expected = size * alpha_dot * CHORD_M / (2.0 * V) * Q_BAR * AREA_M2 * CHORD_M / INERTIA
    assert (late["q_dot_rad_s2"] - plain["q_dot_rad_s2"])[3] == pytest.approx(expected, rel=0.03)


@pytest.mark.grid
@pytest.mark.parametrize("key", sampled(EFFECTS, 4))
def test_every_effect_flies_from_its_own_trim_and_vanishes_with_its_size(key):
    trial = draw.draw(3, 0, "null")
    kind = EFFECTS[key]
    effect = Added(key, kind.values(kind.largest, 0.5))
    truth, parts = draw.truth_of(trial, (effect,))
    still = draw.fly_record(truth, parts, HOLD, 2.0, 0.2)
    if key != "cg_drift":  # which leaves any trim
        assert np.ptp(still["alpha_rad"]) < 1e-7
    base, none = draw.truth_of(trial, ())
    small_truth, small = draw.truth_of(trial, (shrunk(effect, 1e-3),))
    manoeuvre = trial.manoeuvres[0]
    flown = [
        draw.fly_record(t, p, manoeuvre, 2.0, 0.2)
        for t, p in ((truth, parts), (small_truth, small), (base, none))
    ]
    large, little = (
        max(np.ptp(f[n] - flown[2][n]) / np.ptp(flown[2][n]) for n in ("alpha_rad", "q_rad_s", "az_m_s2"))
        for f in flown[:2]
    )
    if key != "airspeed_scale":
        assert large > 2e-3
        assert little < 0.02 * large


def test_a_process_that_knows_the_tracer_flies_nothing(monkeypatch):
    monkeypatch.setitem(sys.modules, "airtruth.tracing", sys)
    with pytest.raises(RuntimeError, match="without airtruth"):
        draw.fly(draw.draw(1, 0, "null"))


@pytest.mark.slow
def test_the_truth_side_imports_nothing_of_the_tracers():
    names = [
        p.stem
        for p in sorted((ROOT / "validation" / "blind").glob("*.py"))
        if p.stem not in ("__init__", "__main__")
    ]
    for name in set(names) - {"tracing"}:
        tree = ast.parse((ROOT / "validation" / "blind" / f"{name}.py").read_text())
        modules = {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
        modules |= {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
        assert not [m for m in modules if m.startswith(draw.FORBIDDEN)]
    code = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r})\n"
        f"import {', '.join('validation.blind.' + n for n in names)}, validation.blind.draw\n"
        "print([m for m in sys.modules if m.startswith(validation.blind.draw.FORBIDDEN)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_trial_is_a_function_of_its_number():
    assert draw.draw(5, 3) == draw.draw(5, 3)
    assert draw.draw(5, 3) != draw.draw(5, 4)
    modes = {draw.draw(5, k).composition for k in range(60)}
    assert modes == {"null", "single", "pair", "off-library", "clutter"}
    counts = {"null": 0, "single": 1, "pair": 2, "off-library": 1}
    for mode, count in counts.items():
        assert len(draw.draw(5, 0, mode).effects) == count
    assert len(draw.draw(5, 0, "clutter").clutter) == 4
    assert replace(draw.draw(5, 0, "null")).effects == ()
