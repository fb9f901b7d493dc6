"""Records, plants and settings of the lateral-directional motion, against JSBSim and the published derivatives."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.errors import AircraftError, LogError
from airtruth.physics.lateral import lateral_scale, lateral_system
from airtruth.physics.motion import LATERAL
from airtruth.quantity import Quantity
from airtruth.simulation.probe_lateral import lateral_forces, pitch_forces
from airtruth.tracing.model.declared import UNCERTAINTY, declared_covariance
from airtruth.tracing.model.plant import ForceTable, linear, looked_up
from airtruth.tracing.model.probed import probed_lateral, trim_of
from airtruth.tracing.model.records import FINE
from airtruth.tracing.options import TraceOptions
from airtruth.tracing.prepare import prepare, undo_input_sensors
from airtruth.units import DEG, G0
from validation import lateral_truth

GTM = aircraft.load("gtm")
SPEED, DENSITY, ALTITUDE = 42.85, 0.9931, 2133.6
PUBLISHED = np.array(
    [
        [-1.0158, 0.063, 0.8565, -0.0157, 0.3406],
        [-0.1403, -0.3352, 0.1472, -0.0718, 0.0266],
        [0.2185, -0.0528, -0.3897, -0.0035, -0.1700],
    ]
)
"""From an independent integration of the GTM's tables at 75 kt, 7000 ft."""
HALF = GTM.constants.span_m / (2.0 * SPEED)
ENDS = np.array([6.0 * DEG, 1.1 * HALF, 0.55 * HALF, 4.0 * DEG, 4.0 * DEG])
NAMES = [signal.name for signal in LATERAL.signals]
REACH = {name: (-end, end) for name, end in zip(NAMES, ENDS, strict=True)} | {"alpha": (3.5 * DEG, 8.0 * DEG)}
LATERALLY = TraceOptions(motion="lateral")


@pytest.fixture(scope="module")
def plant():
    return probed_lateral(GTM, trim_of(GTM, SPEED, DENSITY, ALTITUDE, 0.0, LATERAL), REACH)


@pytest.fixture(scope="module")
def log():
    return lateral_truth.log_of(*lateral_truth.record_pair(seed=1), *lateral_truth.record_pair(seed=2))


@pytest.fixture(scope="module")
def case(log):
    return prepare([log], GTM, (), LATERALLY)


def states(count, seed):
    """Random angles of attack and signals within the range of the tables."""
    rng = np.random.default_rng(seed)
    signals = ENDS * rng.uniform(-1.0, 1.0, (count, 5))
    return rng.uniform(*REACH["alpha"], count), signals


def tables_at(plant, alpha, signals, pressure):
    """Forces of the tables in states (states,) of the angle of attack and (states, signals)."""
    known = dict(zip(NAMES, signals.T, strict=True))
    return looked_up(plant, known | {"alpha": alpha}, np.full(len(alpha), pressure))


def compared(plant, alpha, signals):
    """Forces of JSBSim and of the tables, and the range of the first."""
    raw = signals.copy()
    raw[:, 1:3] *= 2.0 * plant.trim.airspeed_m_s / GTM.constants.span_m
    flown = lateral_forces(GTM, plant.trim, alpha, raw)
    pressure = 0.5 * plant.trim.density_kg_m3 * plant.trim.airspeed_m_s**2
    return (
        flown,
        tables_at(plant, alpha, signals, pressure),
        np.ptp(flown, axis=0),
    )


def test_the_probed_derivatives_are_the_published_ones(plant):
    np.testing.assert_allclose(plant.derivatives.reshape(3, 5), PUBLISHED, atol=2e-4)


def test_the_tables_hold_jsbsims_forces_over_alpha_and_each_signal(plant):
    alpha, signals = states(200, 0)
    _, _, whole = compared(plant, alpha, signals)
    for number in range(5):
        own = np.tile(plant.trim_signals, (200, 1))
        own[:, number] = signals[:, number]
        flown, tables, _ = compared(plant, alpha, own)
        assert (np.abs(flown - tables) < 5e-4 * whole).all()


