"""A large transport with a slow vane and a late elevon: the check has to name the lag, and must not call it agreement.

The figures follow the second row of a review of real flights: vane lag 0.45 s, elevon delay 90 ms.
"""

from dataclasses import replace

import numpy as np
import pytest
from tiers import sampled

from airtruth.checks.kinematics import check_kinematics
from studies import check_flights as flights

LAG_S, DELAY_S = 0.45, 0.09


def transport(seed, rate_hz=10.0, gust_m_s=0.3, duration_s=40.0):
    """One record: 7 m chord, 170 m/s; the forces follow the measured elevon after the delay."""
    rng = np.random.default_rng(seed)
    one = replace(
        flights.plant(rng, 7.0), speed_m_s=170.0, lift_1_s=0.7, lift_elevator_1_s=0.05, stiffness_1_s2=1.6, damping_1_s=0.8,
        elevator_1_s2=2.0, frequency_rad_s=1.47, alpha_rad=0.06,
    )  # fmt: skip
    flown = flights.fly(one, "3211", duration_s, 0.04, gust_m_s, rng)
    ahead = round(DELAY_S / flights.FINE_S)
    surface = flown.channels["elevator_rad"]
    measured = np.concatenate([surface[ahead:], np.full(ahead, surface[-1])])
    flown = replace(flown, channels={**flown.channels, "elevator_rad": measured})
    return flights.read(flown, {"vane_lag": LAG_S}, rate_hz, 1.0, rng)


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", sampled([10.0, 25.0], 2))
def test_the_lag_is_named_with_an_interval(rate_hz):
    for seed in range(3):
        result = check_kinematics(flights.as_log([transport(seed, rate_hz)], rate_hz), None, 7.0)
        assert result.verdict in ("errors", "one_of"), result.sentences
        lag = result.finding("vane_lag")
        assert lag.state in ("present", "one of")
        assert lag.lower < LAG_S < lag.upper
        assert "agree (" not in " ".join(result.sentences)


def test_two_records_show_a_smaller_lag_than_one():
    parts = [transport(seed, 10.0) for seed in range(2)]
    alone, both = (
        check_kinematics(flights.as_log(parts[:n], 10.0), None, 7.0).finding("vane_lag") for n in (1, 2)
    )
    assert both.smallest < 0.8 * alone.smallest
    assert both.lower < LAG_S < both.upper
