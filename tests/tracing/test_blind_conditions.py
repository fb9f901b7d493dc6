"""Blind modes in drifting airspeed, with a pitch damper and in coarse logs: what the truth says it flies is what it flies."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.logs.store import read_log
from validation.blind import draw, information, refit, results, scoring, sensors, set_scoring, surface, trials
from validation.blind.aircraft_xml import Body
from validation.blind.figures import CONDITIONS, DEG, LOG_STEP_S, G
from validation.blind.surface import Manoeuvre
from validation.blind.truths import Added

HOLD = Manoeuvre("doublet", 0.0, 1.0, 0.5)
FAULTY = (
    Added("elevator_delay", {"delay_s": 0.0123}),
    Added("actuator_lag", {"bandwidth_hz": 9.0}),
    Added("rate_limit", {"rate_rad_s": 0.4}),
    Added("backlash", {"width_rad": 0.001}),
    Added("gyro_lag", {"tau_s": 0.02}),
    Added("sensor_delay:q_rad_s", {"delay_s": 0.0137}),
    Added("gyro_scale", {"factor": 1.1}),
    Added("structural_mode", {"gain_s": 0.002, "frequency_hz": 7.0}),
)
CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2", "elevator_rad")


def log_of(trial, folder):
    """The log of a trial, flown in a process that does not know the tracer."""
    (place,) = trials.flown_apart([trial], [folder / "log"])
    return read_log(place / "log.parquet")


@pytest.mark.parametrize("mode", CONDITIONS)
def test_a_trial_has_one_effect_or_none_and_its_own_condition(mode):
    trials = [draw.draw(6, k, mode) for k in range(40)]
    assert trials == [draw.draw(6, k, mode) for k in range(40)]
    assert {len(t.effects) for t in trials} == {0, 1}
    flown = [m for t in trials for m in t.manoeuvres]
    swings, shears = ({abs(getattr(m, name)) for m in flown} for name in ("swing", "shear"))
    gains = [m.damper_s for m in flown]
    steps = {m.log_step_s for m in flown}
    if mode == "drift":
        assert swings == shears == {0.0, 0.1}
        assert all((m.swing == 0.0) != (m.shear == 0.0) for m in flown)
    else:
        assert swings == shears == {0.0}
    assert (min(gains) >= 0.2 and max(gains) <= 0.6) if mode == "loop" else not any(gains)
    assert steps == ({0.040, 0.052, 0.064, 0.080, 0.100} if mode == "coarse" else {LOG_STEP_S})


def test_other_modes_are_flown_as_before():
    plain = draw.draw(5, 3, "null").manoeuvres[0]
    assert plain == Manoeuvre(plain.kind, plain.amplitude_rad, plain.start_s, plain.unit_s, plain.phases)


@pytest.fixture(scope="module")
def calm():
    """A trial in calm air, white noise, no draws."""
    return replace(draw.draw(1, 0, "null"), air="calm", noise="white", body=Body(), duration_s=5.0)


@pytest.mark.parametrize("lead_s", [0.2, 2.0])
def test_a_phugoid_changes_the_airspeed_by_its_swing_from_the_start_of_the_record(calm, lead_s):
    """Lanchester: V/V0 - 1 = swing sin(omega t); the aircraft's own phugoid has drag and follows within a sixth."""
    truth, parts = draw.truth_of(calm, ())
    for swing in (0.1, -0.1):
        flown = draw.fly_record(truth, parts, replace(HOLD, swing=swing), 5.0, lead_s)
        relative = flown["airspeed_m_s"] / truth.airspeed_m_s - 1.0
        t = np.arange(len(relative)) * LOG_STEP_S
        wanted = swing * np.sin(2.0**0.5 * G / truth.airspeed_m_s * t)
        assert np.abs(relative - wanted).max() < abs(swing) / 6.0


def test_a_shear_changes_the_airspeed_and_not_the_speed_over_ground(calm):
    truth, parts = draw.truth_of(calm, ())
    flown = draw.fly_record(truth, parts, replace(HOLD, shear=0.1), 5.0, 0.2)
    change = flown["airspeed_m_s"][-1] / truth.airspeed_m_s - 1.0
    # the aircraft climbs and loses up to a third of it
    assert 0.06 < change < 0.1
    along = flown["ax_m_s2"] * np.cos(flown["alpha_rad"]) + flown["az_m_s2"] * np.sin(flown["alpha_rad"])
    assert abs(along[:25].mean()) < 0.1  # the airspeed changes by 0.86 m/s2


