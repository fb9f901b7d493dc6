"""The loop closes: the same records traced against the updated aircraft lack nothing more."""

import shutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trace_flights as tf
import trace_records as tr
from tiers import sampled

from airtruth import aircraft as planes
from airtruth.aircraft import Sensor
from airtruth.errors import StoreError
from airtruth.quantity import Quantity
from airtruth.tracing import TraceOptions, trace
from airtruth.tracing.model.parameters import SHORT_PERIOD
from airtruth.tracing.model.records import FINE
from airtruth.tracing.prepare import undo_input_sensors
from airtruth.tracing.replay import disagreement
from airtruth.tracing.stage_errors import MOST_RECORDS, Replay

pytestmark = pytest.mark.slow

FEW = ("elevator_delay", "gyro_lag", "vane_scale")
FLOWN = {
    "elevator_delay": {"delay_s": 0.06},
    "rate_limit": {"rate_rad_s": 0.3},
    "downwash_lag": {"Cmalphadot": -30.0},
    "lift_lag": {"dCLalpha": 2.0, "tau_s": 0.2},
    "elastic_mode": {"dCmalpha": 0.5, "frequency_hz": 3.0, "damping": 0.05},
    "airspeed_scale": {"factor": 1.15},
    "cm_alpha_nonlinear:break": {"dCmalpha": -0.6, "at_alpha_rad": 0.09},
}


@pytest.mark.parametrize("key", sampled(FLOWN, 8))
def test_what_was_added_is_not_traced_again(key, tmp_path):
    flown = tf.fly(tmp_path, [(key, FLOWN[key])], runs=6)
    options = TraceOptions(effects=tuple({key, *FEW}))
    first = trace([flown], "gtm", options, tmp_path / "first").to_dict()
    name = key.partition(":")[0]
    assert name in {e["name"] for e in first["effects"]} | set(first["effects"][0]["indistinguishable_from"])
    again = trace([flown], first["updated_aircraft"], options, tmp_path / "again").to_dict()
    assert again["effects"] == []
    # the declared aircraft of the second trace is the updated one of the first, in the filter as in JSBSim
    for channel in again["error"]["channels"]:
        after = first["error"]["after"]["held_out"]["innovation"][channel]
        assert again["error"]["declared"]["held_out"]["innovation"][channel] == pytest.approx(after, rel=0.1)
        updated, declared = first["replay"]["updated"][channel], again["replay"]["declared"][channel]
        assert declared == pytest.approx(updated, rel=0.02)  # the weights of its initial state differ


@pytest.fixture(scope="module")
def late(tmp_path_factory):
    return tf.fly(tmp_path_factory.mktemp("late"), [("vane_lag", {"tau_s": 0.03})])


OPTIONS = TraceOptions(effects=("vane_lag",))


@pytest.mark.long
def test_an_earlier_update_is_replaced(late, tmp_path):
    first = trace([late], "gtm", OPTIONS, tmp_path).to_dict()
    (tmp_path / "aircraft" / "gtm" / "stale.xml").write_text("of the earlier one")
    again = trace([late], "gtm", OPTIONS, tmp_path).to_dict()
    assert again["updated_aircraft"] == first["updated_aircraft"]
    assert not (tmp_path / "aircraft" / "gtm" / "stale.xml").exists()
    assert sorted(p.name for p in (tmp_path / "aircraft").iterdir()) == ["gtm"]
    # and none is left where nothing is missing any more
    (tmp_path / "kept").mkdir()
    moved = shutil.move(first["updated_aircraft"], tmp_path / "kept" / "gtm")
    shutil.copytree(moved, tmp_path / "aircraft" / "gtm")
    assert trace(late, moved, OPTIONS, tmp_path).answer.updated_aircraft is None
    assert not (tmp_path / "aircraft" / "gtm").exists()


