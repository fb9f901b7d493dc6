"""What a JSBSim model does beyond its forces at rest, against terms that are known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from airtruth import aircraft
from airtruth.aircraft.write import write_aircraft
from airtruth.channels import SIGNALS
from airtruth.logs.flight_log import FlightLog
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.terms import Change, SurfaceTerm
from airtruth.simulation.flight import Flight, Inputs
from airtruth.simulation.manoeuvres import Manoeuvre, sample
from airtruth.simulation.trim import trim
from airtruth.tracing.model.longitudinal.remainder import remainders
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.plant import looked_up
from airtruth.tracing.model.probed import probed
from airtruth.tracing.model.reading import read
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.model.response import filter_inputs, respond
from airtruth.tracing.model.settings import initial_per_record, settings_of
from airtruth.units import DEG

DT_S, EVERY, DELAY_S = 0.02, 4, 0.06


def plant_of(plane, at, alpha_rad=5.0 * DEG):
    reach = (at.alpha_rad - alpha_rad, at.alpha_rad + alpha_rad)
    return probed(plane, at, reach, (at.elevator_rad - 3.0 * DEG, at.elevator_rad + 3.0 * DEG), 0.8)


def record_of(plane, at, amplitude_rad=1.5 * DEG):
    """A doublet with ideal sensors."""
    t = np.arange(1001) * DT_S / EVERY
    command = sample(Manoeuvre("doublet", amplitude_rad=amplitude_rad, start_s=1.0, step_s=0.5), t)
    still = np.zeros_like(t)
    flown = Flight(plane, at, DT_S / EVERY, EVERY).fly(Inputs(command, still, still))
    channels = {name: flown[name] for name in SIGNALS if name in flown}
    log = FlightLog({}, ("a",), np.array([0, 251]), t[::EVERY], channels)
    return read(log)[0]


@pytest.fixture(scope="module")
def plant(gtm, paper_trim):
    return plant_of(gtm, paper_trim)


@pytest.fixture(scope="module")
def late(gtm, paper_condition, tmp_path_factory):
    """A GTM whose JSBSim model delays the air behind the measured surface, and that declares no dynamics."""
    folder = tmp_path_factory.mktemp("late") / "late"
    written = aircraft.load(write_aircraft(gtm, Change(surface=(SurfaceTerm("delay", DELAY_S),)), folder))
    file = written.file.model_copy(update={"dynamics": None})
    plane = written.model_copy(update={"file": file})
    at = trim(plane, paper_condition)
    return plane, at, record_of(plane, at)


def test_tables_are_read_trilinearly(plant):
    rng = np.random.default_rng(1)
    (table,) = plant.tables
    axes = table.axes
    x = np.stack([rng.uniform(axis[0], axis[-1], 50) for axis in axes], axis=1)
    pressure = rng.uniform(500.0, 1500.0, 50)
    other = pressure[:, None] * RegularGridInterpolator(axes, table.values)(x)
    other += RegularGridInterpolator(axes[:1], plant.constant)(x[:, :1])
    signals = dict(zip(table.signals, x.T, strict=True))
    np.testing.assert_allclose(looked_up(plant, signals, pressure), other, rtol=1e-10, atol=1e-9)


def test_an_aircraft_that_its_tables_hold_has_no_remainder(gtm, paper_trim, plant):
    """The GTM's forces are those of its state; the tables of whole degrees leave 1e-3 of the doublet's moment."""
    found = remainders([record_of(gtm, paper_trim)], [plant])[0]
    moment = abs(plant.derivatives[LONGITUDINAL.parameters.index("Cmde")]) * 1.5 * DEG
    assert np.abs(found[1]).max() < 0.02 * moment
    assert np.abs(found[0]).max() < 0.02 * moment


def test_tables_that_the_declared_model_flies_beyond_leave_no_remainder(gtm, paper_trim, plant):
    """The tables of a record of 1.5 deg end where it does. The GTM that flies a doublet of 4 deg leaves them for angles where its
    lift and moment bend; the remainder is that of tables as wide, not an extrapolation."""
    signals = record_of(gtm, paper_trim, 4.0 * DEG)
    narrow, wide = plant_of(gtm, paper_trim, 1.0 * DEG), plant_of(gtm, paper_trim, 12.0 * DEG)
    assert np.ptp(signals.y[:, 0]) > 1.5 * np.ptp(narrow.alpha_rad)
    found, right = remainders([signals, signals], [narrow, wide])
    moment = abs(plant.derivatives[LONGITUDINAL.parameters.index("Cmde")]) * 4.0 * DEG
    assert np.abs(found - right).max() < 0.02 * moment


def test_a_delay_of_the_model_is_the_remainder(late):
    """dCm = Cmde (de(t - delay) - de(t)), dCL likewise."""
    plane, at, signals = late
    plant = plant_of(plane, at)
    found = remainders([signals], [plant])[0]
    points = np.arange(found.shape[1]) * DT_S / signals.sub
    fine = np.arange(signals.elevator_rad.size) * DT_S / (signals.sub * 8)
    moved = np.interp(points - DELAY_S, fine, signals.elevator_rad) - np.interp(
        points, fine, signals.elevator_rad
    )
    for row, name in enumerate(("CLde", "Cmde")):
        slope = plant.derivatives[LONGITUDINAL.parameters.index(name)]
        error = found[row] - slope * moved
        assert error.std() < 0.1 * abs(slope) * moved.std(), name


def test_with_the_remainder_the_filter_flies_the_model(late):
    """Innovations of a record without noise, against those of the tables alone."""
    plane, at, signals = late
    bare = TraceRecord(signals, plant_of(plane, at), 500.0)
    settings = settings_of(plane, 0.05)
    own = initial_per_record(bare, settings)
    own[SHORT_PERIOD.per_record.log_gust] = np.log(1e-3)
    carried = replace(bare, remainder=remainders([signals], [bare.plant])[0])
    sizes = [
        respond(r, settings, Change(), np.zeros(SHORT_PERIOD.common.size), own, free_run=True).e.std(axis=0)
        for r in (bare, carried)
    ]
    assert (sizes[1] < 0.1 * sizes[0]).all()


def test_a_traced_delay_delays_the_remainder_too(late):
    plane, at, signals = late
    ramp = np.linspace(0.0, 1.0, (signals.y.shape[0] - 1) * signals.sub + 1)
    record = TraceRecord(signals, plant_of(plane, at), 500.0, np.stack([ramp, 2.0 * ramp]))
    grid = filter_inputs(record, Change(surface=(SurfaceTerm("delay", 0.04),))).grid
    slope = ramp[1] / (DT_S / signals.sub)
    np.testing.assert_allclose(grid.moment[50:], 2.0 * (ramp[50:] - slope * 0.04), atol=1e-12)