@pytest.mark.slow
def test_the_damper_steps_what_the_open_loop_computes_at_once(calm):
    """The same surface, flown in open loop, is the same flight to rounding; so are the readings of the gyro."""
    trial = replace(draw.draw(1, 1, "loop"), effects=FAULTY, air="calm", noise="white", duration_s=3.0)
    truth, parts = draw.truth_of(trial, trial.effects)
    flown, damper = draw.fly_damped(trial, truth, parts, 1, None, noisy=False)
    opened = draw.open_loop(trial, noisy=False)
    again = draw.fly_record(truth, parts, opened.manoeuvres[1], trial.duration_s, 0.2)
    for name in CHANNELS:
        assert again[name] == pytest.approx(flown[name], abs=1e-9 * np.ptp(flown[name]))
    readings = np.array(damper.readings[-len(flown["q_rad_s"]) :]) - sensors.BIAS["q_rad_s"]
    assert readings == pytest.approx(flown["q_rad_s"], abs=1e-12)


def test_a_damper_without_gain_leaves_the_open_loop(calm):
    trial = draw.draw(1, 1, "loop")
    manoeuvre = replace(trial.manoeuvres[0], damper_s=0.0)
    trial = replace(trial, manoeuvres=(manoeuvre,), effects=(), air="calm", duration_s=2.0)
    truth, parts = draw.truth_of(trial, ())
    flown, _ = draw.fly_damped(trial, truth, parts, 0, None, noisy=False)
    plain = draw.fly_record(truth, parts, manoeuvre, 2.0, 0.2)
    for name in CHANNELS:
        assert flown[name] == pytest.approx(plain[name], abs=1e-9 * np.ptp(plain[name]))


def test_a_damper_damps_and_its_reading_acts_after_its_delay(calm):
    """The surface that a damper adds is its gain times the held reading through the servo, 15 ms late."""
    gain = 0.5
    trial = replace(calm, composition="loop", manoeuvres=(replace(calm.manoeuvres[0], damper_s=gain),))
    truth, parts = draw.truth_of(trial, ())
    flown, damper = draw.fly_damped(trial, truth, parts, 0, None, noisy=False)
    plain = draw.fly_record(truth, parts, calm.manoeuvres[0], 5.0, 0.2)
    late = 3.0  # s: the doublet is over
    tail = slice(round(late / LOG_STEP_S), None)
    assert np.ptp(flown["q_rad_s"][tail]) < 0.3 * np.ptp(plain["q_rad_s"][tail])
    t = np.arange(len(damper.measured)) * surface.FINE_S
    held = gain * (np.array(damper.readings) - sensors.BIAS["q_rad_s"])
    at = np.floor((t - 0.015) / LOG_STEP_S + 1e-9).astype(int)
    demand = surface.command(trial.manoeuvres[0], t - 0.2 - 0.015) + np.where(at >= 0, held[at], 0.0)
    x, expected = 0.0, []
    for value in demand:
        expected.append(x)
        x += (1.0 - np.exp(-2.0 * np.pi * 5.0 * surface.FINE_S)) * (value - x)
    assert damper.measured == pytest.approx(expected, abs=1e-12)


@pytest.mark.slow
def test_the_log_of_a_loop_holds_the_readings_that_the_damper_saw(tmp_path):
    """Noise of the gyro moves the surface: its rate of change follows the noise of the logged reading before."""
    trial = replace(
        draw.draw(1, 1, "loop"), effects=(), body=Body(), air="calm", noise="white", duration_s=5.0
    )
    trial = replace(trial, manoeuvres=(replace(trial.manoeuvres[0], amplitude_rad=1e-9, damper_s=0.5),))
    q = log_of(trial, tmp_path).channels["q_rad_s"]
    truth, parts = draw.truth_of(trial, ())
    _, damper = draw.fly_damped(trial, truth, parts, 0, None)
    assert q == pytest.approx(np.array(damper.readings[10:]), abs=1e-7)
    q = np.array(damper.readings[10:]) - sensors.BIAS["q_rad_s"]
    measured = np.array(damper.measured)[:: round(LOG_STEP_S / surface.FINE_S)][10:]
    moved = measured[2:] - np.exp(-2.0 * np.pi * 5.0 * LOG_STEP_S) * measured[1:-1]
    # over a sample: the older reading 15 ms, the newer one 5 ms of the servo's motion
    share = np.exp(-2.0 * np.pi * 5.0 * np.array([0.020, 0.005, 0.0]))
    expected = 0.5 * ((share[1] - share[0]) * q[:-2] + (share[2] - share[1]) * q[1:-1])
    assert moved == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_a_coarse_log_holds_samples_of_the_same_flight(calm, tmp_path):
    truth, parts = draw.truth_of(calm, ())
    doublet = calm.manoeuvres[0]
    fine = draw.fly_record(truth, parts, doublet, 5.0, 0.2)
    coarse = draw.fly_record(truth, parts, replace(doublet, log_step_s=0.1), 5.0, 0.2)
    for name in CHANNELS:
        assert coarse[name] == pytest.approx(fine[name][::5], abs=1e-12)
    slow = log_of(replace(calm, manoeuvres=(replace(doublet, log_step_s=0.064),)), tmp_path)
    assert slow.t_s[1] == pytest.approx(0.064)
    assert slow.metadata["sample_rate_hz"] == pytest.approx(15.625)


