"""The library: contract names, variants, effects of other packages, and the command that lists them."""

import json
from dataclasses import replace
from importlib.metadata import EntryPoint

import fly_campaigns as campaigns
import numpy as np
import pytest

from airtruth import aircraft
from airtruth.effects import registry as library
from airtruth.effects.effect import GTM
from airtruth.effects.registry import EFFECTS
from airtruth.errors import ConfigurationError
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from validation import lateral_truth

CONTRACT = {
    "elevator_delay": ["delay_s"],
    "aileron_delay": ["delay_s"],
    "rudder_delay": ["delay_s"],
    "actuator_lag": ["bandwidth_hz"] * 3,
    "rate_limit": ["rate_rad_s"] * 3,
    "backlash": ["width_rad"] * 3,
    "elevator_effectiveness": ["factor"],
    "aileron_effectiveness": ["factor"],
    "rudder_effectiveness": ["factor"],
    "elevator_asymmetry": ["dCmde"],
    "cm_alpha_nonlinear": ["dCmalpha", "at_alpha_rad", "Cmalpha2"],
    "cl_alpha_nonlinear": ["dCLalpha", "at_alpha_rad", "CLalpha2"],
    "downwash_lag": ["Cmalphadot"],
    "thrust_moment": ["arm_m"],
    "tail_effectiveness": ["factor"],
    "wing_effectiveness": ["factor"],
    "dynamic_pressure": ["factor"],
    "aerodynamic_center": ["dx_mac"],
    "icing": ["severity"],
    "derivatives": [
        *("dCLalpha", "dCLq", "dCLde", "dCmalpha", "dCmq", "dCmde"),
        *(f"d{c}{s}" for c in ("CY", "Cl", "Cn") for s in ("beta", "p", "r", "da", "dr")),
    ],
    "cg_shift": ["dx_mac"],
    "cg_shift_y": ["dy_m"],
    "inertia_error": ["factor", "factor", "factor", "shift"],
    "thrust_asymmetry": ["moment_n_m"],
    "fin_effectiveness": ["factor"],
    "wing_tip_loss": ["fraction"] * 2,
    "flap_loss": ["fraction"] * 2,
    "adverse_yaw": ["dCnda"],
    "dihedral": ["dClbeta"],
    "cn_beta_nonlinear": ["dCnbeta", "at_beta_rad"],
    "cl_beta_nonlinear": ["dClbeta", "at_beta_rad"],
    "alpha_vane_roll_arm": ["y_m"],
    "mass_error": ["factor"],
    "vane_arm": ["x_m"] * 2,
    "vane_lag": ["tau_s"] * 2,
    "gyro_lag": ["tau_s"] * 3,
    "vane_scale": ["factor"] * 2,
    "gyro_scale": ["factor"] * 3,
    "accelerometer_scale": ["factor"] * 2,
    "airspeed_scale": ["factor"],
    "airspeed_alpha_slope": ["slope_per_rad"],
    "vane_bias": ["value"] * 2,
    "gyro_bias": ["value"] * 3,
    "accelerometer_bias": ["value"] * 2,
    "accelerometer_arm": ["x_m"] * 2,
    "accelerometer_arm_z": ["z_m"],
    "sensor_delay": ["delay_s"] * 11,
    "horizontal_gust": ["factor"],
    "gust_level": ["factor"] * 2,
}


@pytest.mark.parametrize("name", CONTRACT)
def test_contract_names_and_parameters(name):
    assert [p.name for e in library.named(name) for p in e.parameters] == CONTRACT[name]


def test_units_of_biases():
    units = {
        n: library.named(n)[0].parameters[0].unit for n in ("vane_bias", "gyro_bias", "accelerometer_bias")
    }
    assert units == {"vane_bias": "rad", "gyro_bias": "rad_s", "accelerometer_bias": "m_s2"}


def test_variants():
    channels = [c for m in MOTIONS.values() for c in m.channels]
    assert {e.variant for e in library.named("sensor_delay")} == set(channels)
    assert library.chosen("sensor_delay", "q_rad_s").key == "sensor_delay:q_rad_s"


