"""Sentences about estimates that a reader should not trust."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.identification import doubts as module
from airtruth.identification.estimates import Estimates, Status
from airtruth.physics.short_period import PARAMETERS, Scale

THETA = np.array([4.5, 31.0, 0.5, -1.8, -45.0, -1.9])
STD = np.array([0.1, 3.0, 0.05, 0.03, 1.0, 0.03])


def estimates(theta=THETA, std=STD, runs=1, method="iv-f1", status=Status.CONVERGED, covariance=None):
    square = np.diag(np.asarray(std) ** 2) if covariance is None else covariance
    names = [f.name for f in Scale.__dataclass_fields__.values()]
    figures = {"airspeed_m_s": 45.0, "lift": 1.2, "moment": 22.0, "half_chord_time": 0.003}
    scale = Scale(**{n: np.full(runs, figures.get(n, 1.0)) for n in names})
    return Estimates(
        method=method,
        run_ids=tuple(f"r{i}" for i in range(runs)),
        theta=np.tile(theta, (runs, 1)),
        covariance=np.tile(square, (runs, 1, 1)),
        covariance_name="corrected",
        status=np.full(runs, status, dtype=np.int8),
        iterations=np.zeros(runs, dtype=np.int32),
        scale=scale,
        confidence=0.95,
    )


def doubts(methods):
    return module.doubts(lambda: [methods])


def test_sound_estimates_raise_no_doubt():
    assert doubts([estimates(), estimates(method="ls")]) == []


@pytest.mark.parametrize(("name", "value", "word"), [("Cmalpha", 0.4, "stiffness"), ("Cmq", 12.0, "damping")])
def test_a_wrong_sign_with_a_tight_interval_is_a_warning(name, value, word):
    theta = THETA.copy()
    theta[PARAMETERS.index(name)] = value
    (warning,) = [s for s in doubts([estimates(theta)]) if s.startswith("Warning")]
    assert f"{name} = " in warning
    assert f"pitch {word} of the wrong sign" in warning
    for cause in ("sensor that lags", "feedback", "too short"):
        assert cause in warning
    wide = STD.copy()
    wide[PARAMETERS.index(name)] = value
    assert not [s for s in doubts([estimates(theta, wide)]) if s.startswith("Warning")]


def test_an_undetermined_direction_is_named_in_physical_terms():
    """CLq and CLde trade against each other: 60 of CLq for -0.9 of CLde."""
    direction = np.array([0.0, 60.0, -0.9, 0.0, 0.0, 0.0])
    square = np.diag(STD**2) + np.outer(direction, direction)
    (sentence,) = doubts([estimates(covariance=square)])
    assert "do not determine CLq (standard deviation 60)" in sentence
    assert "lift by pitch rate" in sentence
    assert "lift of the elevator" in sentence
    signs = [part.split(" in ")[0][0] for part in sentence.split("(")[2:4]]
    assert set(signs) == {"+", "-"}


def test_every_missing_number_has_its_reason():
    none = replace(
        estimates(runs=2), theta=np.full((2, 6), np.nan), status=np.full(2, Status.SINGULAR, dtype=np.int8)
    )
    (sentence,) = doubts([none])
    assert "no estimate in 2 of 2 runs: singular" in sentence
    unstable = THETA.copy()
    unstable[3] = 9.0
    assert any("no frequency and damping ratio" in s for s in doubts([estimates(unstable)]))
    bare = estimates(covariance=np.full((6, 6), np.nan))
    assert any("no intervals" in s for s in doubts([bare]))


def test_methods_that_contradict_each_other_are_named():
    other = THETA.copy()
    other[1] = 223.0
    (sentence,) = [s for s in doubts([estimates(), estimates(other, method="ls")]) if s.startswith("CLq")]
    assert "31 by iv-f1" in sentence
    assert "223 by ls" in sentence
