"""Logs that must be refused and runs that must be left out, each with one message that says what, where and what to do."""

import re
from dataclasses import replace

import numpy as np
import pytest

from airtruth.errors import ConfigurationError, LogError
from airtruth.identification import METHODS, Options, identify
from airtruth.units import G0
from validation.linear_flight import DEG, GTM, as_log, doublet, fly, with_channel

GOOD = fly(runs=3, gust=1.0, noise=1.0, seed=61)
# so small that no value in degrees is out of range for radians
SMALL = fly(runs=3, noise=0.02, seed=62, amplitude_rad=0.1 * DEG, alpha_trim_rad=0.2 * DEG)


def changed(name, change, batch=GOOD, run=1):
    values = batch.channels[name].copy()
    values[run] = change(values[run])
    return as_log(with_channel(batch, name, values))


def without(*names):
    return as_log(replace(GOOD, channels={k: v for k, v in GOOD.channels.items() if k not in names}))


def times(change):
    log = as_log(GOOD)
    t = log.t_s.copy()
    t[250:500] = change(t[250:500])
    return replace(log, t_s=t)


def hole(x):
    x = x.copy()
    x[100] = np.nan
    return x


def swapped(t):
    t = t.copy()
    t[[70, 71]] = t[[71, 70]]
    return t


CASES = {
    "nan": (lambda: changed("q_rad_s", hole), "q_rad_s: one value is NaN.*b0-run-0001.*row 100"),
    "gap": (lambda: times(lambda t: t + 0.3 * (t > 2.0)), r"t_s: 1 gap.*0\.3.*b0-run-0001"),
    "uneven": (
        lambda: times(lambda t: t + 0.004 * np.sin(37.0 * t)),
        "t_s: steps differ .*b0-run-0001",
    ),
    "decreasing": (lambda: times(swapped), "t_s: does not increase.*b0-run-0001"),
    "missing": (lambda: without("az_m_s2"), "az_m_s2: required channel is missing"),
    "no air": (lambda: without("density_kg_m3"), "density_kg_m3 or altitude_m"),
    "constant alpha": (
        lambda: changed("alpha_rad", lambda x: 0.0 * x),
        r"alpha_rad: constant in 1 of 3 runs \('b0-run-0001'\)",
    ),
    "constant elevator": (
        lambda: changed("elevator_rad", lambda x: 0.0 * x),
        "elevator_rad.* constant in",
    ),
    "degrees by range": (
        lambda: changed("alpha_rad", lambda x: x / DEG),
        "alpha_rad: degrees taken as radians in 1 of 3 runs",
    ),
    "degrees of alpha by kinematics": (
        lambda: changed("alpha_rad", lambda x: x / DEG, SMALL),
        "alpha_rad: degrees taken as radians in 1 of 3 runs",
    ),
    "degrees of q by kinematics": (
        lambda: changed("q_rad_s", lambda x: x / DEG, SMALL),
        "q_rad_s: degrees taken as radians in 1 of 3 runs",
    ),
    "degrees of the elevator": (
        lambda: changed("elevator_rad", lambda x: x / DEG, fly(runs=3, noise=1.0, amplitude_rad=1.2 * DEG)),
        r"elevator_rad: degrees taken as radians in 1 of 3 runs",
    ),
    "az in g": (
        lambda: changed("az_m_s2", lambda x: x / G0),
        "az_m_s2: g taken as m/s2 .*az_m_s2 averages -1",
    ),
    "az without gravity": (
        lambda: changed("az_m_s2", lambda x: x + G0),
        "az_m_s2: no gravity in 1 of 3 runs",
    ),
    "no excitation": (
        lambda: changed("elevator_rad", lambda x: 1e-4 * np.random.default_rng(0).normal(size=x.size)),
        "elevator_rad: no excitation in 1 run .'b0-run-0001'.*needs a manoeuvre",
    ),
    "too short": (
        lambda: as_log(replace(fly(duration_s=1.0), run_ids=("a",))),
        "too short to identify: 1 run .*50 samples.*at least 60",
    ),
    "far too short": (lambda: as_log(fly(duration_s=0.2)), "too few samples"),
    "duplicate": (
        lambda: replace(as_log(GOOD), run_ids=("a", "b", "a")),
        "run_id: .*'a'.* in more than one part",
    ),
}


ONE_OF_THREE = (
    "no excitation", "constant alpha", "constant elevator", "degrees by range",
    "degrees of alpha by kinematics", "degrees of q by kinematics",
    "degrees of the elevator", "az in g", "az without gravity",
)  # fmt: skip
"""Cases that concern one run of three."""