@pytest.mark.parametrize(
    ("table", "key"),
    [
        ({"name": "cm_alpha_nonlinear", "dCmalpha": 0.5, "at_alpha_rad": 0.1}, "cm_alpha_nonlinear:break"),
        ({"name": "cm_alpha_nonlinear", "dCmalpha": 0.5, "at_alpha_deg": 6}, "cm_alpha_nonlinear:break"),
        ({"name": "cm_alpha_nonlinear", "Cmalpha2": 1.0}, "cm_alpha_nonlinear:quadratic"),
        ({"name": "cl_alpha_nonlinear", "dCLalpha": 0.5, "at_alpha_rad": 0.1}, "cl_alpha_nonlinear:break"),
        ({"name": "cl_alpha_nonlinear", "CLalpha2": 1.0}, "cl_alpha_nonlinear:quadratic"),
        ({"name": "actuator_lag", "bandwidth_hz": 4.0}, "actuator_lag"),
        ({"name": "actuator_lag", "channel": "rudder_rad", "bandwidth_hz": 4.0}, "actuator_lag:rudder_rad"),
        ({"name": "derivatives", "dCnbeta": 0.1}, "derivatives:lateral"),
        ({"name": "wing_tip_loss", "fraction": 0.1}, "wing_tip_loss"),
        ({"name": "wing_tip_loss", "variant": "right", "fraction": 0.1}, "wing_tip_loss:right"),
        ({"name": "flap_loss", "fraction": 0.5}, "flap_loss"),
        ({"name": "sensor_delay", "channel": "q_rad_s", "delay_s": 0.02}, "sensor_delay:q_rad_s"),
        ({"name": "sensor_delay", "channel": "q_rad_s", "delay_ms": 20}, "sensor_delay:q_rad_s"),
    ],
)
def test_what_is_stated_tells_the_variant(table, key):
    effect, values = library.stated(table)
    assert effect.key == key
    assert set(values) == {p.name for p in effect.parameters}


class Brought(EntryPoint):
    """An entry point whose object is at hand."""

    def load(self):
        return self.value


def brought(thing):
    return Brought(name="ice", value=thing, group=library.GROUP)


def test_other_packages_bring_effects():
    frost = replace(library.OWN[0], name="frost")
    rime = replace(frost, name="rime")
    found = library.merged(library.OWN, [brought(frost), brought([rime])])
    assert list(found)[-2:] == ["frost", "rime"]
    assert found["frost"] is frost


def test_what_other_packages_must_not_bring():
    with pytest.raises(ConfigurationError, match="gives int; it has to be"):
        library.merged(library.OWN, [brought([3])])
    with pytest.raises(ConfigurationError, match="'elevator_delay' exists already"):
        library.merged(library.OWN, [brought(library.OWN[0])])


def test_shifts_of_derivatives_may_be_left_out():
    effect, values = library.stated({"name": "derivatives", "dCmalpha": 0.2})
    assert values == {f"d{name}": 0.0 for name in LONGITUDINAL.parameters} | {"dCmalpha": 0.2}
    assert effect.change({"dCmalpha": 0.2}) == effect.change(values)


def test_command_lists_all_or_some():
    listed = json.loads(campaigns.command("effects", "--json").out)
    assert [e["key"] for e in listed] == list(library.EFFECTS)
    lag = next(e for e in listed if e["name"] == "actuator_lag")
    assert lag["parameters"][0]["neutral"] is None  # infinite
    text = campaigns.command("effects", "cm_alpha_nonlinear").out
    assert text.startswith("cm_alpha_nonlinear:break  (dynamics, longitudinal)\n")
    assert "cm_alpha_nonlinear:quadratic" in text
    assert "at_alpha_rad" in text
    wrong = campaigns.command("effects", "backlsh")
    assert wrong.code == 2
    assert "did you mean 'backlash'" in wrong.err


def test_material_sizes_scale_with_the_derivatives_of_a_smaller_aircraft():
    """A T-38 has 13 % of the GTM's Cmalpha; a larger derivative or one near zero does not scale in proportion."""
    effect = EFFECTS["cm_alpha_nonlinear:break"]
    size, at = effect.for_aircraft({"Cmalpha": -0.236}).parameters
    assert size.material == pytest.approx(0.1 * 0.236 / 1.785, rel=1e-12)
    assert at == effect.parameters[1]
    assert effect.for_aircraft({"Cmalpha": -3.0}).parameters[0].material == 0.1
    assert effect.for_aircraft({"Cmalpha": 0.0}).parameters[0].material == pytest.approx(0.01, rel=1e-12)
    assert EFFECTS["elevator_delay"].for_aircraft({}) == EFFECTS["elevator_delay"]


def test_the_reference_of_material_sizes_is_the_declared_gtm():
    stated = {name: abs(q.value) for name, q in aircraft.load("gtm").file.derivatives.items()}
    side = dict(zip(lateral_truth.LATERAL, np.abs(lateral_truth.GTM.lateral.ravel()), strict=True))
    for name, value in GTM.items():
        assert value == pytest.approx((side | stated)[name], rel=5e-3 if name in side else 1e-12)