def test_the_sum_of_tables_is_within_three_thousandths_of_jsbsims_forces(plant):
    flown, tables, span = compared(plant, *states(1000, 1))
    error = flown - tables
    assert (np.sqrt((error**2).mean(axis=0)) < 0.003 * span).all()
    assert (np.abs(error).max(axis=0) < 0.012 * span).all()


def test_rudder_and_aileron_lose_force_with_sideslip_and_no_other_pair_counts(plant):
    """The products that the sum of tables lacks: those of the GTM's surfaces with beta."""
    alpha, signals = states(300, 2)
    _, _, whole = compared(plant, alpha, signals)
    for first in range(5):
        for second in range(first + 1, 5):
            own = np.tile(plant.trim_signals, (300, 1))
            own[:, [first, second]] = signals[:, [first, second]]
            flown, tables, _ = compared(plant, alpha, own)
            found = (np.abs(flown - tables).max(axis=0) / whole).max()
            assert found > 1e-3 if (first, second) in ((0, 3), (0, 4)) else found < 1e-3


def test_ailerons_pitch_the_gtm():
    """-66 +- 1.3 1/s2 for the square of the aileron, by least squares on q' of six flights in calm air (combined.toml)."""
    at = trim_of(GTM, SPEED, DENSITY, ALTITUDE, 0.0, LATERAL)
    signals = np.tile(at.origin(LATERAL), (3, 1))
    signals[1:, NAMES.index("aileron")] += np.array([3.5, -3.5]) * DEG
    forces = pitch_forces(GTM, at, np.full(3, at.alpha_rad), signals)
    assert np.abs(forces[0]).max() < 1e-9
    assert forces[1:, 1].mean() / GTM.constants.inertia_yy_kg_m2 == pytest.approx(
        -66.0 * (3.5 * DEG) ** 2, rel=0.2
    )


def test_slopes_of_the_tables_at_the_trim_are_the_derivatives(plant):
    c = GTM.constants
    scale = c.wing_area_m2 * np.array([1.0, c.span_m, c.span_m])
    step = np.array([0.5 * DEG, DEG * HALF, DEG * HALF, 0.5 * DEG, 0.5 * DEG])
    for number in range(5):
        ends = np.tile(plant.trim_signals, (2, 1))
        ends[:, number] += [-step[number], step[number]]
        low, high = tables_at(plant, np.full(2, plant.trim_alpha_rad), ends, 1.0)
        slope = (high - low) / (2.0 * step[number] * scale)
        np.testing.assert_allclose(slope, plant.derivatives.reshape(3, 5)[:, number], atol=1e-3)


def test_an_aircraft_in_trim_stays_there(plant):
    """The air holds the weight's side component, and no moment is left."""
    at = plant.trim
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    force = tables_at(plant, np.array([at.alpha_rad]), plant.trim_signals[None], pressure)
    assert np.abs(force).max() < 1e-6


def test_tables_and_constants_that_the_axes_do_not_address_are_refused(plant):
    """A compiled kernel reads past the end of an array."""
    table = plant.tables[0]
    with pytest.raises(ValueError, match="table over alpha, beta: values have the shape"):
        ForceTable(table.signals, table.axes, table.values[:-1])
    with pytest.raises(ValueError, match="constant has the shape"):
        replace(plant, constant=plant.constant[:-1])
    with pytest.raises(ValueError, match="axis alpha of a table"):
        replace(
            plant,
            tables=(table, ForceTable(table.signals, (table.axes[0][:-1], table.axes[1]), table.values[:-1])),
        )


def test_the_linear_model_is_in_trim_at_the_records_own_start():
    derivatives, start, phi = PUBLISHED.ravel(), np.array([0.02, 0.0, 0.0, 0.01, -0.03]), 0.05
    pressure = 0.5 * DENSITY * SPEED**2
    weight = GTM.constants.mass_kg * G0 * np.cos(0.1) * np.sin(phi)
    plant = linear(GTM, LATERAL, derivatives, pressure, start, np.array([-weight, 0.0, 0.0]))
    alpha = np.array([0.1, 0.1])
    moved = start + np.array([0.0, 0.01, 0.02, 0.0, 0.03])
    at_rest, away = tables_at(plant, alpha, np.stack([start, moved]), pressure)
    np.testing.assert_allclose(at_rest, [-weight, 0.0, 0.0], atol=1e-9)
    c = GTM.constants
    scale = pressure * c.wing_area_m2 * np.array([1.0, c.span_m, c.span_m])
    np.testing.assert_allclose(away - at_rest, scale * (PUBLISHED @ (moved - start)), rtol=1e-9)