def test_a_multisine_stays_below_a_quarter_of_the_rate():
    trial = next(t for k in range(40) if (t := draw.draw(6, k, "coarse")).log_step_s == 0.1)
    multisine = next(m for m in trial.manoeuvres if m.kind == "multisine")
    t = np.arange(0.0, 20.0, 0.01)
    power = np.abs(np.fft.rfft(surface.command(replace(multisine, start_s=-1.0), t))) ** 2
    frequency = np.fft.rfftfreq(t.size, 0.01)
    assert power[frequency > 2.45].sum() < 1e-3 * power.sum()


@pytest.mark.long
def test_fewer_samples_tell_less_of_an_effect(calm):
    """White noise in calm air: the noncentrality of a scale falls with the number of samples."""
    effects = (Added("gyro_scale", {"factor": 1.05}),)
    trial = replace(calm, composition="coarse", effects=effects)
    found = []
    for step in (0.02, 0.04):
        manoeuvres = tuple(replace(m, log_step_s=step, highest_hz=6.0) for m in calm.manoeuvres)
        found.append(refit.lambdas(replace(trial, manoeuvres=manoeuvres))["gyro_scale"])
    # sensors at 50 Hz are white and the refit is bound by declared uncertainty in neither
    assert 0.35 < found[1] / found[0] < 0.75


@pytest.mark.long
@pytest.mark.parametrize("mode", CONDITIONS)
def test_the_truth_fits_its_own_held_out_records(mode, tmp_path):
    """Calm air: the error of the true aircraft, biases and initial state free, is the sensors' noise."""
    numbers = (k for k in range(60) if (t := draw.draw(6, k, mode)).air == "calm" and t.noise == "white")
    trial = draw.draw(6, next(numbers), mode)
    log = log_of(trial, tmp_path)
    records = [
        np.column_stack([log.channels[name][log.rows(k)] for name in CHANNELS[:3]])
        for k in range(len(log.run_ids))
    ]
    error = information.oracle(draw.open_loop(trial, noisy=True), records)["free_run"]
    for name in CHANNELS[:3]:
        assert error[name] == pytest.approx(sensors.NOISE[name], rel=0.15)


def test_scores_of_conditions():
    def case(effects, answered, provisional=False, verdict="traced", strength=90.0):
        return {
            "truth": {
                "trial": {
                    "composition": "drift",
                    "duration_s": 5.0,
                    "manoeuvres": [{"log_step_s": 0.1}] * 6,
                    "body": {"mass": 1.0, "inertia": 1.0, "cg": 0.0},
                    "effects": [{"key": key, "values": {"tau_s": 0.03}} for key in effects],
                },
                "lambda": dict.fromkeys(effects, strength),
                "increments": {},
                "oracle": {"free_run": {}, "signal": {}},
            },
            "answer": {
                "verdict": verdict,
                "provisional": provisional,
                "effects": [
                    {"name": name, "parameters": {}, "indistinguishable_from": alike}
                    for name, alike in answered
                ],
                "alternatives": [],
            },
        }

    lag = ["vane_lag"]
    cases = [
        case(lag, [("vane_lag", [])]),
        case(lag, [("vane_arm", ["vane_lag"])]),
        case(lag, [("gyro_lag", [])]),
        case(lag, [("gyro_lag", [])], provisional=True),
        case(lag, [], verdict="unexplained"),
        case(lag, [("gyro_lag", [])], strength=20.0),
        case([], [("gyro_lag", [])]),
        case([], [], verdict="none"),
    ]
    found = set_scoring.set_scores(cases)["drift"]
    counts = {
        k: (found[k].hits, found[k].count) for k in ("reported", "wrong_without_reservation", "false_trace")
    }
    assert counts == {"reported": (2, 5), "wrong_without_reservation": (1, 5), "false_trace": (1, 2)}
    assert "| false traces on trials without an effect | 1 of 2" in results.markdown(
        scoring.score([]), {"drift": found}
    )


def test_angles_of_the_entry():
    """At a swing of 10 % the phugoid dives with 0.1 sqrt(2) rad when it passes the trim's airspeed."""
    assert draw.entry(42.85, 0.1, 0.0) == pytest.approx((1.0, -0.1414), abs=1e-4)
    assert draw.entry(42.85, 0.1, 0.0)[1] / DEG == pytest.approx(-8.1, abs=0.01)
