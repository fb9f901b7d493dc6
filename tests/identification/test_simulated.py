"""Records beside identified models: against an independent integrator, and what is fitted to each record."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from airtruth.errors import LogError
from airtruth.identification import identify
from airtruth.identification.simulated import MOST_RECORDS, simulate, simulated_records
from airtruth.logs.store import write_log
from airtruth.physics.short_period import normal_force_row, scale, system
from validation.linear_flight import GTM, as_log, fly

THETA = np.array([4.79, 31.0, 0.48, -1.785, -41.4, -1.787])
SCALE = scale(0.5483, 0.27898, 26.195, 6.314, 42.85, 0.9931)
DT_S = 0.02
TIME = DT_S * np.arange(251)
ELEVATOR = 0.01 + np.interp(
    TIME, [0.0, 1.0, 1.1, 1.5, 1.7, 2.1, 2.2], [0.0, 0.0, 0.03, 0.03, -0.03, -0.03, 0.0]
)
LOG = as_log(fly(runs=3, gust=1.0, noise=1.0, seed=71))


def flown(start, constant, offset, theta=THETA):
    """(samples, 3) by an adaptive Runge-Kutta integrator of the equations of motion."""
    a, b = system(theta, SCALE)

    def slope(t, x):
        return a @ x + b * np.interp(t, TIME, ELEVATOR - ELEVATOR[0]) + constant

    x = solve_ivp(slope, (0.0, TIME[-1]), start, t_eval=TIME, rtol=1e-10, atol=1e-13, max_step=0.01).y.T
    row = normal_force_row(theta, SCALE)
    az = x @ row[:2] + row[2] * (ELEVATOR - ELEVATOR[0]) + offset
    return np.column_stack([x, az])


@pytest.mark.parametrize("start", [(0.0, 0.0), (0.08, -0.1)])
def test_the_true_derivatives_give_the_flight_with_any_trim(start):
    measured = flown(start, np.array([0.02, -0.3]), -9.81)
    found = simulate(THETA, SCALE, DT_S, ELEVATOR, measured)
    np.testing.assert_allclose(found, measured, rtol=0.0, atol=1e-7)


def test_a_wrong_derivative_leaves_a_residual_that_no_trim_takes():
    measured = flown((0.05, 0.0), np.zeros(2), -9.81)
    wrong = THETA * np.array([1.0, 1.0, 1.0, 1.2, 1.0, 1.0])
    residual = measured - simulate(wrong, SCALE, DT_S, ELEVATOR, measured)
    assert np.sqrt(np.mean(residual[:, 1] ** 2)) > 0.05 * measured[:, 1].std()
    # the fit is a least-squares fit: its residual is orthogonal to a constant of az
    assert residual[:, 2].mean() == pytest.approx(0.0, abs=1e-9)


def test_a_motion_that_diverges_is_no_number():
    theta = THETA * np.array([1.0, 1.0, 1.0, -1e4, 1.0, 1.0])
    assert np.isnan(simulate(theta, SCALE, DT_S, ELEVATOR, flown((0.0, 0.0), np.zeros(2), 0.0))).all()


def test_a_result_holds_the_records_of_its_logs(tmp_path):
    write_log(tmp_path / "log.parquet", LOG, dtype="float64")
    in_memory, read = identify(LOG, GTM, ["ls", "iv-f1"]), identify(tmp_path, GTM, ["ls", "iv-f1"])
    for own in (in_memory, read):
        shown = own.histories()
        assert [r.run_id for r in shown.records] == list(LOG.run_ids)
        assert shown.models == ("ls", "iv-f1")
        for k, r in enumerate(shown.records):
            rows = LOG.rows(k)
            np.testing.assert_array_equal(r.measured["q_rad_s"], LOG.channels["q_rad_s"][rows])
            assert r.rms("iv-f1", "q_rad_s") < 0.2 * r.measured["q_rad_s"].std()


def test_a_joint_estimate_simulates_every_run():
    shown = identify(LOG, GTM, ["ls"], joint=True).histories()
    assert [r.run_id for r in shown.records] == list(LOG.run_ids)
    assert all(np.isfinite(r.models["ls"]["alpha_rad"]).all() for r in shown.records)


def test_a_run_without_an_estimate_has_no_simulation():
    table = identify(LOG, GTM, ["ls"]).to_frame()
    table.loc[0, "Cmq"] = np.nan
    first, second, _ = simulated_records(LOG, table, GTM).records
    assert np.isnan(first.models["ls"]["q_rad_s"]).all()
    assert np.isfinite(second.models["ls"]["q_rad_s"]).all()


def test_many_runs_are_thinned_evenly():
    many = as_log(fly(runs=2 * MOST_RECORDS + 1, gust=0.0, noise=0.1, seed=3))
    shown = identify(many, GTM, ["ls"]).histories()
    assert shown.of_records == len(many)
    assert [r.run_id for r in shown.records][:: MOST_RECORDS - 1] == [many.run_ids[0], many.run_ids[-1]]
    assert len(shown.records) == MOST_RECORDS


def test_a_log_of_other_runs_is_an_error():
    table = identify(LOG, GTM, ["ls"]).to_frame().assign(run_id=["x", "y", "z"])
    with pytest.raises(LogError, match="no run 'x'"):
        simulated_records(LOG, table, GTM)
