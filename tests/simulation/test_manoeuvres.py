"""Manoeuvres: shapes, grid, orthogonality."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airtruth.errors import ConfigurationError
from airtruth.simulation.manoeuvres import KINDS, Manoeuvre, end_s, sample

T = np.arange(2001) / 200.0


def test_doublet_levels_and_half_values_at_edges():
    u = sample(Manoeuvre("doublet", 2.0, start_s=1.0, step_s=0.5), T)
    np.testing.assert_array_equal(
        u[[199, 200, 201, 299, 300, 301, 399, 400, 401]], [0, 1, 2, 2, 0, -2, -2, -1, 0]
    )


def test_3211_signs_and_lengths():
    u = sample(Manoeuvre("3211", 1.0, start_s=0.5, step_s=0.3), T)
    middles = 0.5 + 0.3 * np.array([1.5, 4.0, 5.5, 6.5, 7.5])
    np.testing.assert_array_equal(np.interp(middles, T, u), [1, -1, 1, -1, 0])


@pytest.mark.parametrize(("kind", "level"), [("pulse", 0.0), ("step", 3.0)])
def test_pulse_returns_and_step_stays(kind, level):
    u = sample(Manoeuvre(kind, 3.0, start_s=1.0, step_s=0.5), T)
    assert u[250] == 3.0
    assert u[-1] == level


@given(start=st.integers(1, 400), step=st.integers(1, 60), kind=st.sampled_from(["doublet", "3211", "pulse"]))
def test_linear_interpolation_keeps_the_impulse_and_its_centre(start, step, kind):
    """The half value at an edge makes the ramp carry the impulse and the first moment of the ideal edge."""
    m = Manoeuvre(kind, 1.0, start_s=start / 200.0, step_s=step / 200.0)
    u = sample(m, T)
    units = {"doublet": (1, -1), "3211": (3, -2, 1, -1), "pulse": (1,)}[kind]
    edges = m.start_s + m.step_s * np.concatenate([[0], np.cumsum(np.abs(units))])
    signs = np.sign(units)
    impulse = sum(s * (b - a) for s, a, b in zip(signs, edges[:-1], edges[1:], strict=True))
    assert np.trapezoid(u, T) == pytest.approx(impulse, abs=1e-12)
    moment = sum(s * (b**2 - a**2) / 2 for s, a, b in zip(signs, edges[:-1], edges[1:], strict=True))
    assert np.trapezoid(u * T, T) == pytest.approx(moment, abs=2e-5)  # trapezoid of t: h^2/6 per edge


def test_edge_off_the_grid_is_refused_with_the_nearest_time():
    with pytest.raises(ConfigurationError, match=r"edge at 1\.003 s.*grid of 5 ms.*move it to 1\.005 s"):
        sample(Manoeuvre("doublet", 1.0, start_s=1.003), T)


def test_multisine_parts_are_orthogonal_and_start_at_zero():
    common = {"start_s": 0.0, "length_s": 10.0, "lowest_hz": 0.3, "highest_hz": 3.0, "parts": 2}
    one, two = (sample(Manoeuvre("multisine", 1.0, part=k, **common), T)[:-1] for k in (0, 1))
    assert abs(one @ two) < 1e-9 * np.sqrt((one @ one) * (two @ two))
    for wave in (one, two):
        assert abs(wave[0]) < 1e-3
        assert 0.99 < np.abs(wave).max() <= 1.0 + 1e-4
        # Peak factor of a harmonic sum is 1 for a sine (peak / (sqrt2 rms)); Morelli 2012 reaches about 1.1 to 1.3.
        assert np.abs(wave).max() / (np.sqrt(2) * wave.std()) < 1.5


def test_sweep_stays_in_its_band():
    u = sample(Manoeuvre("sweep", 1.0, start_s=0.0, length_s=10.0, lowest_hz=0.5, highest_hz=5.0), T)
    power = np.abs(np.fft.rfft(u)) ** 2
    hz = np.fft.rfftfreq(len(u), 1 / 200)
    assert power[(hz > 0.3) & (hz < 6.0)].sum() > 0.98 * power.sum()
    assert np.abs(u).max() <= 1.0


def test_replay_interpolates_and_holds():
    m = Manoeuvre(
        "replay", start_s=2.0, times_s=np.array([7.0, 8.0, 9.0]), values_rad=np.array([0.0, 1.0, 0.5])
    )
    u = sample(m, T)
    np.testing.assert_allclose(np.interp([1.0, 2.5, 3.0, 3.5, 6.0], T, u), [0.0, 0.5, 1.0, 0.75, 0.5])
    assert end_s(m) == 4.0


def test_unknown_kind_names_the_known_ones():
    with pytest.raises(ConfigurationError, match="did you mean 'doublet'"):
        sample(Manoeuvre("dublet"), T)


def test_a_step_ends_where_it_starts():
    assert end_s(Manoeuvre("step", 1.0, start_s=1.5)) == 1.5


@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"step", "replay"}))
def test_command_is_back_at_trim_after_its_end(kind):
    shapes = {
        "multistep": {"segments_s": (0.5, 1.0), "levels": (1.0, -0.5), "rise_s": 0.1},
        "harmonics": {"harmonics": (1, 3), "weights": (1.0, 0.5), "phases_rad": (0.5, 1.0)},
    }
    m = Manoeuvre(kind, 1.0, start_s=1.0, step_s=0.5, length_s=4.0, lowest_hz=0.5, **shapes.get(kind, {}))
    u = sample(m, T)
    assert np.abs(u[end_s(m) + 0.01 < T]).max() == 0.0


def test_121_signs_and_lengths():
    u = sample(Manoeuvre("121", 2.0, start_s=1.0, step_s=0.4, control="aileron"), T)
    middles = 1.0 + 0.4 * np.array([-0.5, 0.5, 2.0, 3.5, 4.5])
    np.testing.assert_allclose(np.interp(middles, T, u), [0, 2, -2, 2, 0], atol=1e-12)
    assert np.trapezoid(u, T) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("parts", [2, 3])
def test_multisines_of_several_controls_share_no_frequency(parts):
    """Over their length the inputs are orthogonal at any shift: no line of one is a line of another."""
    common = {"start_s": 0.0, "length_s": 10.0, "lowest_hz": 0.3, "highest_hz": 2.5, "parts": parts}
    waves = [sample(Manoeuvre("multisine", 1.0, part=k, **common), T)[:-1] for k in range(parts)]
    lines = [np.abs(np.fft.rfft(w)) > 1e-6 * len(w) for w in waves]
    for one in range(parts):
        for two in range(one):
            assert not (lines[one] & lines[two]).any()
            crossed = np.fft.irfft(np.fft.rfft(waves[one]) * np.conj(np.fft.rfft(waves[two])))
            assert np.abs(crossed).max() < 1e-9 * np.linalg.norm(waves[one]) * np.linalg.norm(waves[two])
