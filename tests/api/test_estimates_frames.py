"""Estimates as tables of pandas, and results at the prompt of an interpreter."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, freqz_sos
from scipy.stats import norm

import airtruth as at
from airtruth.numerics.prefilter import butterworth
from airtruth.physics.motion import LONGITUDINAL
from airtruth.result import MOST_LINES, shortened


@pytest.fixture(scope="module")
def result() -> at.IdentificationResult:
    return at.identify("data/undeclared/b.parquet", "gtm", ["ls", "iv-f1"])


def test_the_tables_hold_the_arrays(result: at.IdentificationResult) -> None:
    estimates = result.of("iv-f1")
    assert list(estimates.params.columns) == list(LONGITUDINAL.parameters)
    assert list(estimates.params.index) == list(estimates.run_ids)
    np.testing.assert_array_equal(estimates.params.to_numpy(), estimates.theta)
    run = estimates.run_ids[2]
    covariance = estimates.cov_params(run)
    np.testing.assert_array_equal(covariance.to_numpy(), estimates.covariance[2])
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), estimates.bse.loc[run], rtol=1e-14)
    np.testing.assert_array_equal(estimates.cov_params().loc[run].to_numpy(), estimates.covariance[2])


def test_an_interval_is_normal(result: at.IdentificationResult) -> None:
    estimates = result.of("ls")
    ends = estimates.conf_int(alpha=0.1).loc[(estimates.run_ids[0], "Cmalpha")]
    value, std = estimates.params.iloc[0]["Cmalpha"], estimates.bse.iloc[0]["Cmalpha"]
    np.testing.assert_allclose(ends, norm.interval(0.9, value, std), rtol=1e-13)
    with pytest.raises(at.ConfigurationError, match="alpha"):
        estimates.conf_int(alpha=95.0)


def test_the_tidy_table_has_the_numbers_of_the_wide_one(result: at.IdentificationResult) -> None:
    wide = result.to_frame().set_index(["method", "run_id"])
    rows = result.tidy()
    assert len(rows) == 2 * len(result.run_ids) * 8
    for row in rows.itertuples():
        own = wide.loc[(row.method, row.run_id)]
        got = np.array([row.estimate, row.std, row.lower, row.upper])
        names = [f"{row.parameter}{end}" for end in ("", "_std", "_lower", "_upper")]
        np.testing.assert_array_equal(got, own[names].to_numpy(float))


def test_a_result_prints_a_screen(result: at.IdentificationResult) -> None:
    assert len(repr(result).splitlines()) <= MOST_LINES
    assert shortened("a\nb\n") == "a\nb"
    lines = shortened("x\n" * 100).splitlines()
    assert len(lines) == MOST_LINES
    assert lines[-1].startswith("... 81 more lines")


@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 8])
@pytest.mark.parametrize("cutoff_hz", [0.5, 5.0, 20.0])
def test_the_butterworth_filter_is_that_of_scipy(order: int, cutoff_hz: float) -> None:
    _, own = freqz_sos(butterworth(cutoff_hz, order, 0.02), fs=50.0)
    _, scipys = freqz_sos(butter(order, cutoff_hz, fs=50.0, output="sos"), fs=50.0)
    np.testing.assert_allclose(own, scipys, rtol=1e-9, atol=1e-13)


HEAVY = ("pandas", "scipy.signal", "scipy.stats", "scipy.optimize", "numba", "matplotlib", "jsbsim")
"""Libraries whose import takes a tenth of a second or more."""


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ("identify data/undeclared/b.parquet --aircraft gtm --method iv-f3", "iv-f3"),
        ("identify none.parquet --aircraft gtm", "none.parquet"),
        ("identify data/undeclared/b.parquet --aircraft gtx", "gtx"),
        (
            "trace data/undeclared/b.parquet --aircraft gtm --out out/x --effect elevator_dela",
            "elevator_dela",
        ),
        ("loop none.parquet --aircraft gtm --out out/x", "none.parquet"),
        ("check none.parquet", "none.parquet"),
        ("plan none.toml", "none.toml"),
        ("plan --split elevator_dela,actuator_lag --aircraft gtm", "elevator_dela"),
        ("import none.csv --guess", "none.csv"),
        ("identify data/undeclared/b.parquet --aircraft gtm --nonsense", "--nonsense"),
    ],
)
def test_wrong_names_are_refused_before_heavy_imports(arguments: str, word: str) -> None:
    program = (
        "import sys\n"
        f"sys.argv = ['airtruth', *{arguments.split()!r}]\n"
        "from airtruth.cli import main\n"
        "try:\n    main()\n"
        "except SystemExit as end:\n    print(end.code, *sorted(set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    code, *modules = done.stdout.split()
    assert code == "2", done.stderr
    assert word in done.stderr
    assert not set(HEAVY) & set(modules)


def test_an_effect_of_the_library_stands_for_its_key() -> None:
    (delay,) = at.list_effects("elevator_delay")
    assert at.TraceOptions(effects=(delay, "vane_arm")).keys == ("elevator_delay", "vane_arm")
    assert at.TraceOptions(effects="vane_arm").keys == ("vane_arm",)


def test_an_effect_need_not_be_in_the_library() -> None:
    (delay,) = at.list_effects("elevator_delay")
    other = dataclasses.replace(delay, name="other")
    assert at.TraceOptions(effects=other).effects == (other,)
    assert at.TraceOptions(effects=(other, "vane_arm")).keys == ("other", "vane_arm")
    with pytest.raises(at.ConfigurationError, match="another effect with the key elevator_delay"):
        at.TraceOptions(effects=(dataclasses.replace(delay, explanation="mine"),))
    (cause,) = at.list_effects("tail_effectiveness")
    with pytest.raises(at.ConfigurationError, match="by a cause"):
        at.TraceOptions(effects=(dataclasses.replace(cause, name="other"),))


@pytest.mark.slow
def test_an_effect_of_the_caller_is_traced(tmp_path: Path) -> None:
    """An arm of 1.6 m was flown (tests/tracing/undeclared_key.toml)."""
    (arm,) = at.list_effects("vane_arm")
    own = dataclasses.replace(arm, name="probe_arm")
    options = at.TraceOptions(model="linear", effects=(own,))
    result = at.trace("data/undeclared/b.parquet", "gtm", options, out=tmp_path)
    (found,) = result.effects
    assert found.name == "probe_arm"
    low, high = found.parameters["x_m"].ci95
    assert low is not None
    assert high is not None
    assert low < 1.6 < high
    assert "Effects: probe_arm." in (tmp_path / "aircraft" / "gtm" / "aircraft.toml").read_text()
    assert "probe_arm" in result.summary()


def test_an_aircraft_prints_a_line() -> None:
    text = repr(at.load_aircraft("gtm"))
    assert "\n" not in text
    assert text.startswith("Aircraft(gtm: mass 26.19 kg")
