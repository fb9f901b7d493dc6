"""Records in which the rest of the motion is larger than the elevator's, and vanes that see more than severe turbulence."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.checks.motions import check_motions
from airtruth.checks.poor import FLOOR, measured, words
from airtruth.identification import identify
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.gust_figures import gust_scales
from airtruth.units import DEG, FT
from validation.linear_flight import GTM, doublet, fly


def flight(**choices):
    return fly(rate_hz=50, duration_s=12.0, noise=1.0, shape=doublet, amplitude_rad=2.0 * DEG, **choices)


def log_of(batch):
    rows = batch.t_s.shape[1]
    return FlightLog(
        {}, batch.run_ids, np.arange(len(batch.run_ids) + 1) * rows, batch.t_s.ravel(),
        {name: values.ravel() for name, values in batch.channels.items()},
    )  # fmt: skip


@pytest.mark.parametrize("gust", [2.0, 4.0, 8.0])
def test_the_share_of_the_elevator_is_that_of_a_record_without_its_gusts(gust):
    """The variance of q of the same seeds without gusts over that with them: 0.76, 0.47, 0.20."""
    calm, rough = flight(runs=8, gust=0.0, seed=3), flight(runs=8, gust=gust, seed=3)
    assert all(one.share > 0.9 for one in measured(calm))
    own, total = (b.channels["q_rad_s"].var(axis=1).mean() for b in (calm, rough))
    assert np.mean([one.share for one in measured(rough)]) == pytest.approx(own / total, abs=0.1)


def test_gusts_that_drown_a_manoeuvre_are_stated_first_and_with_figures():
    rough = flight(runs=4, gust=12.0, seed=3)
    records = measured(rough)
    assert all(one.share < FLOOR for one in records)
    (sentence,) = words(records)
    assert sentence.startswith(
        "Warning: the elevator moves the aircraft less than the rest does in 4 of 4 runs: gusts"
    )
    log = log_of(rough)
    assert identify(log, GTM, ["ls"]).notes[0] == sentence
    assert check_motions([("", log)])["longitudinal"].sentences[0] == sentence
    calm = log_of(flight(runs=4, gust=0.0, seed=3))
    assert not any("moves the aircraft less" in note for note in identify(calm, GTM, ["ls"]).notes)


def test_the_gusts_of_a_record_are_measured():
    """Vertical gusts of a known size, sampled by their own angle of attack; the vane's noise is 0.023 m/s."""
    one = flight(runs=8, gust=0.0, seed=5)
    t = one.t_s[0]
    for size in (0.5, 2.0):
        gust = size * np.sqrt(2.0) * np.sin(2.0 * np.pi * 0.8 * t) / one.channels["airspeed_m_s"]
        channels = {**one.channels, "alpha_rad": one.channels["alpha_rad"] + gust}
        found = [record.gust_m_s for record in measured(replace(one, channels=channels))]
        np.testing.assert_allclose(found, size, rtol=0.1)


def test_a_vane_that_sees_more_than_severe_turbulence_is_doubted():
    """Severe turbulence at 7000 ft is 7.17 m/s (MIL-F-8785C, figure 7, 23.5 ft/s); the vane departs by 8 and by 6 m/s."""
    one = flight(runs=1, gust=0.0, seed=5)
    altitude = np.full_like(one.t_s, 7000.0 * FT)
    severe = gust_scales("mil-f-8785c", "severe", 7000.0 * FT).sigma_w_m_s
    assert severe == pytest.approx(23.5 * FT, rel=0.02)
    wave = np.sqrt(2.0) * np.sin(2.0 * np.pi * 0.8 * one.t_s)
    for size, doubted in ((8.0, True), (6.0, False)):
        alpha = one.channels["alpha_rad"] + size * wave / one.channels["airspeed_m_s"]
        channels = {**one.channels, "alpha_rad": alpha, "altitude_m": altitude}
        sentences = list(words(measured(replace(one, channels=channels))))
        assert any("more than severe turbulence explains" in text for text in sentences) == doubted


def test_a_reconstructed_alpha_shows_no_gusts():
    one = flight(runs=1, gust=0.0, seed=5)
    from airtruth.physics.reconstruction import COLUMNS

    channels = {**one.channels, **{name: np.zeros_like(one.t_s) for name in COLUMNS}}
    channels["alpha_rad"] = channels["alpha_rad"] + 0.5 * np.sin(one.t_s)
    assert [record.gust_m_s for record in measured(replace(one, channels=channels))] == [0.0]
