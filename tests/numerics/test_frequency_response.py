"""Frequency responses of known systems; coherence and error against their distributions."""

import numpy as np
import pytest
from scipy.signal import coherence, freqz, lfilter

from airtruth.numerics.frequency_response import FrequencyResponse, frequency_response

DT = 0.02
B, A = [0.0, 0.3], [1.0, -0.7]


def records(count, noise, seed=3, samples=2048):
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(count, samples))
    y = lfilter(B, A, x, axis=1) + noise * rng.normal(size=x.shape)
    return list(x), list(y)


def test_a_filter_is_recovered():
    """The response of a first-order filter is that of scipy.signal.freqz; without noise the coherence is 1."""
    x, y = records(20, 0.0)
    found = frequency_response(x, y, DT, highest_hz=10.0)
    _, expected = freqz(B, A, worN=2 * np.pi * found.frequency_hz * DT)
    several = found.frequency_hz > 0.2  # the taper blurs the lowest lines
    np.testing.assert_allclose(found.response[several], expected[several], rtol=0.02)
    assert found.coherence[several].min() > 0.99
    assert found.permitted[several].all()


def test_the_coherence_is_that_of_scipy():
    """One band of one line with n records is Welch's estimate of n segments, here without overlap."""
    x, y = records(16, 1.0)
    found = frequency_response(x, y, DT)
    n = len(x[0])
    _, welch = coherence(
        np.concatenate(x),
        np.concatenate(y),
        fs=1 / DT,
        window=("tukey", 0.1),
        nperseg=n,
        noverlap=0,
        detrend="linear",
    )
    lone = found.averages == 16
    assert lone.sum() >= 4
    lines = np.round(found.frequency_hz[lone] * n * DT).astype(int)
    np.testing.assert_allclose(found.coherence[lone], welch[lines], rtol=1e-10)


def test_the_stated_error_is_the_scatter():
    """Over 60 repetitions, the errors of log |H| and of the phase have the stated standard deviation."""
    deviations = []
    for seed in range(60):
        found = frequency_response(*records(8, 0.5, seed=seed, samples=512), DT, highest_hz=5.0)
        _, expected = freqz(B, A, worN=2 * np.pi * found.frequency_hz * DT)
        ratio = np.log(found.response / expected) / found.error
        deviations.append(ratio[found.averages >= 24])
    assert np.std(np.real(deviations)) == pytest.approx(1.0, abs=0.12)
    assert np.std(np.imag(deviations)) == pytest.approx(1.0, abs=0.12)


def test_unrelated_signals_are_rarely_permitted():
    x, _ = records(6, 0.0, seed=1)
    _, y = records(6, 0.0, seed=2)
    found = frequency_response(x, y, DT)
    assert found.permitted.mean() < 0.05


def test_one_record_and_one_line_have_no_coherence():
    one = np.array([1.0])
    found = FrequencyResponse(one, one + 0j, one, 0 * one, np.array([1]))
    assert not found.permitted.any()


def test_too_short_a_record_is_refused():
    with pytest.raises(ValueError, match="at least 16 samples"):
        frequency_response([np.zeros(8)], [np.zeros(8)], DT)
