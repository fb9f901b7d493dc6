"""Faults of the times of a log: their unit, and samples that an import interpolated."""

from dataclasses import replace
from pathlib import Path

import pytest

from airtruth.checks.gate import admit, inspect
from airtruth.errors import LogError
from airtruth.logs.store import read_log

UNDECLARED = Path(__file__).resolve().parents[2] / "data" / "undeclared" / "a.parquet"


@pytest.fixture(scope="module")
def log():
    return read_log(UNDECLARED)


@pytest.mark.parametrize(
    ("factor", "unit"),
    [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"), (1e-3, "units of 1000 s")],
)
def test_times_in_another_unit_are_the_only_fault(log, gtm, factor, unit):
    """Every rate of change is wrong with them, so that other channels would take the blame."""
    (fault,) = inspect(replace(log, t_s=factor * log.t_s), gtm)
    assert (fault.channel, fault.code, fault.certain) == ("t_s", "unit", True)
    assert f"the rate would be 50 Hz if the times are in {unit}" in fault.sentence


def test_times_in_another_unit_are_refused(log):
    with pytest.raises(LogError, match=r"t_s: 0\.05 samples per second in all 6 runs"):
        admit(replace(log, t_s=1e3 * log.t_s, metadata={}))


def test_interpolated_channels_are_named(log, gtm):
    stated = {"rate_hz": 50.0, "method": "cubic", "from_hz": {"q_rad_s": 10.0, "airspeed_m_s": 1.0}}
    (fault,) = inspect(replace(log, metadata={**log.metadata, "resampled": stated}), gtm)
    assert (fault.channel, fault.code, fault.certain) == ("q_rad_s", "interpolated", False)
    assert fault.sentence.startswith("q_rad_s from 10 Hz: interpolated to 50 Hz")


@pytest.mark.parametrize(
    "stated", [{"rate_hz": 50.0, "method": "cubic"}, "yes", {"from_hz": {"airspeed_m_s": 1.0}}]
)
def test_other_resampled_logs_have_no_fault(log, gtm, stated):
    assert inspect(replace(log, metadata={**log.metadata, "resampled": stated}), gtm) == ()
