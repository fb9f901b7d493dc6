"""Tests without a name: statistics against scipy and by hand, spread under the null, and what each of them sees."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trace_records as tr
from added_signals import Added, flown_with
from scipy.signal import lfilter
from scipy.stats import chi2

from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import AeroTerm, Change
from airtruth.tracing.anomalies.families import advice, families
from airtruth.tracing.anomalies.omnibus import anomalies, chi_square, views
from airtruth.tracing.anomalies.spectrum import lines
from airtruth.tracing.inference.hypothesis_test import HypothesisTest
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.whitening import NO_WHITENER
from airtruth.tracing.model.records import nodes
from airtruth.tracing.model.response import filter_inputs, respond
from airtruth.tracing.model.surface import play
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.units import DEG

pytestmark = pytest.mark.slow

FAMILIES = families(LONGITUDINAL)
ELEVATOR, STATIC, SURFACE, HISTORY, DRIFT, VANE = FAMILIES
CHANNELS = LONGITUDINAL.output_channels
DRAWS = 20


def test_chi_square_is_the_quadratic_form():
    rng = np.random.default_rng(1)
    root = rng.standard_normal((4, 4))
    information, gradient = root @ root.T + np.eye(4), rng.standard_normal(4)
    statistic, degrees, p = chi_square(gradient, information)
    assert statistic == pytest.approx(gradient @ np.linalg.solve(information, gradient), rel=1e-12)
    assert degrees == 4
    assert p == pytest.approx(chi2.sf(statistic, 4), rel=1e-12)


def test_a_direction_that_stands_twice_counts_once():
    """g = [1, 1], I = ones: one direction of information 1 with a score of 1."""
    statistic, degrees, p = chi_square(np.ones(2), np.ones((2, 2)))
    assert (statistic, degrees) == (pytest.approx(1.0), 1)
    assert p == pytest.approx(chi2.sf(1.0, 1))


def test_directions_that_records_do_not_excite_say_nothing():
    assert chi_square(np.zeros(3), np.zeros((3, 3))) == (0.0, 0, 1.0)
    assert lines([np.zeros((100, 3))], [0.02], CHANNELS).p_value == 1.0


def test_directions_of_any_unit_count_alike():
    rng = np.random.default_rng(2)
    root = rng.standard_normal((3, 3))
    information, gradient = root @ root.T, rng.standard_normal(3)
    unit = np.array([1e-4, 1.0, 1e3])
    plain = chi_square(gradient, information)
    assert chi_square(gradient * unit, information * np.outer(unit, unit)) == pytest.approx(plain, rel=1e-8)


def test_one_row_without_information_changes_nothing():
    """Whatever its gradient is: nothing was measured in that direction."""
    rng = np.random.default_rng(12)
    root = rng.standard_normal((4, 4))
    information, gradient = np.zeros((5, 5)), np.append(rng.standard_normal(4), 0.7)
    information[:4, :4] = root @ root.T + np.eye(4)
    assert chi_square(gradient, information) == pytest.approx(chi_square(gradient[:4], information[:4, :4]))


@pytest.mark.parametrize("pole", [0.0, 0.6])
def test_lines_of_innovations_without_a_line(pole):
    """The smallest p of 48 bands and three channels, times their number, is below 5 % in about 5 % (Bonferroni).

    500 draws of white and of first-order innovations: four binomial standard errors.
    """
    rng = np.random.default_rng(3)
    found = []
    for _ in range(500):
        records = [lfilter([1.0], [1.0, -pole], rng.standard_normal((n, 3)), axis=0) for n in (250, 300)]
        found.append(lines(records, [0.02, 0.02], CHANNELS).p_value)
    share = np.mean(np.array(found) <= 0.05)
    assert share == pytest.approx(0.05, abs=4.0 * np.sqrt(0.05 * 0.95 / 500))


def test_a_ringing_channel_is_found_where_it_rings():
    """2 I/s^2 of x_k - a x_(k-1), a the first autocorrelation, summed over the band by the definition of I."""
    rng = np.random.default_rng(4)
    r = rng.standard_normal((500, 3))
    r[:, 1] += 0.8 * np.sin(2.0 * np.pi * 6.8 * 0.02 * np.arange(500))
    found = lines([r], [0.02], CHANNELS)
    assert found.null == "q_rad_s at 6.5 to 7.0 Hz"
    assert found.p_value < 1e-12
    # 500 samples of 20 ms: a line every 0.1 Hz, five to a band
    assert found.degrees == 10
    x = r[:, 1]
    a = (x[1:] @ x[:-1]) / (x[:-1] @ x[:-1])
    x = np.concatenate([[x[0] * np.sqrt(1.0 - a**2)], x[1:] - a * x[:-1]])
    turns = np.outer([6.6, 6.7, 6.8, 6.9, 7.0], 0.02 * np.arange(500))
    power = np.abs(np.exp(-2j * np.pi * turns) @ x) ** 2 / 500
    assert found.statistic == pytest.approx(2.0 * power.sum() / np.mean(x**2), rel=1e-9)


@pytest.mark.parametrize("size", [1.0, 4.0, 100.0])
def test_a_strong_mode_is_not_taken_for_colour(size):
    """A mode of 7 Hz, 2 % damped, as strong as the noise, four and a hundred times: an autoregression of order 4 takes it up."""
    rng = np.random.default_rng(13)
    pole = np.exp((-0.02 + 1j) * 2.0 * np.pi * 7.0 * 0.02)
    records = []
    for _ in range(4):
        r = rng.standard_normal((300, 3))
        ringing = lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], rng.standard_normal(300))
        r[:, 1] += size * ringing / ringing.std()
        records.append(r)
    found = lines(records, [0.02] * 4, CHANNELS)
    assert found.null == "q_rad_s at 6.5 to 7.0 Hz"
    assert found.p_value < 1e-9


def test_records_of_several_rates_share_their_bands():
    rng = np.random.default_rng(5)
    found = lines([rng.standard_normal((100, 3)), rng.standard_normal((40, 3))], [0.02, 0.05], CHANNELS)
    assert float(found.null.split(" to ")[1].split()[0]) <= 10.0
    assert lines([rng.standard_normal((20, 3))], [0.5], CHANNELS).p_value == 1.0


def seen(records):
    problem = tr.problem(records)
    null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    return {a.null if a.null in FAMILIES else "lines": a for a in anomalies(null, problem, NO_WHITENER)}


def pair(rng, samples=200, sigma_w=0.3):
    return [
        tr.fly(rng, amplitude=a * DEG, name=str(a), samples=samples, sigma_w=sigma_w)
        for a in (2.0, -2.0, 1.0)
    ]


def changed(made, more):
    return replace(made, signals=replace(made.signals, y=made.signals.y + more))


def difference(made, change=None, added=None):
    """What a change, or a moment, does to the outputs of a free run of the linear aircraft."""
    common, per_record = tr.still()
    before = respond(made, tr.SETTINGS, Change(), common, per_record, free_run=True).e
    if added is None:
        return before - respond(made, tr.SETTINGS, change, common, per_record, free_run=True).e
    given = filter_inputs(made, Change())
    return before - flown_with(added, given, tr.SETTINGS, common, per_record, free_run=True)


def test_p_values_are_uniform_where_nothing_is_missing():
    """Mean 1/2 within four of 1/sqrt(12 draws), each family; noise and gusts are drawn."""
    rng = np.random.default_rng(6)
    found = [seen(pair(rng, 150)[:2]) for _ in range(DRAWS)]
    assert set(found[0]) == {*FAMILIES, "lines"}
    for name in FAMILIES:
        p = [f[name].p_value for f in found]
        assert np.mean(p) == pytest.approx(0.5, abs=4.0 / np.sqrt(12.0 * DRAWS)), name
    assert min(f["lines"].p_value for f in found) > 0.05 / DRAWS / 4.0


def test_a_slope_that_changes_is_seen_over_the_angle_of_attack():
    change = Change(aero=(AeroTerm("Cm", "alpha", "above", -1.2, 1.0 * DEG),))
    found = seen([changed(r, difference(r, change)) for r in pair(np.random.default_rng(7))])
    assert found[STATIC].p_value < 1e-6
    assert found[VANE].p_value > 1e-3


def test_an_elevator_that_loses_effect_is_seen_over_the_deflection():
    """Cm += 15 de |de|: at 2 deg 29 % of a Cmde of -1.79 are lost."""
    records = []
    for made in pair(np.random.default_rng(10)):
        de = nodes(made.signals.elevator_rad)
        moment = Added(np.array([np.zeros(de.size), 15.0 * de * np.abs(de)]), np.zeros_like(made.signals.y))
        records.append(changed(made, difference(made, added=moment)))
    found = seen(records)
    assert found[SURFACE].p_value < 1e-6
    assert found[SURFACE].p_value < min(found[STATIC].p_value, found[ELEVATOR].p_value)


def test_hysteresis_is_seen_in_the_history():
    records = []
    for made in pair(np.random.default_rng(8)):
        smooth = np.convolve(made.signals.y[:, 0], np.ones(7) / 7.0, mode="same")
        lag = np.interp(
            np.arange((len(smooth) - 1) * 2 + 1) / 2.0,
            np.arange(len(smooth)),
            smooth - play(smooth, 0.5 * DEG),
        )
        moment = Added(np.array([np.zeros(lag.size), -0.8 * lag]), np.zeros_like(made.signals.y))
        records.append(changed(made, difference(made, added=moment)))
    found = seen(records)
    assert found[HISTORY].p_value < 1e-6
    assert found[HISTORY].p_value < found[STATIC].p_value


def test_a_vane_that_sticks_is_seen_as_friction():
    """Still air, so that the vane is moved by the manoeuvre alone."""
    records = []
    for made in pair(np.random.default_rng(9), sigma_w=1e-3):
        smooth = np.convolve(made.signals.y[:, 0], np.ones(5) / 5.0, mode="same")
        more = np.zeros_like(made.signals.y)
        more[:, 0] = play(smooth, 0.15 * DEG) - smooth
        records.append(changed(made, more))
    found = seen(records)
    assert found[VANE].p_value < 1e-6


def test_a_vane_that_sticks_is_seen_in_gusts():
    """A play of 0.3 deg in gusts that move the vane by 1.4 deg: the filter's prediction follows the vane."""
    rng = np.random.default_rng(13)
    records = []
    for made in [
        tr.fly(rng, amplitude=a * DEG, name=str(a), samples=300, sigma_w=1.0, noise=1e-6 * tr.SETTINGS.noise)
        for a in (2.0, -2.0, 1.0)
    ]:
        more = tr.SETTINGS.noise * rng.standard_normal(made.signals.y.shape)
        alpha = made.signals.y[:, 0]
        more[:, 0] += play(alpha, 0.15 * DEG) - alpha
        records.append(changed(made, more))
    assert seen(records)[VANE].p_value < 1e-4


