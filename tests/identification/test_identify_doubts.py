"""Sentences about estimates that a reader should not trust."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airtruth.identification import doubts as module
from airtruth.identification import identify
from airtruth.identification.estimates import Estimates, Status, point_values
from airtruth.identification.methods import METHODS
from airtruth.logs.store import read_log
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.short_period import Scale

ROOT = Path(__file__).resolve().parents[2]

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


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("Cmalpha", 0.4, "pitch stiffness"),
        ("Cmq", 12.0, "pitch damping"),
        ("CLalpha", -1.0, "lift slope"),
        ("CLde", -0.77, "lift of the elevator"),
        ("Cmde", 0.5, "moment of the elevator"),
    ],
)
def test_a_wrong_sign_with_a_tight_interval_is_a_warning(name, value, words):
    theta = THETA.copy()
    theta[LONGITUDINAL.parameters.index(name)] = value
    (warning,) = [s for s in doubts([estimates(theta)]) if s.startswith("Warning")]
    assert doubts([estimates(theta)])[0] == warning
    assert warning.index(f"{words} of the wrong sign") < warning.index(f"{name} = ")
    for cause in ("sensor that lags", "feedback", "too short"):
        assert cause in warning
    wide = STD.copy()
    wide[LONGITUDINAL.parameters.index(name)] = abs(value)
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


def test_coarse_differences_are_named():
    """1 - sin(wn dt)/(wn dt) of wn = 6.6 rad/s: 1.8 % at 20 Hz, 0.3 % at 50 Hz."""
    wn = point_values(estimates())[0, len(LONGITUDINAL.parameters)]
    (sentence,) = module.doubts(lambda: [[estimates(method="ls"), estimates()]], 0.05)
    share = 100.0 * (1.0 - np.sin(wn * 0.05) / (wn * 0.05))
    assert sentence.startswith(f"ls: central differences at 20 Hz lose {share:.2g} % of the motion")
    assert "use iv-f1" in sentence
    assert module.doubts(lambda: [[estimates(method="ls"), estimates()]], 0.02) == []


def test_differencing_methods_are_those_of_the_low_pass():
    posed = {m.name for m in METHODS.values() if m.pose is not None}
    assert posed - set(module.DIFFERENCING) == {"iv-f1", "iv-f2"}
    assert set(module.DIFFERENCING) < posed


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


def test_a_slow_log_is_named_by_identify():
    """Each third sample of a log at 50 Hz."""
    log = read_log(ROOT / "data" / "undeclared" / "a.parquet").select(run_ids=["r1"])
    slow = replace(
        log,
        metadata={},
        offsets=np.array([0, len(log.t_s[::3])]),
        t_s=log.t_s[::3],
        channels={n: v[::3] for n, v in log.channels.items()},
    )
    for joint in (False, True):
        notes = identify(slow, "gtm", ["ls"], joint=joint).notes
        assert any(n.startswith("ls: central differences at 16.7 Hz") for n in notes)
        assert not any("differences" in n for n in identify(log, "gtm", ["ls"], joint=joint).notes)
