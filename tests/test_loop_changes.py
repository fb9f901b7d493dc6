"""Differences of a loop from the same method on simulated records: means, errors and sentences by hand."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from airtruth.errors import LogError
from airtruth.identification import Options
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.histories import Histories, History
from airtruth.loop import loop_table
from airtruth.loop.changes import changes_of, quantile
from airtruth.loop.same_inputs import identifiable, inputs_of, simulated_logs
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.table import as_text
from airtruth.tracing.answer import Derivatives

DECLARED = dict.fromkeys(LONGITUDINAL.parameters, -2.0)
REFIT = Derivatives(
    DECLARED,
    DECLARED,
    dict.fromkeys(LONGITUDINAL.parameters, -1.8),
    dict.fromkeys(LONGITUDINAL.parameters, 0.01),
)


def estimates(values, converged=(True, True, True)):
    rows = [
        {"run_id": f"r{k}", "method": "ls", "converged": good}
        | dict.fromkeys(LONGITUDINAL.parameters, value)
        | {f"{name}_std": 0.05 for name in LONGITUDINAL.parameters}
        for k, (value, good) in enumerate(zip(values, converged, strict=False))
    ]
    return SimpleNamespace(methods=("ls",), to_frame=lambda: pd.DataFrame(rows))


def changes(after, declared, corrected=(-1.5, -1.6, -1.7)):
    simulated = {
        "declared": None if declared is None else estimates(declared),
        "corrected": None if corrected is None else estimates(corrected),
    }
    return changes_of(estimates((-1.0, -1.1, -1.2)), after, DECLARED, simulated)


@pytest.mark.parametrize(("runs", "half"), [(1, 1.959964), (6, 2.570582), (30, 2.045230)])
def test_quantiles_of_student(runs, half):
    """Tables of Student's t at 97.5 % for 5 and 29 degrees of freedom; the normal distribution for one run."""
    assert quantile(runs) == pytest.approx(half, abs=1e-6)


def test_differences_are_paired_by_run():
    """After less declared is 0.20, 0.22, 0.18: mean 0.20, standard error 0.02/sqrt(3)."""
    first = changes(estimates((-1.50, -1.58, -1.72)), (-1.70, -1.80, -1.90))[0]
    assert first.difference == pytest.approx(0.20)
    assert first.difference_error == pytest.approx(0.02 / np.sqrt(3.0))
    low, high = first.interval
    assert (low, high) == pytest.approx(
        (0.20 - 4.302653 * 0.02 / 3**0.5, 0.20 + 4.302653 * 0.02 / 3**0.5), rel=1e-6
    )
    assert first.differs
    assert first.declared_same_inputs == pytest.approx(-1.80)
    assert first.remaining == pytest.approx(0.0)
    assert not first.remains


def test_only_runs_that_every_estimate_has_are_compared():
    first = changes(estimates((-1.5, -9.0, -1.7), (True, False, True)), (-1.5, -1.6, -1.7))[0]
    assert (first.runs_after, first.runs_compared) == (2, 2)
    assert first.difference == pytest.approx(0.0)
    assert first.declared_same_inputs == pytest.approx(-1.6)


def test_a_single_run_has_the_error_of_its_method():
    first = changes(estimates((-1.5,)), (-1.7,), (-1.5,))[0]
    assert first.difference_error == 0.05
    assert first.interval == pytest.approx((0.2 - 1.959964 * 0.05, 0.2 + 1.959964 * 0.05), rel=1e-6)


def words(*given, **more):
    return " ".join(as_text(loop_table(changes(*given, **more), (), REFIT)).split())


def test_sentences_tell_aircraft_and_method_apart():
    """Declared and corrected models differ by 0.2, which is the share of the refit."""
    aircraft = words(estimates((-1.50, -1.61, -1.69)), (-1.70, -1.80, -1.90))
    assert "CLalpha by ls (0.20, refit 0.20)" in aircraft
    assert "the trace refits CLalpha from -2.000 to -1.800" in aircraft
    assert "The rest exceeds" not in aircraft
    method = words(estimates((-1.00, -1.11, -1.19)), (-1.70, -1.80, -1.90))
    assert "CLalpha by ls (0.70, refit 0.20)" in method
    assert "The rest exceeds its 95 % interval in CLalpha by ls; CLq by ls;" in method
    assert "No derivative after differs" in words(estimates((-1.69, -1.80, -1.91)), (-1.70, -1.80, -1.90))


def test_without_simulations_the_columns_are_empty():
    text = words(estimates((-1.5, -1.6, -1.7)), None, corrected=None)
    assert "No record was simulated whole" in text
    assert "Still different" not in text


def test_simulated_records_have_measured_inputs_and_simulated_outputs():
    """Runs that were not simulated whole are left out, and so are channels of the measured motion."""
    t = np.arange(4) * 0.02
    channels = {"alpha_rad": np.ones(12), "theta_rad": np.ones(12), "elevator_rad": np.arange(12.0)}
    log = FlightLog({}, ("a", "b", "c"), np.array([0, 4, 8, 12]), np.tile(t, 3), channels)

    def record(name, y):
        flown = {"declared": {"alpha_rad": np.asarray(y, dtype=float)}}
        return History(name, "fitted", t, {"elevator_rad": t}, {"alpha_rad": t}, flown)

    records = (record("c", (5, 6, 7, 8)), record("a", (1, 2)), record("b", (1, 2, 3, np.nan)))
    (only,) = simulated_logs([log], Histories(records, ("declared",), "c", 3), "declared")
    assert only.run_ids == ("c",)
    assert list(only.channels) == ["elevator_rad", "alpha_rad"]
    assert only.channels["alpha_rad"].tolist() == [5.0, 6.0, 7.0, 8.0]
    assert only.channels["elevator_rad"].tolist() == [8.0, 9.0, 10.0, 11.0]


def test_a_lateral_simulation_has_the_channels_that_every_log_needs():
    """A log without the elevator and the vertical acceleration breaks the log contract, and has no estimate."""
    inputs = inputs_of(LATERAL)
    assert {"elevator_rad", "az_m_s2", "alpha_rad", "q_rad_s", "aileron_rad", "rudder_rad"} <= set(inputs)
    assert not {output.channel for output in LATERAL.outputs} & set(inputs)
    assert not {"az_m_s2", "alpha_rad", "q_rad_s", "theta_rad"} & set(inputs_of(LONGITUDINAL))


def test_a_simulation_that_does_not_move_is_left_out_and_a_lacking_channel_is_an_error():
    """Only the first of two lateral records moves; without the yaw rate there is one clear error instead of an empty column."""
    t = np.arange(400) * 0.02
    moving = np.concatenate([np.sin(2.0 * t), np.zeros(400)])
    channels = dict.fromkeys((*LATERAL.required, "phi_rad"), moving)
    log = FlightLog({}, ("moves", "rests"), np.array([0, 400, 800]), np.tile(t, 2), channels)
    (only,) = identifiable([log], Options(), LATERAL)
    assert only.run_ids == ("moves",)
    assert identifiable([log.select(["rests"])], Options(), LATERAL) == []
    lacking = log.select(None, [name for name in channels if name != "r_rad_s"])
    with pytest.raises(LogError, match="the lateral motion needs the channel r_rad_s"):
        identifiable([lacking], Options(), LATERAL)
