"""Methods that take the dynamic pressure for constant, and records in which it is not."""

import numpy as np
import pytest

from airtruth.identification import Options, identify
from airtruth.identification.condition import pressure_range
from airtruth.logs.flight_log import Batch, batches
from validation import small_aircraft as small

WORDS = "dynamic pressure changes by"


@pytest.fixture(scope="module")
def plane(tmp_path_factory):
    return small.declared(tmp_path_factory.mktemp("small"))


@pytest.fixture(scope="module")
def log():
    return small.flight_log(600)


def said(result):
    return [note for note in result.notes if WORDS in note]


def test_the_range_is_that_of_means_over_half_a_second():
    """Airspeed of 20 m/s whose square rises by 30 % of its mean over 10 s: means over half a second span 0.95 of it."""
    t = np.linspace(0.0, 10.0, 501)
    pressure = 400.0 * (1.0 + 0.03 * (t - 5.0))
    channels = {"airspeed_m_s": np.sqrt(pressure)[None], "density_kg_m3": np.full((1, 501), 1.2)}
    batch = Batch(("r",), 0.02, t[None], channels)
    assert pressure_range(batch) == pytest.approx([0.3 * 0.95], rel=2e-3)


@pytest.mark.slow
def test_a_changing_pressure_is_noted_for_methods_that_take_it_for_constant(plane, log):
    """The airspeed of run r4 falls from 24.4 to 18.9 m/s."""
    (note,) = said(identify(log, plane, ["ls", "iv-f1", "iv-refined"]))
    assert note.startswith("ls, iv-f1: ")
    assert "in run 'r4', and by more than 20 % in 4 of 6 runs" in note
    (note,) = said(identify(log, plane, ["iv-refined"], Options(pressure="constant")))
    assert note.startswith("iv-refined: ")


@pytest.mark.slow
def test_measured_pressure_and_steady_records_have_no_note(plane, log):
    assert not said(identify(log, plane, ["ls"], Options(pressure="measured")))
    assert not said(identify("data/undeclared/c.parquet", "gtm", ["ls"]))


def test_the_measured_pressure_removes_the_error(plane, log):
    """Cmalpha of run r4 is wrong by 4 standard deviations at constant pressure."""
    errors = {}
    for pressure in ("constant", "measured"):
        frame = identify(log, plane, ["iv-f1"], Options(pressure=pressure)).to_frame()
        row = frame[frame["run_id"] == "r4"].iloc[0]
        errors[pressure] = abs(row["Cmalpha"] - small.MOMENT[1]) / row["Cmalpha_std"]
    assert errors["constant"] > 3.0
    assert errors["measured"] < 2.0


@pytest.mark.slow
def test_every_batch_of_a_log_counts(log):
    assert sum(len(pressure_range(batch)) for batch in batches(log)) == len(log.run_ids)
