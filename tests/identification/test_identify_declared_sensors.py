"""Errors that aircraft.toml declares for its instruments are taken out of the records before they are identified."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.aircraft import Sensor
from airtruth.errors import LogError, StoreError
from airtruth.identification import METHODS, Options, identify, identify_batch
from airtruth.identification.declared_sensors import as_ideal, taken_out
from airtruth.identification.store import write_estimates
from airtruth.identification.stored import read_stored
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.sensor_errors import SensorErrors
from airtruth.physics.sensors import accelerometer_az, at_instrument, measure, vane_equation
from airtruth.physics.short_period import system
from airtruth.quantity import Quantity
from validation.linear_flight import DEG, GTM, THETA, as_log, fly, gtm_scale

ARMS = {"alpha_rad": {"x": 1.5}, "az_m_s2": {"x": 0.3, "z": -0.2}}


def smooth_input(t_s):
    """Two tones of 0.5 and 1.3 Hz from 1 to 6 s behind a smooth edge: without corners, which no interpolation keeps."""
    edge = np.clip(np.minimum(t_s - 1.0, 6.0 - t_s), 0.0, 1.0)
    return edge**2 * (3.0 - 2.0 * edge) * (np.sin(np.pi * t_s) + np.sin(2.6 * np.pi * t_s))


def declaring(**channels):
    """The GTM of the simulation, with errors of its instruments and no others."""
    own = aircraft.load("gtm")
    sensors = {
        name: Sensor(**{key: Quantity(value=value) for key, value in errors.items()})
        for name, errors in channels.items()
    }
    constants = own.constants.model_copy(
        update={
            name: getattr(GTM, name) for name in ("wing_area_m2", "chord_m", "mass_kg", "inertia_yy_kg_m2")
        }
    )
    file = own.file.model_copy(update={"sensors": sensors, "elevator_actuator": None})
    return own.model_copy(update={"constants": constants, "file": file})


@pytest.fixture(scope="module")
def fine():
    """At 200 Hz, where the readings of slow and late instruments are made."""
    return fly(rate_hz=200, duration_s=8.0, shape=smooth_input)


@pytest.fixture(scope="module")
def true(fine):
    return logged(fine)


def logged(fine):
    """Every second sample: 100 Hz."""
    channels = {name: np.ascontiguousarray(values[:, ::2]) for name, values in fine.channels.items()}
    return replace(fine, dt_s=2.0 * fine.dt_s, t_s=fine.t_s[:, ::2], channels=channels)


def at_arms(batch):
    """The record of a vane and an accelerometer off the CG; q_dot is that of the equations of motion."""
    a, b = system(THETA, gtm_scale())
    c = batch.channels
    alpha, q, de = c["alpha_rad"] - 5.56 * DEG, c["q_rad_s"], c["elevator_rad"] - 0.1 * DEG
    q_dot = a[1, 0] * alpha + a[1, 1] * q + b[1] * de
    vane, own = ARMS["alpha_rad"], ARMS["az_m_s2"]
    moved = {
        "alpha_rad": vane_equation(c["alpha_rad"], q, vane["x"], c["airspeed_m_s"]),
        "az_m_s2": accelerometer_az(c["az_m_s2"], q_dot, own["x"], q, own["z"]),
    }
    return replace(batch, channels={**c, **moved})


def percent(batch, plane, method):
    options = Options(tolerance=1e-9, covariance="none")
    row = identify(as_log(batch), plane, [method], options).to_frame().iloc[0]
    return 100.0 * (row[list(LONGITUDINAL.parameters)].to_numpy(dtype=float) / THETA - 1.0)


@pytest.mark.parametrize("method", ["ls", "iv-f1", "iv-refined", "frequency"])
def test_a_vane_and_an_accelerometer_off_the_cg_are_moved_there(true, method):
    """The estimate is that of sensors at the CG: the same within 0.2 % of each truth (the low-pass of q before its rate)."""
    reading = at_arms(true)
    ideal = percent(true, declaring(), method)
    np.testing.assert_allclose(percent(reading, declaring(**ARMS), method), ideal, atol=0.2)


def test_an_undeclared_vane_costs_what_its_arm_says(true):
    """CLalpha alpha = CLalpha (alpha_vane + q x/V) adds CLalpha 2 x/c to CLq; the lift equation, which counts g/V = 0.2 of
    the normal force, resists. With x = 0.1 m: 3.44 of 30.8."""
    c = true.channels
    vane = vane_equation(c["alpha_rad"], c["q_rad_s"], 0.1, c["airspeed_m_s"])
    off = percent(replace(true, channels={**c, "alpha_rad": vane}), declaring(), "ls")[1] / 100.0 * THETA[1]
    assert off == pytest.approx(THETA[0] * 2.0 * 0.1 / GTM.chord_m, rel=0.15)


@pytest.mark.parametrize(
    ("channel", "errors", "atol"),
    [
        ("alpha_rad", {"delay": 0.045}, 0.02),
        ("q_rad_s", {"delay": 0.02, "scale": 1.1}, 0.02),
        ("elevator_rad", {"delay": 0.025, "scale": 0.9}, 0.02),
        ("az_m_s2", {"lag": 0.05}, 0.4),
        ("alpha_rad", {"lag": 0.05}, 0.4),
        ("airspeed_m_s", {"scale": 1.05}, 1e-6),
    ],
)
def test_a_declared_scale_delay_or_lag_is_undone(fine, true, channel, errors, atol):
    """Readings are made by `measure` at 200 Hz; the estimate is that of the true channels within ``atol`` % of each truth.

    The corners of q'' at the steps of the held command remain of a lag, whose rate is low-passed.
    """
    plane = declaring(**{channel: errors})
    made = SensorErrors(**taken_out(plane)[channel])
    values = measure(made, fine.channels[channel], fine.dt_s, np.zeros_like(fine.t_s))
    reading = logged(replace(fine, channels={**fine.channels, channel: values}))
    ideal = percent(true, declaring(), "iv-f1")
    np.testing.assert_allclose(percent(reading, plane, "iv-f1"), ideal, atol=atol, rtol=0.0)


def test_a_declared_position_error_is_undone(true):
    """The reading divided by 1 + slope (alpha - mean alpha) is the airspeed itself, to rounding."""
    plane = declaring(airspeed_m_s={"alpha_slope": -0.8})
    taken = taken_out(plane)
    assert taken == {"airspeed_m_s": {"alpha_slope_per_rad": -0.8}}
    read = at_instrument("airspeed_m_s", true.channels, SensorErrors(alpha_slope_per_rad=-0.8))
    made = as_ideal(replace(true, channels={**true.channels, "airspeed_m_s": read}), taken)
    np.testing.assert_allclose(made.channels["airspeed_m_s"], true.channels["airspeed_m_s"], rtol=1e-14)


def test_the_channels_themselves_are_the_true_ones(true):
    """In closed form: alpha of the vane plus q x/V, and az plus x q_dot + z q^2 with q_dot of the low-passed q.

    x q_dot reaches 0.7 m/s2; the steps of the held command are corners of q_dot, which a cubic through q rounds by 0.001 rad/s2.
    """
    made = as_ideal(at_arms(true), taken_out(declaring(**ARMS)))
    np.testing.assert_allclose(made.channels["alpha_rad"], true.channels["alpha_rad"], rtol=1e-12)
    a, b = system(THETA, gtm_scale())
    c = true.channels
    q_dot = (
        a[1, 0] * (c["alpha_rad"] - 5.56 * DEG)
        + a[1, 1] * c["q_rad_s"]
        + b[1] * (c["elevator_rad"] - 0.1 * DEG)
    )
    lost = 0.3 * (zero_phase(q_dot, butterworth(12.5, 4, true.dt_s)) - q_dot)
    inner = slice(50, -50)
    np.testing.assert_allclose(
        made.channels["az_m_s2"][0, inner], (c["az_m_s2"] + lost)[0, inner], rtol=0.0, atol=4e-4
    )


def test_records_without_declared_errors_stay_the_same_object(true):
    assert as_ideal(true, taken_out(declaring(alpha_rad={"bias": 0.01, "noise_std": 0.1}))) is true
    assert as_ideal(true, taken_out(GTM)) is true


def test_a_delay_shortens_the_record_by_what_no_sample_shows(true):
    """43 ms at 100 Hz: five samples; 40 ms: four, whatever the rounding of 0.04/0.01."""
    for delay_s, lost in ((0.043, 5), (0.04, 4)):
        made = as_ideal(true, taken_out(declaring(q_rad_s={"delay": delay_s})))
        assert made.t_s.shape[1] == true.t_s.shape[1] - lost
        assert {values.shape for values in made.channels.values()} == {made.t_s.shape}


def test_a_reconstructed_alpha_had_no_vane(true):
    from airtruth.physics.reconstruction import COLUMNS

    zeros = {name: np.zeros_like(true.t_s) for name in COLUMNS}
    batch = replace(true, channels={**true.channels, **zeros})
    made = as_ideal(batch, taken_out(declaring(**ARMS)))
    np.testing.assert_array_equal(made.channels["alpha_rad"], true.channels["alpha_rad"])


def test_the_result_states_what_was_taken_out(true):
    found = identify(as_log(true), declaring(**ARMS), ["ls"])
    assert found.notes[0] == (
        "errors that the aircraft declares for its instruments are taken out of alpha_rad (1.5 m ahead of the CG), "
        "az_m_s2 (0.3 m ahead of the CG, -0.2 m below the CG)"
    )
    assert not identify(as_log(true), declaring(), ["ls"]).notes


def test_estimates_with_other_declared_errors_are_not_merged(true, tmp_path):
    path = tmp_path / "estimates.parquet"
    write_estimates(path, identify(as_log(true), declaring(**ARMS), ["ls"]))
    write_estimates(path, identify(as_log(true), declaring(**ARMS), ["ls"]))
    for method in ("ls", "iv-f1"):
        other = identify(as_log(true), declaring(), [method])
        with pytest.raises(StoreError, match="which declares other errors of its instruments"):
            write_estimates(path, other)
    write_estimates(path, other, force=True)
    assert read_stored(path)[0]["method"].tolist() == ["iv-f1"]


def test_a_delay_beyond_the_record_is_an_error_that_names_it(true):
    with pytest.raises(
        LogError, match=r"q_rad_s: the aircraft declares a delay of 9 s, and the records last 7\.99 s"
    ):
        identify(as_log(true), declaring(q_rad_s={"delay": 9.0}), ["ls"])


def test_a_page_shows_the_records_that_were_identified(true):
    """Beside the simulation stands alpha at the CG; of the raw record its vane would differ by q x/V."""
    histories = identify(as_log(at_arms(true)), declaring(**ARMS), ["ls"]).histories()
    shown = histories.records[0].measured["alpha_rad"]
    np.testing.assert_allclose(shown, true.channels["alpha_rad"][0], rtol=1e-12)


def test_every_method_takes_the_corrected_records(true):
    """Runs of every method without a command: no one reads the raw channels."""
    names = [m.name for m in METHODS.values() if not m.channels]
    table = identify(as_log(at_arms(true)), declaring(**ARMS), names, Options(covariance="none")).to_frame()
    for name in names:
        row = table[table["method"] == name].iloc[0]
        assert row["CLq"] == pytest.approx(THETA[1], rel=0.05), name


@pytest.mark.grid
@pytest.mark.parametrize(
    ("method", "percent_of_truth"), [("filter-error", 2.5), ("iv-refined", 2.5), ("frequency", 0.5)]
)
def test_an_accelerometer_off_the_cg_costs_little_where_steps_move_the_elevator(method, percent_of_truth):
    """Sensor noise and doublets at 50 Hz: against the same noise at the CG, CLde moves by at most this share of itself.

    Without the correction the arm of 0.3 m adds m c x/Iyy Cmde = -0.62 to CLde = 0.48.
    """
    still, noisy = fly(runs=30), fly(runs=30, noise=1.0)
    a, b = system(THETA, gtm_scale())
    c = still.channels
    alpha, de = c["alpha_rad"] - 5.56 * DEG, c["elevator_rad"] - 0.1 * DEG
    q_dot = a[1, 0] * alpha + a[1, 1] * c["q_rad_s"] + b[1] * de
    reading = {**noisy.channels, "az_m_s2": noisy.channels["az_m_s2"] - 0.3 * q_dot}
    corrected = as_ideal(replace(noisy, channels=reading), {"az_m_s2": {"x_m": 0.3}})
    options = Options(covariance="none")
    one, other = (
        identify_batch(batch, GTM, method, options).theta.mean(axis=0) for batch in (noisy, corrected)
    )
    assert abs(other[2] - one[2]) < 0.01 * percent_of_truth * THETA[2]
