"""Pitch damper, attitude hold, and measured elevators flown again."""

import numpy as np
import pandas as pd
import pytest
from fly_campaigns import channel, fly, read, results
from tiers import sampled

from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.manoeuvres import Manoeuvre, sample

DT = 1 / 200
T = np.arange(401) * DT
ZERO = np.zeros_like(T)
# JSBSim's lag is Tustin's: with a = dt c, y[k] = (2 - a)/(2 + a) y[k-1] + a/(2 + a) (x[k] + x[k-1]).
# aircraft/gtm: 5 Hz; 15 ms are three frames, of which command_frames gives one to the command alone.
A = DT * 2 * np.pi * 5.0
FINE = {"log_hz": 200.0}


def servo(demand):
    late = np.concatenate([np.repeat(demand[:1], 2), demand[:-2]])
    y = late.copy()  # it starts settled
    for k in range(1, len(late)):
        y[k] = (2 - A) / (2 + A) * y[k - 1] + A / (2 + A) * (late[k] + late[k - 1])
    return y


def doublet(amplitude=0.02):
    return sample(Manoeuvre("doublet", amplitude, start_s=0.5, step_s=0.25), T)


def test_damper_moves_the_elevator_with_q_and_its_noise_of_the_same_sample(gtm, paper_trim):
    noise = 6.7e-3 * np.random.default_rng(1).standard_normal(len(T))
    flown = Flight(gtm, paper_trim, DT).fly(
        Inputs(doublet(), ZERO, ZERO, errors={"q_rad_s": noise, "theta_rad": ZERO}, damper_gain_s=0.1)
    )
    late = np.concatenate([[0.0], doublet()[:-1]])
    expected = paper_trim.elevator_rad + servo(late + 0.1 * (flown["q_rad_s"] + noise))
    np.testing.assert_allclose(flown["elevator_rad"], expected, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "gains",
    sampled(
        [{"damper_gain_s": 0.1, "attitude_gain": 0.3}, {"damper_gain_s": 0.1}, {"attitude_gain": 0.3}], 3
    ),
)
def test_loop_feeds_back_what_is_logged(tmp_path, gains):
    """From the logged q and theta, noise and bias and all, follows the logged (ideal) elevator."""
    plain = {
        "hold": {"value": 0.0, "unit": "s"},
        "delay": {"value": 0.0, "unit": "s"},
        "quantum": {"value": 0.0, "unit": "rad"},
    }
    quiet = {"noise_std": {"value": 0.0, "unit": "rad"}}
    out = fly(
        tmp_path,
        runs=2,
        augmentation=gains,
        sensors={"channel": {"theta_rad": plain, "elevator_rad": quiet}},
        **FINE,
    )
    command, elevator, q, theta = (
        channel(out, n) for n in ("elevator_command_rad", "elevator_rad", "q_rad_s", "theta_rad")
    )
    truth = pd.read_parquet(out / "truth.parquet")
    for run in range(2):
        start = truth["trim_alpha_rad"][run]
        late = np.concatenate([[0.0], (command[run] - command[run][0])[:-1]])
        demand = gains.get("damper_gain_s", 0.0) * q[run] + gains.get("attitude_gain", 0.0) * (
            theta[run] - start
        )
        y = servo(late + demand)
        # The servo forgets its start in 0.3 s (nine time constants).
        departure = elevator[run] - truth["trim_elevator_rad"][run]
        np.testing.assert_allclose(departure[80:], y[80:], atol=2e-5)
        assert np.ptp(departure[80:] - servo(late)[80:]) > 1e-3


@pytest.mark.slow
def test_gains_of_zero_change_nothing(tmp_path):
    open_loop = fly(tmp_path / "a", runs=2)
    zero = fly(tmp_path / "b", runs=2, augmentation={"damper_gain_s": 0.0, "attitude_gain": 0.0})
    pd.testing.assert_frame_equal(read(open_loop), read(zero), check_exact=True)