def test_records_have_the_outputs_and_controls_of_the_motion(case, log):
    first = case.fitted.records[0].signals
    rows = log.rows(0)
    assert first.motion is LATERAL
    for column, name in enumerate(LATERAL.output_channels):
        np.testing.assert_array_equal(first.y[:, column], log.channels[name][rows])
    assert first.controls_rad.shape == (2, (first.y.shape[0] - 1) * first.sub * FINE + 1)
    np.testing.assert_allclose(first.sampled_controls_rad[1], log.channels["rudder_rad"][rows], atol=1e-3)
    assert first.alpha_rad.shape == first.q_rad_s.shape == first.airspeed_m_s.shape
    noisy = np.diff(log.channels["q_rad_s"][rows]).std()
    assert np.diff(first.q_rad_s[:: first.sub]).std() < 0.5 * noisy  # noise of the gyro is no motion
    np.testing.assert_allclose(first.ground_m_s, first.airspeed_m_s, atol=0.3)
    assert case.fitted.records[0].gust_length_m == pytest.approx(533.4)
    assert not case.notes


def test_one_control_of_a_part_of_a_record_is_that_of_the_record(case):
    whole = case.fitted.records[0].signals
    part = whole.part("second half", 100, 200, 400)
    cells = whole.sub * FINE
    np.testing.assert_array_equal(part.controls_rad, whole.controls_rad[:, 200 * cells : 399 * cells + 1])
    np.testing.assert_array_equal(
        part.with_lead.alpha_rad, whole.alpha_rad[100 * whole.sub : 399 * whole.sub + 1]
    )
    np.testing.assert_array_equal(part.with_lead.y, whole.y[100:400])


def test_settings_are_those_of_the_declared_instruments(case):
    settings = case.fitted.settings
    assert settings.layout.motion is LATERAL
    assert settings.noise == pytest.approx(
        [0.033 * DEG, 0.522 * DEG, 0.333 * DEG, 0.05 * DEG, 0.0065 * G0], rel=0.01
    )
    assert settings.measured.all()


def test_without_a_sideslip_vane_beta_is_a_state_and_no_output(log):
    less = replace(log, channels={n: x for n, x in log.channels.items() if n != "beta_rad"})
    made = prepare([less], GTM, (), LATERALLY)
    assert made.fitted.settings.measured.tolist() == [False, True, True, True, True]
    assert any("beta_rad was not measured" in note for note in made.notes)
    first = made.fitted.records[0].signals
    flown = log.channels["beta_rad"][log.rows(0)]
    assert np.abs(first.y[:, 0] - flown).max() < 1.5 * DEG


def test_a_steady_flight_stands_for_known_inputs_that_are_absent(log):
    less = replace(
        log,
        channels={n: x for n, x in log.channels.items() if n not in ("alpha_rad", "theta_rad", "q_rad_s")},
    )
    made = prepare([less], GTM, (), LATERALLY)
    record = made.fitted.records[0]
    assert (record.signals.alpha_rad == record.plant.trim_alpha_rad).all()
    assert (record.signals.theta_rad == record.plant.trim_alpha_rad).all()
    assert not record.signals.q_rad_s.any()
    assert any("alpha_rad, q_rad_s, theta_rad" in note for note in made.notes)


def test_still_surfaces_are_refused(log):
    still = {
        n: np.zeros_like(x) if n in ("aileron_rad", "rudder_rad") else x for n, x in log.channels.items()
    }
    with pytest.raises(LogError, match=r"moves the aileron or the rudder by 0\.1 deg"):
        prepare([replace(log, channels=still)], GTM, (), LATERALLY)


