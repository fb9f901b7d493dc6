"""[[effect]] tables of a campaign: flown, stated in plan and truth, and nowhere in the logs."""

import gc
import json

import fly_campaigns as campaigns
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from airtruth.effects.registry import stated
from airtruth.errors import ConfigurationError
from airtruth.logs import store
from airtruth.simulation.campaign import plan

pytestmark = pytest.mark.slow

LATE = {"name": "elevator_delay", "delay_ms": 60}
QUIET = {"gust": {"level": "none"}, "sensors": {"ideal": True}, "runs": 1}


def logs(out):
    return {p.name: p.read_bytes() for p in store.log_paths(out)}


@pytest.mark.long
@pytest.mark.parametrize(
    "neutral",
    [
        {"name": "elevator_delay", "delay_s": 0.0},
        {"name": "actuator_lag", "bandwidth_hz": float("inf")},
        {"name": "downwash_lag", "Cmalphadot": 0.0},
        {"name": "gust_level", "factor": 1.0},
        {"name": "vane_scale", "factor": 1},
        {"name": "cm_alpha_nonlinear", "variant": "break", "dCmalpha": 0, "at_alpha_deg": 5},
    ],
    ids=lambda table: table["name"],
)
def test_neutral_effect_leaves_the_logs_as_they_are(tmp_path, neutral):
    plain = campaigns.fly(tmp_path / "plain")
    out = campaigns.fly(tmp_path / "neutral", effect=[neutral])
    assert logs(out) == logs(plain)


def test_effect_is_stated_in_plan_and_truth_alone(tmp_path):
    out = campaigns.fly(tmp_path, effect=[LATE, {"name": "vane_bias", "value_deg": 1.0}])
    for name in ("plan.parquet", "truth.parquet"):
        said = [json.loads(text) for text in pd.read_parquet(out / name)["effects"]]
        assert all(s[0]["name"] == "elevator_delay" for s in said)
        assert said[0][0]["parameters"] == {"delay_s": pytest.approx(0.06)}
        assert said[0][1]["parameters"] == {"value": pytest.approx(np.deg2rad(1.0))}
    for path in store.log_paths(out):
        assert b"delay" not in path.read_bytes()
        assert b"effect" not in b"".join(pq.read_schema(path).metadata.values())
    assert "effects" not in pd.read_parquet(campaigns.fly(tmp_path / "plain") / "plan.parquet")


def test_delay_shifts_the_response_and_not_the_measured_surface(tmp_path):
    plain = campaigns.fly(tmp_path / "plain", **QUIET)
    late = campaigns.fly(tmp_path / "late", effect=[LATE], **QUIET)
    np.testing.assert_array_equal(
        campaigns.channel(late, "elevator_rad"), campaigns.channel(plain, "elevator_rad")
    )
    shift = 3  # 60 ms at 50 Hz
    for name in ("q_rad_s", "alpha_rad"):
        before, after = campaigns.channel(plain, name), campaigns.channel(late, name)
        # the trim's residual of 1e-11 moves the aircraft by some 1e-9 meanwhile
        np.testing.assert_allclose(after[:, shift:], before[:, :-shift], rtol=0, atol=1e-8)


@pytest.mark.long
def test_effects_are_the_same_over_processes(tmp_path):
    effects = [LATE, {"name": "mass_error", "factor": 1.05}]
    alone = campaigns.fly(tmp_path / "alone", effect=effects)
    shared = campaigns.fly(tmp_path / "shared", jobs=2, effect=effects)
    assert campaigns.results(alone) == campaigns.results(shared)


def test_sensor_effect_comes_on_top_of_the_campaigns_sensors(tmp_path):
    plain = campaigns.fly(tmp_path / "plain")
    off = campaigns.fly(tmp_path / "off", effect=[{"name": "accelerometer_bias", "value_g": 0.01}])
    moved = campaigns.channel(off, "az_m_s2") - campaigns.channel(plain, "az_m_s2")
    np.testing.assert_allclose(moved, 0.01 * 9.80665, rtol=2e-4)  # logs are float32
    np.testing.assert_array_equal(campaigns.channel(off, "q_rad_s"), campaigns.channel(plain, "q_rad_s"))