def test_damper_damps_and_attitude_hold_holds(gtm, paper_trim):
    t = np.arange(2001) * DT
    zero, gust = np.zeros_like(t), np.where(t >= 0.25, 1.0, 0.0)
    flight = Flight(gtm, paper_trim, DT)
    errors = {"q_rad_s": zero, "theta_rad": zero}
    free = flight.fly(Inputs(zero, zero, gust))
    damped = flight.fly(Inputs(zero, zero, gust, damper_gain_s=0.2, errors=errors))
    held = flight.fly(Inputs(zero, zero, gust, damper_gain_s=0.2, attitude_gain=2.0, errors=errors))
    assert np.std(damped["q_rad_s"]) < 0.8 * np.std(free["q_rad_s"])
    error, alone = (np.abs(x["theta_rad"] - paper_trim.alpha_rad) for x in (held, free))
    assert error.max() < 0.4 * alone.max()
    assert error[t > 5.0].max() < 0.2 * alone[t > 5.0].max()


def test_a_flight_forgets_the_loop_of_the_one_before(gtm, paper_trim):
    plain = Inputs(doublet(), ZERO, ZERO)
    fresh = Flight(gtm, paper_trim, DT).fly(plain)
    flight = Flight(gtm, paper_trim, DT)
    flight.fly(
        Inputs(
            doublet(),
            ZERO,
            ZERO + 1.0,
            {"q_rad_s": ZERO + 0.1},
            {"q_rad_s": ZERO + 0.1, "theta_rad": ZERO + 0.1},
            0.1,
            0.5,
        )
    )
    flight.fly(Inputs(doublet(), ZERO, ZERO, surface=True))
    again = flight.fly(plain)
    assert again.keys() == fresh.keys()
    for name, values in again.items():
        np.testing.assert_array_equal(values, fresh[name], err_msg=name)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A noise-free flight that logs every simulated sample."""
    return fly(tmp_path_factory.mktemp("recorded"), runs=1, gust=None, sensors={"ideal": True}, **FINE)


def replayed(folder, log, channel_name, **changes):
    entry = {"kind": "replay", "file": log, "channel": channel_name, "start_s": 0.0}
    return fly(folder, runs=1, gust=None, sensors={"ideal": True}, manoeuvre=[entry], **changes)


@pytest.mark.slow
def test_replayed_command_flies_the_flight_again(recorded, tmp_path):
    again = replayed(tmp_path, recorded / "logs" / "00000.parquet", "elevator_command_rad", **FINE)
    for name, unit in (("elevator_rad", 0.02), ("q_rad_s", 0.3), ("alpha_rad", 0.05), ("az_m_s2", 5.0)):
        # The log holds float32: 6e-8 of the command's value.
        np.testing.assert_allclose(channel(again, name), channel(recorded, name), atol=2e-6 * unit)


@pytest.mark.slow
def test_replayed_surface_is_the_surface(recorded, tmp_path):
    again = replayed(tmp_path, recorded / "logs" / "00000.parquet", "elevator_rad", **FINE)
    np.testing.assert_allclose(channel(again, "elevator_rad"), channel(recorded, "elevator_rad"), atol=1e-8)
    np.testing.assert_allclose(channel(again, "q_rad_s"), channel(recorded, "q_rad_s"), atol=1e-6)


@pytest.mark.slow
def test_surface_logged_at_50_hz_is_replayed_by_linear_interpolation(tmp_path):
    slow = fly(tmp_path / "slow", runs=1, gust=None, sensors={"ideal": True})
    again = replayed(tmp_path / "again", slow / "logs" / "00000.parquet", "elevator_rad", **FINE)
    t50, t200 = np.arange(101) / 50, np.arange(401) / 200
    expected = np.interp(t200, t50, channel(slow, "elevator_rad")[0])
    np.testing.assert_allclose(channel(again, "elevator_rad")[0], expected, atol=1e-8)


@pytest.mark.slow
def test_a_changed_record_is_another_campaign(recorded, tmp_path):
    log = recorded / "logs" / "00000.parquet"
    first = replayed(tmp_path, log, "elevator_command_rad")
    before = results(first)
    with pytest.raises(Exception, match="holds another campaign"):
        replayed(tmp_path, log, "elevator_rad")
    assert results(first) == before
