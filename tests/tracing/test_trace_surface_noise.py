"""Noise of the measured surface: where it remains in the record, and where the filter expects it."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth import aircraft
from airtruth.logs.store import read_log
from airtruth.physics.linear_model import Linear
from airtruth.physics.motion import LONGITUDINAL
from airtruth.tracing import TraceOptions
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.model.reading import MeasuredControl, measured_controls, read
from airtruth.tracing.model.surface_noise import caused_share, gains
from airtruth.tracing.prepare import prepare
from airtruth.units import DEG
from validation import small_aircraft as small
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import log_of, trial

STD_RAD = 0.04 * DEG


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    return small.declared(tmp_path_factory.mktemp("small"))


@pytest.mark.slow
def test_the_noise_remains_where_the_surface_moves_and_in_short_rests():
    """A step at 2 s, one back after 0.3 s, and none after that: only long rests are without noise."""
    log = small.flight_log(5)
    t = log.t_s[log.rows(0)]
    step = np.where((t >= 2.0) & (t < 2.3), 4.0 * DEG, 0.0)
    noise = STD_RAD * np.random.default_rng(0).standard_normal(log.t_s.size)
    surface = np.tile(step, small.RECORDS) + noise
    (first, *_) = read(
        replace(log, channels={**log.channels, "elevator_rad": surface}),
        LONGITUDINAL,
        [MeasuredControl(STD_RAD)],
    )
    noisy = first.surface_noise_rad2[0] == STD_RAD**2
    assert noisy[(t > 2.0) & (t < 2.3)].all()
    assert not noisy[(t < 1.5) | (t > 3.0)].any()
    assert set(np.unique(first.surface_noise_rad2)) == {0.0, STD_RAD**2}


def test_a_surface_without_noise_has_none():
    (first, *_) = read(small.flight_log(5, noise=0.0))
    assert first.surface_noise_rad2.size == 0


def test_the_noise_of_an_undeclared_surface_is_that_of_its_rest():
    """Six records whose surface rests for 7 of 9 s: 350 samples know its noise to 4 %."""
    found = [np.sqrt(signals.surface_noise_rad2.max()) for signals in read(small.flight_log(5))]
    assert found == pytest.approx([STD_RAD] * small.RECORDS, rel=0.12)


@pytest.mark.slow
def test_it_counts_where_the_motion_adds_it_up(plane, tmp_path):
    """0.04 deg counts for the small aircraft. Of 0.01 deg the GTM adds up 0.96 of the noise of the bank's sensor in the lateral
    motion, and 0.13 of that of the vane in the pitch plane, which is negligible.
    """
    small_case = prepare([small.flight_log(5)], plane, [], TraceOptions())
    assert all(r.signals.surface_noise_rad2.any() for r in small_case.fitted.records)
    log, gtm = read_log("data/undeclared/f.parquet"), aircraft.load("gtm")
    pitch = prepare([log], gtm, [], TraceOptions())
    assert all(r.signals.surface_noise_rad2.size == 0 for r in pitch.fitted.records)
    (signals, *_) = read(log, LONGITUDINAL, measured_controls(gtm, LONGITUDINAL), gtm.constants)
    noisy = replace(pitch.fitted.records[0], signals=signals)
    assert caused_share(noisy, pitch.fitted.settings) == pytest.approx(0.134, abs=0.002)
    hidden = trial("lateral-none", 7200004)
    declared = aircraft.load(lateral_aircraft(tmp_path / "declared"))
    lateral = prepare([log_of(*hidden.flights)], declared, [], TraceOptions(motion="lateral"))
    for record in lateral.fitted.records:
        assert (record.signals.surface_noise_rad2 > 0.0).any(axis=1).all()
        assert caused_share(record, lateral.fitted.settings) == pytest.approx(0.96, abs=0.01)


def test_gains_are_those_of_the_transfer_function():
    """x'' + 2 zeta w x' + w^2 x = b u at s = j w: x = b/(2 j zeta w^2), x' = b/(2 zeta w), by hand."""
    w, zeta, b = 5.0, 0.15, 3.0
    model = Linear(
        a=np.array([[0.0, 1.0], [-(w**2), -2.0 * zeta * w]]),
        b=np.array([[0.0], [b]]),
        c=np.eye(2),
        d=np.zeros((2, 1)),
    )
    for gain in gains(model, 0.5):
        assert gain[:, 0] == pytest.approx([b / (2j * zeta * w**2), b / (2.0 * zeta * w)], rel=1e-12)
    assert not gains(model, 6.0)


@pytest.mark.slow
def test_innovations_of_the_gyro_are_as_large_in_motion_as_at_rest(plane):
    """Twenty-four records of a flight without a missing effect; the ratio of 2000 squares to 9000 scatters by 0.035."""
    ratios = {True: [], False: []}
    for seed in range(61, 67):
        case = prepare([small.flight_log(seed)], plane, [], TraceOptions())
        exact = tuple(
            replace(r, signals=replace(r.signals, surface_noise_rad2=np.zeros((1, 0))))
            for r in case.fitted.records
        )
        for expects, problem in ((True, case.fitted), (False, replace(case.fitted, records=exact))):
            fitted = fit(problem, case.hypothesis, initial_parameters(problem, case.hypothesis))
            for record, at in zip(case.fitted.records, fitted.sensitivities, strict=True):
                moving = record.signals.surface_noise_rad2[0] > 0.0
                ratios[expects].append([np.mean(at.r[rows, 1] ** 2) for rows in (moving, ~moving)])
    expected, ignored = (np.divide(*np.mean(ratios[expects], axis=0)) for expects in (True, False))
    assert expected == pytest.approx(1.0, abs=0.07)
    assert ignored > 1.12