@pytest.mark.parametrize("where", ["itself", "inside", "around", "notes"])
def test_nothing_of_the_user_s_is_replaced(late, where, tmp_path):
    """The declared aircraft, a folder in it or around it, or one that no trace has written."""
    plane = tmp_path / "aircraft" / "gtm"
    shutil.copytree(planes.load("gtm").folder, plane)
    out, declared = tmp_path, plane
    if where == "inside":
        out = plane / "out"
    elif where == "around":
        declared = shutil.copytree(plane, plane / "mine" / "gtm")
    elif where == "notes":
        declared = shutil.copytree(plane, tmp_path / "declared" / "gtm")
        shutil.rmtree(plane)
        plane.mkdir()
        (plane / "notes.txt").write_text("mine")
    before = sorted(str(p) for p in tmp_path.rglob("*"))
    told = []
    with pytest.raises(StoreError, match="choose another --out"):
        trace(late, declared, OPTIONS, out, advance=told.append)
    assert told == []  # before the search
    assert sorted(str(p) for p in tmp_path.rglob("*")) == before


def test_declared_errors_of_the_inputs_are_undone():
    """A ramp, late by 40 ms, scaled and biased, as its sensor is declared: the ramp again, but for its last 40 ms."""
    gtm = planes.load("gtm")
    declared = Sensor(
        scale=Quantity(value=1.2),
        bias=Quantity(value=0.01),
        lag=Quantity(value=0.03),
        delay=Quantity(value=0.01),
    )
    sensors = gtm.file.sensors | {"elevator_rad": declared, "airspeed_m_s": declared}
    plane = gtm.model_copy(update={"file": gtm.file.model_copy(update={"sensors": sensors})})
    one = tr.record(np.zeros((100, 3)), np.zeros_like).signals
    cells = one.sub * FINE
    t = np.arange(99 * cells + 1) / cells * one.dt_s
    coarse = t[::FINE]
    seen = replace(
        one,
        controls_rad=(1.2 * (0.3 * (t - 0.04)) + 0.01)[None],
        airspeed_m_s=1.2 * (40.0 + coarse - 0.04) + 0.01,
        ground_m_s=1.2 * (41.0 + coarse - 0.04) + 0.01,
    )
    found = undo_input_sensors(seen, plane)
    inside = t < t[-1] - 0.041
    np.testing.assert_allclose(found.elevator_rad[inside], 0.3 * t[inside], atol=1e-12)
    inside = coarse < t[-1] - 0.041
    np.testing.assert_allclose(found.airspeed_m_s[inside], 40.0 + coarse[inside], rtol=1e-12)
    np.testing.assert_allclose(found.ground_m_s[inside], 41.0 + coarse[inside], rtol=1e-12)
    none = plane.model_copy(update={"file": gtm.file.model_copy(update={"sensors": {}})})
    np.testing.assert_array_equal(undo_input_sensors(seen, none).elevator_rad, seen.elevator_rad)


class Assessed:
    """Assessed stages: the filter's free runs of the declared aircraft, one per record."""

    def __init__(self, *free_runs):
        own = [SimpleNamespace(free_run=np.array(rms)) for rms in free_runs]
        self.reported = (None, {"declared": own})
        self.case = SimpleNamespace(fitted=SimpleNamespace(layout=SHORT_PERIOD))


def test_a_model_that_moves_otherwise_than_at_rest_is_said():
    """c172x has alpha-dot terms and a servo with play that aircraft.toml does not declare (measured: q 1.31)."""
    stages = Assessed((0.01, 0.02, 0.3))
    (note,) = disagreement(Replay(declared={"alpha_rad": 0.0096, "q_rad_s": 0.0262}), stages)
    assert "q_rad_s 1.31" in note
    assert "[dynamics]" in note
    assert "alpha_rad" not in note
    assert disagreement(Replay(declared={"alpha_rad": 0.01, "q_rad_s": 0.02}), stages) == []
    assert disagreement(Replay(), stages) == []


def test_the_filter_is_compared_on_the_records_that_are_flown_again():
    """A seventh record with a noisy gyro is not flown again, and does not count."""
    stages = Assessed(*[(0.01, 0.02, 0.3)] * MOST_RECORDS, (0.01, 0.2, 0.3))
    assert disagreement(Replay(declared={"alpha_rad": 0.01, "q_rad_s": 0.02}), stages) == []
