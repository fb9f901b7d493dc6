"""A mapping that contradicts gravity or kinematics is refused, with the entry that corrects it; no aircraft is known."""

from dataclasses import replace

import numpy as np
import pytest
from import_flight import flown, foreign, mapping_by_name, write_csv
from tiers import sampled

from airtruth.checks.gate import inspect
from airtruth.errors import LogError
from airtruth.importers import import_log
from airtruth.logs.flight_log import FlightLog

DEG = np.pi / 180.0


@pytest.fixture(scope="module")
def gusty(tmp_path_factory):
    """Eight runs in the GTM's light gusts."""
    return flown(tmp_path_factory.mktemp("gusty"), runs=8, gust=1.0)


def single(log, run, **factors):
    channels = {n: v[log.rows(run)] * factors.get(n, 1.0) for n, v in log.channels.items()}
    t = log.t_s[log.rows(run)]
    return FlightLog(log.metadata, (log.run_ids[run],), np.array([0, len(t)]), t, channels)


@pytest.mark.slow
def test_a_right_mapping_is_left_alone(gusty):
    assert not [f for f in inspect(gusty) if f.certain]
    for run in range(8):
        assert not [f for f in inspect(single(gusty, run)) if f.certain]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("factors", "channel", "parts"),
    sampled(
        [
            ({"elevator_rad": -1.0}, "elevator_rad", ["opposite sign", "sign = -1"]),
            ({"q_rad_s": -1.0}, "q_rad_s", ["opposite sign", "sign = -1"]),
            ({"theta_rad": -1.0}, "theta_rad", ["opposite sign", "sign = -1"]),
            ({"alpha_rad": -1.0}, "alpha_rad", ["opposite sign", "sign = -1"]),
            ({"az_m_s2": -1.0}, "az_m_s2", ["opposite sign", "sign = -1"]),
            ({"az_m_s2": 1.0 / 9.80665}, "az_m_s2", ["g taken as m/s2", 'unit = "g"']),
            ({"az_m_s2": -1.0 / 9.80665}, "az_m_s2", ["and opposite sign", 'unit = "g" and sign = -1']),
            ({"az_m_s2": 1.0 / 0.3048}, "az_m_s2", ["ft/s2", 'unit = "ft_s2"']),
            ({"az_m_s2": 9.80665}, "az_m_s2", ["m/s2 taken as g", 'unit = "m_s2"']),
            ({"alpha_rad": 1.0 / DEG}, "alpha_rad", ["degrees taken as radians", 'unit = "deg"']),
            ({"alpha_rad": DEG}, "alpha_rad", ["radians taken as degrees", 'unit = "rad"']),
            ({"q_rad_s": 1.0 / DEG}, "q_rad_s", ["degrees taken as radians", 'unit = "deg_s"']),
            ({"q_rad_s": DEG}, "q_rad_s", ["radians taken as degrees", 'unit = "rad_s"']),
            ({"theta_rad": 1.0 / DEG}, "theta_rad", ["degrees taken as radians", 'unit = "deg"']),
            ({"theta_rad": DEG}, "theta_rad", ["radians taken as degrees", 'unit = "rad"']),
            ({"elevator_rad": 1.0 / DEG}, "elevator_rad", ["degrees taken as radians", 'unit = "deg"']),
            ({"altitude_m": 1.0 / 0.3048}, "altitude_m", ["feet taken as metres", 'unit = "ft"']),
            ({"density_kg_m3": 0.00194032}, "density_kg_m3", ["slug/ft3", 'unit = "slug_ft3"']),
            ({"airspeed_m_s": 1.0 / 0.3048}, "airspeed_m_s", ["ft/s or km/h taken as m/s", '"ft_s"']),
            ({"airspeed_m_s": 3.6}, "airspeed_m_s", ["ft/s or km/h taken as m/s", '"km_h"']),
            ({"airspeed_m_s": 3600.0 / 1852.0}, "airspeed_m_s", ["knots taken as m/s", 'unit = "kt"']),
        ],
        3,
    ),
)
def test_wrong_units_and_signs_are_certain_and_named(factors, channel, parts, gusty):
    log = replace(gusty, channels={n: v * factors.get(n, 1.0) for n, v in gusty.channels.items()})
    found = inspect(log)
    certain = [p for p in found if p.certain]
    assert [p.channel for p in certain] == [channel]
    for part in parts:
        assert part in certain[0].sentence
    assert channel in certain[0].sentence


@pytest.mark.slow
@pytest.mark.parametrize("name", ["q_rad_s", "alpha_rad", "az_m_s2"])
def test_signs_are_found_without_theta(name, gusty):
    channels = {n: -v if n == name else v for n, v in gusty.channels.items() if n != "theta_rad"}
    certain = [p for p in inspect(replace(gusty, channels=channels)) if p.certain]
    assert [p.channel for p in certain] == [name]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pair", "part"),
    [
        (("ax_m_s2", "az_m_s2"), "exchange the columns of ax_m_s2 and az_m_s2"),
        (("alpha_rad", "theta_rad"), "exchange the columns of alpha_rad and theta_rad"),
    ],
)
def test_swapped_axes(pair, part, gusty):
    channels = dict(gusty.channels)
    channels[pair[0]], channels[pair[1]] = channels[pair[1]], channels[pair[0]]
    certain = [p for p in inspect(replace(gusty, channels=channels)) if p.certain]
    assert len(certain) == 1
    assert part in certain[0].sentence