@pytest.mark.grid
@pytest.mark.parametrize("case", [case for case in CASES if case not in ONE_OF_THREE])
def test_a_bad_log_is_refused_by_name(case):
    make, message = CASES[case]
    with pytest.raises(LogError, match=f"(?s){message}"):
        identify(make(), GTM, ("ls", "iv-f1"))


@pytest.mark.grid
@pytest.mark.parametrize("case", ONE_OF_THREE)
def test_one_bad_run_of_three_is_named_and_the_others_are_answered(case):
    make, message = CASES[case]
    log = make()
    result = identify(log, GTM, ("ls", "iv-f1"))
    others = [log.run_ids[0], log.run_ids[2]]
    assert list(result.run_ids) == others
    (note,) = [note for note in result.notes if "left out" in note]
    assert re.search(f"left out 1 of 3 runs .'{log.run_ids[1]}'., the other 2 are used: {message}", note)
    alone = identify(log.select(others), GTM, ("ls", "iv-f1"))
    np.testing.assert_array_equal(result.of("ls").theta, alone.of("ls").theta)
    with pytest.raises(LogError, match=re.split("[:.]", message)[0]):
        identify(log.select([log.run_ids[1]]), GTM, ("ls", "iv-f1"))


def test_the_good_logs_are_accepted():
    for batch in (GOOD, SMALL):
        assert identify(as_log(batch), GTM, ("ls", "iv-f1")).to_frame()["converged"].all()


@pytest.mark.parametrize("name", [m for m in METHODS if METHODS[m].channels])
def test_a_method_that_lacks_its_channel_says_so(name):
    message = f"method {name} needs the channel elevator_command_rad.*ls, iv-lowpass, iv-kalman, iv-f1, iv-f2"
    with pytest.raises(LogError, match=message):
        identify(without("elevator_command_rad"), GTM, (name,))
    assert len(identify(without("elevator_command_rad"), GTM, ("iv-f1",)).run_ids) == 3


def test_the_low_pass_must_fit_the_sample_rate():
    with pytest.raises(ConfigurationError, match=r"cutoff_hz = 5: the log has 10 Hz.*below 5 Hz"):
        identify(as_log(fly(rate_hz=10, duration_s=20.0)), GTM, ("ls",), Options(cutoff_hz=5.0))
    result = identify(as_log(fly(rate_hz=10, duration_s=20.0)), GTM, ("iv-lowpass",), Options(cutoff_hz=3.0))
    assert result.of("iv-lowpass").converged.all()


@pytest.mark.parametrize("rate_hz", [5, 10])
def test_a_slow_record_has_an_automatic_cutoff(rate_hz):
    """The short period of the GTM (1 Hz) lies below a quarter of these rates; the pitch stiffness survives."""
    log = as_log(fly(rate_hz=rate_hz, duration_s=14.0))
    result = identify(log, GTM, ("ls", "iv-f1", "filter-error", "frequency"))
    frame = result.to_frame()
    assert frame["converged"].all()
    likely = frame[frame.method == "filter-error"]["Cmalpha"]
    assert ((likely > -2.6) & (likely < -1.0)).all()
    assert (frame["Cmalpha"] < -0.5).all()
    fast = identify(as_log(GOOD), GTM, ("ls",))
    same = identify(as_log(GOOD), GTM, ("ls",), Options(cutoff_hz=5.0))
    np.testing.assert_array_equal(fast.of("ls").theta, same.of("ls").theta)


def test_the_trim_window_must_lie_before_the_manoeuvre():
    with pytest.raises(LogError, match=r"already moves within the trim window of 1.5 s in 3 runs"):
        identify(as_log(GOOD), GTM, ("ls",), Options(trim="mean", trim_window_s=1.5))
    with pytest.raises(ConfigurationError, match=r"trim_window_s = 9: the runs last 5 s"):
        identify(as_log(GOOD), GTM, ("ls",), Options(trim="mean", trim_window_s=9.0))


def test_an_unknown_method_is_named_before_the_log_is_read():
    with pytest.raises(ConfigurationError, match="'lsq' does not exist"):
        identify(without("alpha_rad"), GTM, ("lsq",))


def test_heavy_turbulence_is_no_wrong_unit():
    """8 times the light gusts, 60 runs: the kinematic check of units must not cry wolf."""
    rough = fly(runs=60, gust=8.0, noise=1.0, seed=63, duration_s=8.0, shape=lambda t: doublet(t, 2.0))
    identify(as_log(rough), GTM, ("ls",))