def test_the_motion_without_the_vane_does_not_contain_it():
    """A reading of the vane that is 1 mrad larger changes no sample of the motion that the others show."""
    (made,) = pair(np.random.default_rng(14))[:1]
    problem = tr.problem([made])
    null = fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING))
    more = np.zeros_like(made.signals.y)
    more[100, 0] = 1e-3
    (before,), (after,) = views(null, problem), views(null, tr.problem([changed(made, more)]))
    assert np.ptp(before.without_vane_rad) > 0.02
    np.testing.assert_allclose(after.without_vane_rad, before.without_vane_rad, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("drifts", ["moment", "gyro"])
def test_a_drift_is_seen_in_time(drifts):
    """A CG that moves by 1 % of the chord in 4 s at a CL of 0.6, Cm of 0.006; a gyro by 0.5 deg/s."""
    records = []
    for made in pair(np.random.default_rng(11)):
        time = np.linspace(0.0, 1.0, nodes(made.signals.elevator_rad).size)
        moment = Added(np.array([np.zeros(time.size), 0.006 * time]), np.zeros_like(made.signals.y))
        more = np.zeros_like(made.signals.y)
        more[:, 1] = 0.5 * DEG * np.linspace(0.0, 1.0, len(more))
        records.append(changed(made, difference(made, added=moment) if drifts == "moment" else more))
    found = seen(records)
    assert found[DRIFT].p_value < 1e-6
    assert found[DRIFT].p_value < min(found[name].p_value for name in (STATIC, SURFACE, VANE))


def test_advice_for_each_place():
    said = [advice(where, LONGITUDINAL) for where in (*FAMILIES, "az_m_s2 at 2.0 to 2.5 Hz", "vane_lag")]
    assert len(set(said)) == len(said)
    assert all(s.endswith(".") for s in said)


# -- the tests together


def stage(unnamed, adjusted=(), z=()):
    scores = tuple(SimpleNamespace(effect=SimpleNamespace(key=f"effect {i}"), z=v) for i, v in enumerate(z))
    table = SimpleNamespace(scores=scores)
    return SearchRound(None, None, None, table, tuple(unnamed), np.array(adjusted), (), (), None)


def test_the_smallest_p_value_counts_times_the_number_of_tests():
    unnamed = [HypothesisTest("one", 9.0, 2, 0.011), HypothesisTest("two", 1.0, 3, 0.8)]
    found = stage(unnamed, [0.3, 0.004], [1.1, -3.9]).anomaly
    assert (found.null, found.statistic, found.p_value) == ("effect 1", pytest.approx(3.9**2), 0.012)
    found = stage(unnamed, [0.3, 0.04], [1.1, -3.9]).anomaly
    assert (found.null, found.statistic, found.p_value) == ("one", 9.0, pytest.approx(0.033))
    assert stage(unnamed).anomaly.p_value == pytest.approx(0.022)


def test_among_p_values_that_are_all_zero_the_strongest_counts():
    unnamed = [HypothesisTest("one", 2000.0, 12, 0.0), HypothesisTest("two", 5000.0, 28, 0.0)]
    assert stage(unnamed, [0.0, 0.0], [40.0, -60.0]).anomaly.null == "two"
    assert stage(unnamed, [0.0, 0.0], [40.0, -90.0]).anomaly.null == "effect 1"
