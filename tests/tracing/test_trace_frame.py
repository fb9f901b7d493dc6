"""What surrounds the search: order of the logs, names of records, angles of the linear model, files of an interrupted trace."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trace_records as tr

from airtruth import aircraft as planes
from airtruth.effects.registry import EFFECTS
from airtruth.logs.store import read_log
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.accepted import ParameterEstimate
from airtruth.tracing.intervals import at_measured_alpha
from airtruth.tracing.prepare import prepare
from airtruth.units import G0

LOG = Path(__file__).parents[2] / "data" / "undeclared" / "b.parquet"
DERIVATIVES = np.array([4.787, 31.7, 0.48, -1.785, -41.2, -1.787])


def each_record():
    log = read_log(LOG)
    return [log.select([name]) for name in log.run_ids]


def test_the_held_out_records_do_not_depend_on_the_order_of_the_logs():
    gtm, options = planes.load("gtm"), TraceOptions(model="linear")
    logs = each_record()
    held = [
        [r.signals.run_id for r in prepare(order, gtm, (), options).held.records]
        for order in (logs, logs[::-1])
    ]
    assert held[0] == held[1] == ["r3", "r6"]


def test_a_single_record_is_one_record_in_two_parts():
    case = prepare(each_record()[:1], planes.load("gtm"), (), TraceOptions(model="linear"))
    assert [r.signals.record for r in case.fitted.records] == ["r1", "r1"]
    assert len({r.signals.run_id for r in case.fitted.records}) == 2


def test_the_curves_of_the_linear_model_are_those_of_its_derivatives():
    """At its trim: lift equals weight, no moment; slopes CLalpha, Cmalpha, CLde and Cmde."""
    gtm = planes.load("gtm")
    plant = tr.plant(DERIVATIVES, 0.1, 0.01, 43.0)
    c = gtm.constants
    alpha, forces = plant.along("alpha")
    lift = -forces[:, 1] / c.wing_area_m2
    moment = forces[:, 2] / (c.wing_area_m2 * c.chord_m)
    weight = c.mass_kg * G0 / (0.5 * tr.DENSITY * 43.0**2 * c.wing_area_m2)
    np.testing.assert_allclose(np.interp(0.0, alpha, lift), weight, rtol=1e-12)
    np.testing.assert_allclose(np.interp(0.0, alpha, moment), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.diff(lift) / np.diff(alpha), DERIVATIVES[0])
    np.testing.assert_allclose(np.diff(moment) / np.diff(alpha), DERIVATIVES[3])
    elevator, forces = plant.along("elevator")
    across = forces[:, 2] / (c.wing_area_m2 * c.chord_m)
    np.testing.assert_allclose(np.diff(across) / np.diff(elevator), DERIVATIVES[5])


def test_angles_of_the_linear_model_are_stated_from_zero():
    stated = {
        "dCmalpha": ParameterEstimate(0.5, 0.1, (0.3, 0.7)),
        "at_alpha_rad": ParameterEstimate(0.002, 0.001, (0.0, None)),
    }
    moved = at_measured_alpha(EFFECTS["cm_alpha_nonlinear:break"], stated, 0.1)
    assert moved["dCmalpha"] == stated["dCmalpha"]
    assert moved["at_alpha_rad"] == replace(stated["at_alpha_rad"], value=0.002 + 0.1, ci95=(0.1, None))


@pytest.mark.slow
def test_an_interrupted_trace_leaves_no_answer(tmp_path, monkeypatch):
    def stop(*_):
        raise KeyboardInterrupt

    (tmp_path / "trace.json").write_text("{}")
    monkeypatch.setattr("airtruth.tracing.presentation.files.write_evidence", stop)
    with pytest.raises(KeyboardInterrupt):
        trace(LOG, "gtm", TraceOptions(effects=("vane_arm",), model="linear"), tmp_path)
    assert not (tmp_path / "trace.json").exists()
