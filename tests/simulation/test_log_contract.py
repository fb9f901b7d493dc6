"""What a campaign writes: the log contract and the folder of the command line's contract."""

import json

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from fly_campaigns import fly, read
from tiers import sampled

COLUMNS = [
    "run_id", "t_s", "airspeed_m_s", "alpha_rad", "theta_rad", "q_rad_s", "ax_m_s2", "az_m_s2",
    "elevator_rad", "elevator_command_rad", "throttle", "altitude_m", "density_kg_m3",
]  # fmt: skip
FORBIDDEN = ("gust", "turbulence", "dryden", "truth", "sigma", "noise", "seed", "wind", "light")
NAMES = {"CLalpha", "CLq", "CLde", "Cmalpha", "Cmq", "Cmde", "wn_rad_s", "zeta"}


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return fly(tmp_path_factory.mktemp("contract"), runs=35, duration_s=2.0, gust={"level": "light"})


@pytest.fixture(scope="module")
def files(out):
    return sorted((out / "logs").glob("*.parquet"))


@pytest.mark.slow
def test_folder_holds_the_files_of_the_contract(out):
    assert {p.name for p in out.iterdir()} >= {"logs", "plan.parquet", "truth.parquet", "manifest.jsonl"}
    assert all(p.suffix == ".parquet" for p in (out / "logs").iterdir())


@pytest.mark.slow
def test_columns_and_types(files):
    assert files
    for path in files:
        schema = pq.read_schema(path)
        assert schema.names == COLUMNS
        assert schema.field("run_id").type == pa.string()
        assert schema.field("t_s").type == pa.float64()
        assert {schema.field(n).type for n in COLUMNS[2:]} <= {pa.float32(), pa.float64()}


def test_rows_are_sorted_by_run_and_time_within_and_across_files(out, files):
    log = read(out)
    assert len(files) > 1
    assert log["run_id"].nunique() == 35
    pd.testing.assert_frame_equal(log, log.sort_values(["run_id", "t_s"], kind="stable", ignore_index=True))
    time = log["t_s"].to_numpy().reshape(35, -1)
    np.testing.assert_array_equal(time, np.broadcast_to(np.arange(101) / 50.0, (35, 101)))
    assert not log.isna().to_numpy().any()


@pytest.mark.slow
def test_metadata_says_what_is_logged_and_nothing_of_gusts_or_truth(files):
    assert files
    for path in files:
        raw = pq.read_schema(path).metadata
        said = json.loads(raw[b"airtruth"])
        assert said == {"schema": 1, "aircraft": "gtm", "sample_rate_hz": 50}
        everything = (repr(raw) + repr(pq.read_schema(path))).lower().replace("airtruth", "")
        assert not [word for word in FORBIDDEN if word in everything]


@pytest.mark.slow
def test_signs_and_units_of_a_pulse(tmp_path):
    """Trailing edge down pitches the nose down; in level flight az is -g cos(theta) at first."""
    pulse = {"kind": "pulse", "amplitude_deg": 2.0, "start_s": 0.5, "step_s": 0.5}
    log = read(fly(tmp_path, runs=1, gust=None, sensors={"ideal": True}, manoeuvre=[pulse]))
    during = log[(log["t_s"] > 0.6) & (log["t_s"] < 0.8)]
    assert (during["elevator_rad"] > log["elevator_rad"].iloc[0] + 0.02).all()
    assert (during["q_rad_s"] < 0.0).all()
    assert log["az_m_s2"].iloc[0] == pytest.approx(-9.80665 * np.cos(log["theta_rad"].iloc[0]), rel=1e-3)
    # ISO 2533: 2133.6 m geometric are 2132.88 m geopotential; density 0.99311 kg/m3 (US Standard Atmosphere 1976).
    assert log["altitude_m"].iloc[0] == pytest.approx(2132.88, abs=0.01)
    assert log["density_kg_m3"].iloc[0] == pytest.approx(0.99311, rel=2e-5)
    # EAS 75 kt at that density.
    assert log["airspeed_m_s"].iloc[0] == pytest.approx(75 * 1852 / 3600 * np.sqrt(1.225 / 0.99311), rel=2e-5)


def test_plan_and_truth_have_a_row_per_run(out):
    plan, truth = (pd.read_parquet(out / f"{name}.parquet") for name in ("plan", "truth"))
    assert list(plan["run_id"]) == list(truth["run_id"]) == [f"small-{k:06d}" for k in range(35)]
    assert set(truth.columns) >= NAMES
    assert (truth["status"] == "ok").all()
    # M. Brunot's paper, Table 1: true values at this condition.
    paper = {"CLalpha": 4.793, "CLq": 30.79, "CLde": 0.480, "Cmalpha": -1.789, "Cmq": -41.41, "Cmde": -1.787}
    for name, value in paper.items():
        np.testing.assert_allclose(truth[name], value, rtol=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("simulation_hz", "log_hz"), sampled([(100.0, 25.0), (200.0, 200.0), (400.0, 50.0)], 3)
)
def test_rates_are_free(tmp_path, simulation_hz, log_hz):
    log = read(fly(tmp_path, runs=1, simulation_hz=simulation_hz, log_hz=log_hz, duration_s=2.0))
    np.testing.assert_allclose(log["t_s"], np.arange(2.0 * log_hz + 1) / log_hz, atol=1e-12)


@pytest.mark.slow
def test_logs_are_every_fourth_sample_without_a_filter(tmp_path):
    """White noise and all: 50 Hz logs are those at 200 Hz, picked."""
    fine = read(fly(tmp_path / "fine", runs=1, log_hz=200.0)).iloc[::4].reset_index(drop=True)
    pd.testing.assert_frame_equal(read(fly(tmp_path / "coarse", runs=1)), fine, check_exact=True)