def _of_another_axis(log, name):
    rng = np.random.default_rng(1)
    roll = 0.05 * np.cumsum(rng.normal(size=len(log.t_s))) / 7.0
    return replace(log, channels={**log.channels, name: roll})


@pytest.mark.slow
def test_another_axis_in_place_of_the_pitch_rate_is_refused(gusty):
    certain = [f for f in inspect(_of_another_axis(gusty, "q_rad_s")) if f.certain]
    assert [f.channel for f in certain] == ["q_rad_s"]


@pytest.mark.slow
def test_another_axis_in_place_of_alpha_is_named_beside_the_elevator_whose_sign_it_turns(gusty):
    """The elevator's effect is small beside that of alpha, which the test of its sign takes as right."""
    found = {f.channel: f for f in inspect(_of_another_axis(gusty, "alpha_rad"))}
    assert found["elevator_rad"].certain
    assert "map another column to alpha_rad" in found["elevator_rad"].sentence
    assert "inconsistent" in found["alpha_rad"].sentence


@pytest.mark.slow
def test_a_wrong_sign_of_the_elevator_blames_no_other_column(gusty):
    found = inspect(
        replace(gusty, channels={**gusty.channels, "elevator_rad": -gusty.channels["elevator_rad"]})
    )
    assert [f.channel for f in found if f.certain] == ["elevator_rad"]
    assert "another column" not in found[0].sentence


@pytest.mark.slow
def test_gravity_taken_out(gusty):
    log = replace(gusty, channels={**gusty.channels, "az_m_s2": gusty.channels["az_m_s2"] + 9.80665})
    assert "no gravity" in inspect(log)[0].sentence


@pytest.mark.slow
def test_strong_gusts_on_a_weak_manoeuvre_are_no_certain_mistake(tmp_path):
    log = flown(tmp_path, runs=20, gust=4.3, duration_s=5.0)
    for run in range(20):
        assert not [p for p in inspect(single(log, run)) if p.certain]


def test_records_in_which_nothing_moves_are_not_judged_by_motion(gusty):
    still = {n: np.full_like(v, v[0]) for n, v in gusty.channels.items()}
    assert inspect(replace(gusty, channels=still)) == ()


@pytest.mark.slow
def test_import_refuses_a_flipped_sign_and_force_keeps_it(gusty, tmp_path):
    write_csv(tmp_path / "f.csv", foreign(gusty))
    text = mapping_by_name()
    at = text.index("[channels.elevator_rad]")
    (tmp_path / "m.toml").write_text(text[:at] + text[at:].replace("sign = -1\n", "", 1))
    with pytest.raises(
        LogError, match=r"contradicts physics(.|\n)*sign = -1 under .channels.elevator_rad"
    ) as caught:
        import_log(tmp_path / "f.csv", tmp_path / "m.toml")
    assert "--force" in str(caught.value)
    kept = import_log(tmp_path / "f.csv", tmp_path / "m.toml", force=True)
    assert [f.channel for f in kept.faults] == ["elevator_rad"]


@pytest.mark.slow
@pytest.mark.parametrize("lag_s", sampled([0.3, 0.4, 0.5, 0.8], 4))
def test_a_slow_vane_is_a_late_alpha_and_no_wrong_airspeed(lag_s, tmp_path):
    """A first-order lag, whose weak response once passed for an airspeed in another unit."""
    log = flown(tmp_path, runs=2, gust=0.1, duration_s=10.0)
    share = 1.0 - np.exp(-0.02 / lag_s)
    late = log.channels["alpha_rad"].copy()
    for run in range(2):
        rows = log.rows(run)
        for i in range(rows.start + 1, rows.stop):
            late[i] = late[i - 1] + share * (log.channels["alpha_rad"][i] - late[i - 1])
    channels = {n: v for n, v in log.channels.items() if n != "theta_rad"} | {"alpha_rad": late}
    faults = inspect(replace(log, channels=channels))
    assert [(f.channel, f.code, f.certain) for f in faults] == [("alpha_rad", "lag", False)]
    assert "s late" in faults[0].sentence


@pytest.mark.slow
def test_an_axial_load_factor_in_g_is_refused_and_both_readings_are_named(gusty):
    """Without gravity or in g: a trimmed record cannot tell, so that neither is stated alone."""
    log = replace(gusty, channels={**gusty.channels, "ax_m_s2": gusty.channels["ax_m_s2"] / 9.80665})
    (fault,) = inspect(log)
    assert (fault.channel, fault.certain) == ("ax_m_s2", True)
    assert "g taken as m/s2" in fault.sentence
    assert 'unit = "g"' in fault.sentence
