"""The error that the smoothed airspeed of a small aircraft keeps, and its correction from the records."""

from dataclasses import replace

import numpy as np
import pytest

from airtruth.tracing import TraceOptions
from airtruth.tracing.calibration.airspeed_error import corrected, modes, with_corrected_airspeed
from airtruth.tracing.inference.optimise import initial_parameters
from airtruth.tracing.model.records import fine
from airtruth.tracing.prepare import prepare
from validation import small_aircraft

SEED = 61


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    return small_aircraft.declared(tmp_path_factory.mktemp("small"))


def flown(plane, monkeypatch, noise_m_s=0.25, seed=SEED, options=None):
    monkeypatch.setattr(small_aircraft, "NOISE", {**small_aircraft.NOISE, "airspeed_m_s": noise_m_s})
    log = small_aircraft.flight_log(seed)
    return prepare([log], plane, [], options or TraceOptions()), log


def errors(problem, exact):
    """Error of the airspeed in each record [m/s]; ``exact`` is the log of the same flight without noise in the airspeed."""
    for r in problem.records:
        run = exact.run_ids.index(r.signals.record)
        truth = fine(exact.channels["airspeed_m_s"][exact.rows(run)], r.signals.sub)
        yield r.signals.airspeed_m_s - truth


@pytest.mark.slow
def test_the_error_has_the_stated_variances_and_the_correction_reduces_it(plane, monkeypatch):
    """Twenty records: the mean of 120 squares of standard normal amounts scatters by 0.13 about 1."""
    before, after, amounts = [], [], []
    for seed in range(SEED, SEED + 5):
        _, exact = flown(plane, monkeypatch, noise_m_s=0.0, seed=seed)
        case, _ = flown(plane, monkeypatch, seed=seed)
        start = initial_parameters(case.fitted, case.hypothesis)
        moved = with_corrected_airspeed(case, start)
        after += [np.mean(e**2) for e in errors(moved.fitted, exact)]
        for record, error in zip(case.fitted.records, errors(case.fitted, exact), strict=True):
            before.append(np.mean(error**2))
            series, stds = modes(record)
            sub = record.signals.sub
            amounts.append((series[:6, ::sub] @ error[::sub]) / stds[:6])
    assert 0.6 < np.mean(np.square(amounts)) < 1.6
    assert np.mean(after) < 0.9 * np.mean(before)


def test_an_airspeed_with_little_noise_is_left_as_it_is(plane, monkeypatch):
    case, _ = flown(plane, monkeypatch, noise_m_s=0.01)
    assert all(r.signals.airspeed_walk is None for r in case.fitted.records)
    assert with_corrected_airspeed(case, initial_parameters(case.fitted, case.hypothesis)) is case


@pytest.mark.slow
def test_a_missing_effect_does_not_move_the_airspeed_beyond_its_noise(plane, monkeypatch):
    """An aircraft of half of the declared mass has an acceleration of twice the declared one."""
    case, _ = flown(plane, monkeypatch)
    heavy = tuple(
        replace(r, signals=replace(r.signals, y=r.signals.y * [1.0, 1.0, 2.0])) for r in case.fitted.records
    )
    problem = replace(case.fitted, records=heavy)
    moved = corrected(problem, case.hypothesis, initial_parameters(problem, case.hypothesis))
    assert problem.records
    for old, new in zip(problem.records, moved.records, strict=True):
        assert np.std(new.signals.airspeed_m_s - old.signals.airspeed_m_s) < 0.1


@pytest.mark.slow
def test_what_comes_before_a_part_of_a_record_is_corrected_too(plane, monkeypatch):
    case, _ = flown(plane, monkeypatch, options=TraceOptions(hold_out=("r2", "r3", "r4", "r5", "r6")))
    first, second = case.fitted.records
    assert first.signals.lead is None
    assert second.signals.lead is not None
    moved = corrected(case.fitted, case.hypothesis, initial_parameters(case.fitted, case.hypothesis))
    change = moved.records[1].signals.with_lead.airspeed_m_s - second.signals.with_lead.airspeed_m_s
    assert np.abs(change[: len(second.signals.lead.airspeed_m_s)]).max() > 1e-4
    assert np.abs(np.diff(change)).max() < 1e-2


@pytest.mark.slow
def test_records_with_a_quiet_airspeed_beside_noisy_ones_are_left_as_they_are(plane, monkeypatch):
    """Runs r3 and r6 are held out; r1 and both of them have a steady airspeed."""
    _, log = flown(plane, monkeypatch)
    speed = log.channels["airspeed_m_s"].copy()
    for run in (0, 2, 5):
        speed[log.rows(run)] = 22.0
    mixed = replace(log, channels={**log.channels, "airspeed_m_s": speed})
    case = prepare([mixed], plane, [], TraceOptions())
    moved = with_corrected_airspeed(case, initial_parameters(case.fitted, case.hypothesis))
    assert moved.held is case.held
    same = [
        np.array_equal(a.signals.airspeed_m_s, b.signals.airspeed_m_s)
        for a, b in zip(case.fitted.records, moved.fitted.records, strict=True)
    ]
    assert same == [True, False, False, False]
