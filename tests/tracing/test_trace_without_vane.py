"""Records without an alpha vane: q and az are the outputs of the filter, and nothing is said of a vane."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are
from trace_flights import fly, log_of
from trace_records import GTM, SETTINGS, doublet, record

from airtruth.importers import import_log
from airtruth.importers.mapping import MappingFile
from airtruth.logs.store import write_log
from airtruth.physics.reconstruction import COLUMNS
from airtruth.physics.terms import Change
from airtruth.tracing import trace
from airtruth.tracing.model.linearise import discrete, process_intensity
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.response import filter_inputs, kernel_input, respond
from airtruth.tracing.model.settings import declared_change, initial_per_record, settings_of
from airtruth.tracing.model.steady import linearise_at_reference

WITHOUT = settings_of(GTM, 0.05, absent=("alpha_rad",))
UNITS = {
    "airspeed_m_s": "m_s", "theta_rad": "rad", "q_rad_s": "rad_s", "ax_m_s2": "m_s2", "az_m_s2": "m_s2",
    "elevator_rad": "rad", "altitude_m": "m", "density_kg_m3": "kg_m3",
}  # fmt: skip
VANE = {"vane_arm", "vane_lag", "vane_scale", "vane_bias", "sensor_delay:alpha_rad"}
"""Effects of the library that act on a vane's reading alone (docs/effects.md)."""


def noisy(seed):
    """A record of noise about the trim, its elevator a doublet; alpha is arbitrary."""
    y = np.random.default_rng(seed).standard_normal((150, 3)) * SETTINGS.noise
    return record(y, doublet)


def own_of(one):
    own = initial_per_record(one, WITHOUT)
    own[SHORT_PERIOD.per_record.index("alpha0")] = 0.0
    own[SHORT_PERIOD.per_record.log_gust] = np.log(0.3)
    return own


def test_without_a_vane_alpha_is_no_output():
    assert SETTINGS.measured.tolist() == [True, True, True]
    assert WITHOUT.measured.tolist() == [False, True, True]
    assert not any(
        term.channel == "alpha_rad" for term in declared_change(GTM, absent=("alpha_rad",)).sensors
    )


@pytest.mark.slow
def test_the_filter_is_that_of_two_outputs():
    """Innovations of q and az have the covariance C P C' + R of the Kalman filter whose outputs are these two (SciPy)."""
    one = noisy(1)
    own = own_of(one)
    made = respond(one, WITHOUT, Change(), np.zeros(SHORT_PERIOD.common.size), own)
    kernel = kernel_input(filter_inputs(one, Change()), WITHOUT, np.zeros(SHORT_PERIOD.common.size), own)
    n = kernel.model.states.size
    a, c = np.empty((n, n)), np.empty((3, n))
    linearise_at_reference(kernel, a, c)
    phi, noise = discrete(a, process_intensity(kernel.reference.airspeed_m_s, kernel.model), kernel.dt_s)
    two, r = c[1:], np.diag(WITHOUT.noise[1:] ** 2)
    p = solve_discrete_are(phi.T, two.T, noise, r)
    np.testing.assert_allclose(made.covariance[1:, 1:], two @ p @ two.T + r, rtol=1e-6)


@pytest.mark.slow
def test_a_reconstructed_alpha_has_no_say():
    """Another alpha of the same mean changes neither the innovations of q and az nor the likelihood.

    The mean is where the filter is linearised.
    """
    one, other = noisy(1), noisy(1)
    another = 0.1 * np.sin(np.arange(150))
    other.signals.y[:, 0] = another - another.mean() + one.signals.y[:, 0].mean()
    own = own_of(one)
    first, second = (
        respond(r, WITHOUT, Change(), np.zeros(SHORT_PERIOD.common.size), own) for r in (one, other)
    )
    moved = (second.e - first.e)[:, 1:] / SETTINGS.noise[1:]
    assert np.abs(moved).max() < 1e-6
    whitened = second.e @ second.white.T
    assert np.abs(whitened[:, 0]).max() < 1e-3
    assert second.logdet == pytest.approx(first.logdet, abs=1e-9)


def without_vane(place, folder):
    """The records of a campaign as an import without alpha makes them."""
    log_of(place).to_frame().drop(columns="alpha_rad").to_parquet(folder / "bare.parquet")
    stated = {
        "aircraft": "gtm",
        "time": {"column": "t_s", "run": "run_id"},
        "channels": {name: {"column": name, "unit": unit} for name, unit in UNITS.items()},
        "reconstruct": {"alpha": True},
    }
    log = import_log(folder / "bare.parquet", MappingFile.model_validate(stated)).log
    assert set(COLUMNS) <= log.channels.keys()
    write_log(folder / "log.parquet", log, dtype="float64")
    return folder / "log.parquet"


def vane_is_left_out(answer):
    rows = [c for c in answer.candidates if f"{c.name}:{c.variant}".rstrip(":") in VANE]
    assert len(rows) == len(VANE)
    assert all(not c.testable and "alpha was reconstructed" in c.why_not for c in rows)
    assert any("alpha was reconstructed" in note for note in answer.notes)
    named = {name for e in answer.effects for name in (e.key, *e.indistinguishable_from)}
    assert not named & {*VANE, "sensor_delay"}


@pytest.mark.long
@pytest.mark.slow
def test_without_a_vane_nothing_is_traced_where_nothing_is_missing(tmp_path):
    log = without_vane(fly(tmp_path / "null", runs=6, duration=8.0), tmp_path)
    answer = trace(log, "gtm", out=tmp_path / "out").answer
    assert answer.verdict == "none"
    vane_is_left_out(answer)
    assert "alpha_rad" not in answer.error.channels
    assert (tmp_path / "out" / "trace.json").exists()


@pytest.mark.long
@pytest.mark.slow
def test_without_a_vane_an_elevator_delay_is_traced(tmp_path):
    place = fly(tmp_path / "late", [("elevator_delay", {"delay_s": 0.08})], runs=6, duration=8.0)
    answer = trace(without_vane(place, tmp_path), "gtm").answer
    assert [e.name for e in answer.effects] == ["elevator_delay"]
    low, high = answer.effects[0].parameters["delay_s"].ci95
    assert low < 0.08 < high
    vane_is_left_out(answer)
