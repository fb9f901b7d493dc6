"""Everything that breaks the log contract is refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from airtruth.errors import LogError
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.validate import validate


def complaint(log: FlightLog, **options: int) -> str:
    with pytest.raises(LogError) as caught:
        validate(log, **options)
    return str(caught.value)


def with_channel(log: FlightLog, name: str, row: int | slice, value: float) -> FlightLog:
    values = log.channels[name].copy()
    values[row] = value
    return replace(log, channels={**log.channels, name: values})


def with_time(log: FlightLog, t_s: NDArray[np.float64]) -> FlightLog:
    return replace(log, t_s=t_s)


def without(log: FlightLog, *names: str) -> dict[str, NDArray[np.float64]]:
    return {k: v for k, v in log.channels.items() if k not in names}


def test_a_good_log_passes(log: FlightLog) -> None:
    validate(log)
    validate(replace(log, channels=without(log, "theta_rad", "throttle", "altitude_m", "ax_m_s2")))
    validate(replace(log, channels=without(log, "density_kg_m3")))
    validate(replace(log, metadata={}))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite(log: FlightLog, value: float) -> None:
    message = complaint(with_channel(log, "q_rad_s", slice(42, 44), value))
    assert message == (
        "flight log: 1 problem\n  - q_rad_s: 2 values are NaN or infinite, in 1 run: 'b' (row 12, t 0.24 s); "
        "cut the run there, or leave the channel out if it is optional"
    )


def test_columns_outside_the_vocabulary_are_not_judged(log: FlightLog) -> None:
    validate(replace(log, channels={**log.channels, "gps_fix": np.full(100, np.nan)}))


@pytest.mark.parametrize(
    ("channel", "value", "part"),
    [
        ("airspeed_m_s", 0.0, "airspeed_m_s: not positive in 1 run: 'c' (row 20, t 0.4 s)"),
        ("density_kg_m3", -0.99, "density_kg_m3: not positive"),
    ],
)
def test_implausible_values(log: FlightLog, channel: str, value: float, part: str) -> None:
    assert part in complaint(with_channel(log, channel, 90, value))


def test_missing_channels_name_the_nearest_column(log: FlightLog) -> None:
    channels = {**without(log, "alpha_rad", "az_m_s2", "p_rad_s", "rudder_rad"), "alpha_deg": np.zeros(100)}
    message = complaint(replace(log, channels=channels))
    assert "2 problems" in message
    assert "alpha_rad: required channel is missing (angle of attack, nose-up positive)" in message
    assert "the nearest column is 'alpha_deg'" in message
    assert "az_m_s2: required channel is missing" in message


def test_a_log_of_the_lateral_motion_alone_passes(log: FlightLog) -> None:
    channels = without(log, "alpha_rad", "q_rad_s", "theta_rad", "az_m_s2", "elevator_rad")
    validate(replace(log, channels=channels))
    misspelt = {**channels, "alfa_rad": np.zeros(100)}
    assert "the nearest column is 'alfa_rad'" in complaint(replace(log, channels=misspelt))


def test_a_missing_elevator_names_what_a_mapping_states_of_a_servo_output(log: FlightLog) -> None:
    message = complaint(replace(log, channels=without(log, "elevator_rad", "rudder_rad")))
    assert "a servo output with calibration = [[output, deflection], [output, deflection]]" in message
    assert "elevons with columns and weights, on import" in message


def test_air_data_are_required(log: FlightLog) -> None:
    message = complaint(replace(log, channels=without(log, "density_kg_m3", "altitude_m")))
    assert "density_kg_m3 or altitude_m: one of the two is required" in message


def test_one_run_in_two_parts(log: FlightLog) -> None:
    assert "run_id: 1 run: 'a' in more than one part" in complaint(replace(log, run_ids=("a", "b", "a")))


def test_short_runs(log: FlightLog) -> None:
    message = complaint(log, minimum_samples=35)
    assert "too few samples, below 35, in 2 runs: 'a' (30), 'c' (30)" in message
    one = replace(log, offsets=np.array([0, 1, 1, 100]))
    assert "'a' (1), 'b' (0)" in complaint(one)


def test_gap(log: FlightLog) -> None:
    t = log.t_s.copy()
    t[45:70] += 0.3
    message = complaint(with_time(log, t))
    assert "t_s: 1 gap, the longest 0.32 s, in 1 run: 'b' (row 15, t 0.6 s); split the run" in message
    assert "1 problem\n" in message


def test_time_that_goes_back(log: FlightLog) -> None:
    t = log.t_s.copy()
    t[35:37] = t[36:34:-1]
    assert "t_s: does not increase in 1 run: 'b' (row 6, t 0.1 s); sort by t_s" in complaint(
        with_time(log, t)
    )
    t = log.t_s.copy()
    t[:30] = 0.0
    assert "t_s: does not increase in 1 run: 'a' (row 1" in complaint(with_time(log, t))


def test_unequal_steps(log: FlightLog) -> None:
    t = log.t_s.copy()
    t[80] += 0.003
    assert "t_s: steps differ by more than 1% in 1 run: 'c' (row 10, t 0.203 s)" in complaint(
        with_time(log, t)
    )
    t[80] -= 0.00295
    validate(with_time(log, t))


def test_single_precision_is_named_as_the_cause(log: FlightLog) -> None:
    """float32 resolves 3.9 ms at 36000 s [numpy.spacing], a fifth of a step of 20 ms."""
    late = (log.t_s + 36000.0).astype(np.float32).astype(np.float64)
    message = complaint(with_time(log, late))
    assert "t_s: single precision (float32), which resolves 3.9 ms at 36000.8 s" in message
    assert "write t_s as float64, or start every run at zero" in message
    validate(with_time(log, log.t_s.astype(np.float32).astype(np.float64)))


def test_time_that_is_not_finite(log: FlightLog) -> None:
    t = log.t_s.copy()
    t[80] = np.nan
    assert "t_s: one value is NaN or infinite, in 1 run: 'c' (row 10)" in complaint(with_time(log, t))


def test_sample_rate_of_the_metadata(log: FlightLog) -> None:
    message = complaint(replace(log, metadata={"sample_rate_hz": 200}))
    assert "t_s: not the 200 Hz of the metadata (sample_rate_hz) in 3 runs: 'a' (50 Hz)" in message
    assert "not a positive number" in complaint(replace(log, metadata={"sample_rate_hz": "50"}))


def test_all_problems_at_once(log: FlightLog) -> None:
    t = log.t_s.copy()
    t[45:70] += 0.3
    bad = with_channel(with_time(log, t), "alpha_rad", 3, np.nan)
    bad = replace(bad, channels=without(bad, "elevator_rad", "rudder_rad"), metadata={"sample_rate_hz": 100})
    with pytest.raises(LogError, match=r"^flight-7\.parquet: 4 problems\n") as caught:
        validate(bad, source="flight-7.parquet")
    for part in (
        "elevator_rad: required",
        "1 gap",
        "not the 100 Hz",
        "alpha_rad: one value is",
    ):
        assert part in str(caught.value)


def test_many_bad_runs_are_counted(log: FlightLog) -> None:
    runs, n = 50, 25
    many = FlightLog(
        metadata={},
        run_ids=tuple(f"r{i:02d}" for i in range(runs)),
        offsets=np.arange(runs + 1) * n,
        t_s=np.tile(np.arange(n) / 50, runs),
        channels={name: np.full(runs * n, 0.5) for name in log.channels},
    )
    validate(many)
    message = complaint(with_channel(many, "theta_rad", slice(5, None, n), np.nan))
    assert "50 values are NaN or infinite, in 50 runs: 'r00' (row 5, t 0.1 s), 'r01'" in message
    assert "and 47 more" in message


def test_structure(log: FlightLog) -> None:
    assert "offsets do not divide 100 rows into 3 runs" in complaint(
        replace(log, offsets=np.array([0, 30, 100]))
    )
    assert "theta_rad: shape (99,) where t_s has 100 rows" in complaint(
        replace(log, channels={**log.channels, "theta_rad": np.zeros(99)})
    )
    empty = FlightLog({}, (), np.zeros(1, dtype=np.int64), np.empty(0), {})
    assert "holds no run" in complaint(empty)
    assert "run_id: empty" in complaint(replace(log, run_ids=("", *log.run_ids[1:])))


@pytest.mark.parametrize(
    ("channel", "value"),
    [("alpha_rad", 1e300), ("az_m_s2", -1e155), ("airspeed_m_s", 5e-324), ("density_kg_m3", 1e10)],
)
def test_values_whose_powers_overflow(log: FlightLog, channel: str, value: float) -> None:
    text = complaint(with_channel(log, channel, slice(31, 40), value))
    assert f"{channel}: {value:.3g} is not a plausible measurement, in 1 run: 'b' (row 1, t 0.02 s)" in text
    assert "correct its unit" in text


@pytest.mark.parametrize("factor", [1e-300, 1e-12, 1e12, 1e300])
def test_times_whose_steps_overflow(log: FlightLog, factor: float) -> None:
    assert "t_s: times beyond 1e+09 s or steps below 1e-09 s" in complaint(with_time(log, log.t_s * factor))


def test_rows_out_of_order_are_one_problem(log: FlightLog) -> None:
    """The pieces of a log whose runs alternate are short and have gaps; sorting cures all of it."""
    n = len(log.t_s)
    mixed = replace(log, run_ids=tuple("ab" * (n // 2)), offsets=np.arange(n + 1))
    assert complaint(mixed) == (
        "flight log: 1 problem\n  - run_id: 2 runs: 'a', 'b' in more than one part; sort by run_id and t_s, or rename the "
        "runs"
    )
