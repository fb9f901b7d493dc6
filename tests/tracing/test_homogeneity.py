"""Records that differ: Cochran's statistic, and the sentence that names the odd one."""

from dataclasses import replace

import numpy as np
import pytest
import trace_records as tr
from scipy.stats import chi2

from airtruth.tracing.criterion import CRITERION
from airtruth.tracing.inference.homogeneity import DIFFERENCES, Homogeneity, homogeneity, spread
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.record_differences import differences

NAMES = ["r0", "r1", "r2", "r3"]
AMPLITUDES = (0.035, -0.035, 0.03, -0.03)


def agreement(records):
    problem = tr.problem(records)
    return homogeneity(problem, fit(problem, tr.NOTHING, initial_parameters(problem, tr.NOTHING)))


def flown(seed):
    rng = np.random.default_rng(seed)
    return [tr.fly(rng, samples=300, amplitude=a, name=n) for a, n in zip(AMPLITUDES, NAMES, strict=True)]


def test_statistic_is_the_weighted_sum_of_squares_about_the_common_estimate():
    """Estimates of three records with their covariances, written out: sum (d_i - d)' H_i (d_i - d), d the weighted mean."""
    rng = np.random.default_rng(1)
    factors = rng.standard_normal((3, 2, 5))
    information = factors @ factors.transpose(0, 2, 1)
    own = rng.standard_normal((3, 2))
    slopes = -np.einsum("rij,rj->ri", information, own)
    mean = np.linalg.solve(information.sum(axis=0), -slopes.sum(axis=0))
    expected = sum(d @ h @ d for d, h in zip(own - mean, information, strict=True))
    value, degrees = spread(slopes, information)
    assert value == pytest.approx(expected, rel=1e-10)
    assert degrees == 2 * 3 - 2


def test_a_direction_that_a_record_does_not_show_counts_for_no_degree():
    information = np.stack([np.diag([1.0, 0.0]), np.eye(2)])
    assert spread(np.array([[1.0, 0.0], [-1.0, 0.0]]), information) == (pytest.approx(2.0), 1)


@pytest.mark.slow
def test_alike_records_agree_as_often_as_chance_says():
    """Twenty sets of four records: the mean of chi-square is its degrees of freedom, to three standard errors."""
    found = [agreement(flown(seed)) for seed in range(20)]
    degrees = found[0].degrees
    assert degrees == 6 * 3
    mean = np.mean([h.statistic for h in found])
    assert mean == pytest.approx(degrees, abs=3.0 * np.sqrt(2.0 * degrees / len(found)) + 2.0)
    assert min(h.p_value for h in found) > CRITERION.differ


def test_the_record_whose_vane_reads_too_much_is_the_odd_one():
    records = flown(3)
    y = records[2].signals.y * [1.3, 1.0, 1.0]
    records[2] = replace(records[2], signals=replace(records[2].signals, y=y))
    found = agreement(records)
    assert found.p_value < 1e-6
    assert found.outlier == 2
    assert found.rest_p_value > 0.01
    assert found.p_value == pytest.approx(chi2.sf(found.statistic, found.degrees), rel=1e-9)


def test_two_records_do_not_show_which_one_is_wrong():
    records = flown(3)[:2]
    y = records[1].signals.y * [1.3, 1.0, 1.0]
    records[1] = replace(records[1], signals=replace(records[1].signals, y=y))
    found = agreement(records)
    assert (found.outlier, found.rest_p_value) == (None, 1.0)
    assert found.p_value < 1e-6


@pytest.mark.parametrize(
    ("test", "words"),
    [
        (Homogeneity(DIFFERENCES, 20.0, 18, 0.3, 1, 0.5), ""),
        (
            Homogeneity(DIFFERENCES, 90.0, 18, 1e-11, 1, 0.5),
            "without r1 the others agree (p = 0.5): look for a fault or another loading in r1",
        ),
        (Homogeneity(DIFFERENCES, 90.0, 18, 1e-11, 1, 1e-3), "no single record is the reason"),
        (
            Homogeneity(DIFFERENCES, 90.0, 6, 1e-11, None, 1.0),
            "two records do not show which of them is wrong",
        ),
    ],
)
def test_sentence(test, words):
    found = differences(test, NAMES, names=True)
    assert len(found) == bool(words)
    assert words in "".join(found)
    assert all("so the answer is provisional" in s for s in found)
    assert not any("provisional" in s for s in differences(test, NAMES, names=False))