@pytest.mark.parametrize(("name", "levels"), [("horizontal_gust", (2.0, 1.0)), ("gust_level", (2.0, 2.0))])
def test_effect_in_the_air_multiplies_its_levels(tmp_path, name, levels):
    plain = pd.read_parquet(campaigns.fly(tmp_path / "plain") / "truth.parquet")
    out = campaigns.fly(tmp_path / "rough", effect=[{"name": name, "factor": 2}])
    rough = pd.read_parquet(out / "truth.parquet")
    for column, factor in zip(("sigma_u_m_s", "sigma_w_m_s"), levels, strict=True):
        np.testing.assert_array_equal(rough[column], factor * plain[column])


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_factors_on_one_gust_multiply_in_any_order(tmp_path, order):
    both = [{"name": "horizontal_gust", "factor": 0.0}, {"name": "gust_level", "factor": 2.0}]
    plain = plan.make(campaigns.write(tmp_path / "p.toml")).table
    made = plan.make(campaigns.write(tmp_path / "c.toml", effect=[both[k] for k in order])).table
    np.testing.assert_array_equal(made["sigma_u_m_s"], 0.0)
    np.testing.assert_array_equal(made["sigma_w_m_s"], 2.0 * plain["sigma_w_m_s"])


def test_dry_run_names_the_effects_and_the_copy_goes_with_its_plan(tmp_path):
    made = plan.make(campaigns.write(tmp_path / "c.toml", effect=[LATE]))
    assert "elevator_delay delay_s = 0.06" in plan.describe(made)
    folder = made.aircraft.folder
    assert folder.is_dir()
    del made
    gc.collect()
    assert not folder.exists()


def test_a_channel_names_the_effect_of_the_pitch_plane_too():
    effect, values = stated({"name": "vane_lag", "channel": "alpha_rad", "tau_s": 0.02})
    assert (effect.key, values) == ("vane_lag", {"tau_s": 0.02})


@pytest.mark.parametrize(
    ("effect", "said"),
    [
        ({"name": "elevator_dely", "delay_s": 0.1}, "did you mean 'elevator_delay'"),
        ({"name": "elevator_delay", "delay_mm": 1}, "did you mean 'delay_ms'"),
        ({"name": "elevator_delay"}, "delay_s is missing"),
        ({"name": "elevator_delay", "delay_s": 3.0}, "outside its range of 0 to 0.2 s"),
        ({"name": "rate_limit", "rate_rad_s": 99.0}, "outside its range of 0.1 to 20 rad/s"),
        ({"name": "elevator_delay", "delay_s": 0.1, "delay_ms": 100}, "given twice"),
        ({"name": "elevator_delay", "delay_s": "long"}, "has to be a number"),
        ({"name": "cm_alpha_nonlinear"}, "state its variant; allowed: break, quadratic"),
        (
            {"name": "cm_alpha_nonlinear", "dCmalpha": 0.5, "Cmalpha2": 1.0},
            "state its variant; allowed: break, quadratic",
        ),
        ({"name": "cm_alpha_nonlinear", "dCmalpha": 0.5}, "at_alpha_rad is missing"),
        (
            {"name": "sensor_delay", "delay_s": 0.02},
            "state its variant; allowed: aileron_rad, alpha_rad, ay_m_s2, az_m_s2, beta_rad, elevator_rad, p_rad_s, phi_rad, "
            "q_rad_s, r_rad_s, rudder_rad",
        ),
        ({"name": "sensor_delay", "channel": "q_rads", "delay_s": 0.02}, "did you mean 'q_rad_s'"),
        (
            {"name": "sensor_delay", "variant": "alpha_rad", "channel": "q_rad_s", "delay_s": 0.02},
            "name two variants; state one",
        ),
        ({"name": "vane_lag", "channel": "az_m_s2", "tau_s": 0.02}, "allowed: beta_rad"),
        ({"name": "elevator_delay", "channel": "alpha_rad", "delay_s": 0.02}, "'channel' is not a parameter"),
        ({"name": "cm_alpha_nonlinear", "variant": "brake", "dCmalpha": 1}, "did you mean 'break'"),
        ({"name": "elevator_delay", "variant": "x", "delay_s": 0.1}, "has no variants"),
        ({"variant": "x"}, "effect.0.name"),
        ({"name": "elevator_delay", "parameters": {"delay_s": -0.5}}, "outside its range of 0 to 0.2 s"),
        ({"name": "cg_shift", "parameters": {"dx_mac": 0.9}}, "outside its range"),
        ({"name": "cg_shift", "parameters": 0.9}, "parameters"),
    ],
)
def test_bad_effect_is_one_clear_message(tmp_path, effect, said):
    with pytest.raises(ConfigurationError, match="effect") as caught:
        plan.make(campaigns.write(tmp_path / "c.toml", effect=[effect]))
    assert said in str(caught.value)


def test_gust_effect_without_gusts_is_refused(tmp_path):
    file = campaigns.write(tmp_path / "c.toml", gust=None, effect=[{"name": "gust_level", "factor": 2.0}])
    with pytest.raises(ConfigurationError, match=r"needs gusts; set gust\.level"):
        plan.make(file)