def test_one_record_is_halved_where_both_controls_have_made_half_of_their_travel(log):
    one = lateral_truth.log_of(lateral_truth.record_pair(seed=4)[0])
    first, second = prepare([one], GTM, (), LATERALLY).fitted.records
    travel = [np.abs(np.diff(r.signals.sampled_controls_rad, axis=1)).sum() for r in (first, second)]
    assert travel[0] == pytest.approx(travel[1], rel=0.1)
    assert first.remainder.shape[1] == first.signals.airspeed_m_s.size


def test_an_alpha_vane_off_the_plane_of_symmetry_is_corrected_by_the_roll_rate(case, gtm):
    vane = gtm.file.sensors["alpha_rad"].model_copy(
        update={"y": Quantity(value=1.5), "x": Quantity(value=0.5)}
    )
    file = gtm.file.model_copy(update={"sensors": gtm.file.sensors | {"alpha_rad": vane}})
    signals = case.fitted.records[0].signals
    before = undo_input_sensors(signals, gtm)
    moved = undo_input_sensors(signals, gtm.model_copy(update={"file": file}))
    own = gtm.file.sensors["alpha_rad"]
    p = np.interp(
        np.arange(signals.alpha_rad.size) / signals.sub, np.arange(signals.y.shape[0]), signals.y[:, 1]
    )
    expected = ((0.5 - own.x.value) * moved.q_rad_s - (1.5 - own.y.value) * p) / moved.airspeed_m_s
    np.testing.assert_allclose(moved.alpha_rad - before.alpha_rad, expected, atol=1e-12)


def test_mass_and_inertias_widen_their_own_coefficients():
    values = PUBLISHED.ravel()
    silent = GTM.model_copy(update={"file": GTM.file.model_copy(update={"mass": None})})
    own = np.diag(declared_covariance(silent, values, LATERAL))
    relative, least = (np.array(x) for x in UNCERTAINTY["lateral"])
    np.testing.assert_allclose(own, np.maximum(relative * np.abs(values), least) ** 2)
    mass = GTM.file.mass
    names = ("inertia_xx", "inertia_zz", "inertia_xz")
    inertia = {name: getattr(mass, name) for name in names}

    def matrix(values):
        xx, zz, xz = values
        return np.array([[xx, -xz], [-xz, zz]])

    nominal = [inertia[name].value for name in names]
    for number, name in enumerate(names):
        kept = {
            n: getattr(mass, n).model_copy(update={"std": 0.0}) for n in ("mass", "inertia_yy", "cg", *names)
        }
        alone = mass.model_copy(update=kept | {name: inertia[name]})
        plane = GTM.model_copy(update={"file": GTM.file.model_copy(update={"mass": alone})})
        more = declared_covariance(plane, values, LATERAL) - np.diag(own)
        step = 1e-6 * nominal[0]
        moved = [v + (step if i == number else 0.0) for i, v in enumerate(nominal)]
        moments = values[LATERAL.row("Cl").start :].reshape(2, 5)
        apparent = (
            matrix(nominal) @ np.linalg.inv(matrix(moved)) @ moments
        )  # accelerations are those of the moved inertia
        slope = inertia[name].std * ((apparent - moments) / step).ravel()
        np.testing.assert_allclose(more[5:, 5:], np.outer(slope, slope), rtol=1e-4, atol=1e-12)


def test_an_aircraft_without_lateral_surfaces_needs_declared_derivatives(log):
    model = GTM.file.jsbsim.model_copy(update={"aileron": None})
    bare = GTM.model_copy(update={"file": GTM.file.model_copy(update={"jsbsim": model})})
    with pytest.raises(AircraftError, match="CYbeta"):
        prepare([log], bare, (), LATERALLY)
    stated = dict(zip(LATERAL.parameters, (Quantity(value=v) for v in PUBLISHED.ravel()), strict=True))
    file = bare.file.model_copy(update={"derivatives": stated})
    made = prepare([log], bare.model_copy(update={"file": file}), (), LATERALLY)
    assert made.model == "linear"
    assert "linear lateral model" in made.notes[0]
    system = lateral_system(
        made.fitted.records[0].plant.derivatives, lateral_scale(GTM.constants, SPEED, DENSITY, 0.097, 0.097)
    )
    np.testing.assert_allclose(np.abs(np.linalg.eigvals(system.a)).max(), 5.985, rtol=0.01)
