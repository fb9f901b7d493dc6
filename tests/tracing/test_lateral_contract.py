"""Names of a lateral answer, as files and programs read them from trace.json; changing one breaks their readers."""

import pytest

from airtruth.effects.increment import Shape, increment
from airtruth.effects.increment_shape import names_over, signal_over, unit_over
from airtruth.effects.registry import EFFECTS
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.tracing.accepted import AcceptedEffect, ParameterEstimate
from airtruth.tracing.answer import CandidateScore
from tests.tracing.test_lateral_pages import lateral_answer

SENSORS = {
    "vane_arm:beta_rad": "x_m",
    "vane_lag:beta_rad": "tau_s",
    "vane_scale:beta_rad": "factor",
    **{f"gyro_lag:{c}": "tau_s" for c in ("p_rad_s", "r_rad_s")},
    **{f"gyro_scale:{c}": "factor" for c in ("p_rad_s", "r_rad_s")},
    **{f"gyro_bias:{c}": "value" for c in ("p_rad_s", "r_rad_s")},
    **{
        f"sensor_delay:{c}": "delay_s"
        for c in ("p_rad_s", "r_rad_s", "beta_rad", "phi_rad", "aileron_rad", "rudder_rad")
    },
    "accelerometer_arm:ay_m_s2": "x_m",
    "accelerometer_arm_z:ay_m_s2": "z_m",
}
SURFACES = {
    f"{name}:{channel}": parameter
    for name, parameter in (
        ("actuator_lag", "bandwidth_hz"),
        ("rate_limit", "rate_rad_s"),
        ("backlash", "width_rad"),
    )
    for channel in ("aileron_rad", "rudder_rad")
}
OTHERS = {
    "aileron_delay": "delay_s",
    "rudder_delay": "delay_s",
    "aileron_effectiveness": "factor",
    "rudder_effectiveness": "factor",
    "fin_effectiveness": "factor",
    "wing_tip_loss": "fraction",
    "flap_loss": "fraction",
    "cg_shift_y": "dy_m",
    "inertia_error:ixx": "factor",
    "inertia_error:izz": "factor",
    "inertia_error:ixz": "shift",
    "thrust_asymmetry": "moment_n_m",
    "adverse_yaw": "dCnda",
    "dihedral": "dClbeta",
    "cn_beta_nonlinear:break": "dCnbeta at_beta_rad",
    "cl_beta_nonlinear:break": "dClbeta at_beta_rad",
    "alpha_vane_roll_arm": "y_m",
    "derivatives:lateral": " ".join(
        f"d{c}{s}" for c in ("CY", "Cl", "Cn") for s in ("beta", "p", "r", "da", "dr")
    ),
}


@pytest.mark.parametrize(("key", "parameters"), (SENSORS | SURFACES | OTHERS).items())
def test_an_effect_and_its_parameters_have_their_names(key, parameters):
    effect = EFFECTS[key]
    assert effect.applies_to(LATERAL)
    assert [p.name for p in effect.parameters] == parameters.split()
    assert (effect.name, effect.variant) == tuple((key + ":").split(":")[:2])
    assert effect.variant_channel == (key.partition(":")[2] if key in SENSORS | SURFACES else None)


def test_a_row_names_the_channel_of_a_sensor_or_surface_apart():
    name, _, channel = "vane_arm:beta_rad".partition(":")
    size = {"x_m": ParameterEstimate(13.0, 0.2, (12.6, 13.4))}
    row = AcceptedEffect(
        name, size, 1e-9, 5.0, ("sensor_delay:beta_rad",), channel, channel=channel
    ).to_dict()
    assert (row["name"], row["channel"]) == ("vane_arm", "beta_rad")
    assert row["indistinguishable_from"] == ["sensor_delay:beta_rad"]
    tried = CandidateScore(name, 9.0, 0.1, True, "", channel).to_dict()
    assert (tried["name"], tried["channel"]) == ("vane_arm", "beta_rad")
    assert "channel" not in CandidateScore("inertia_error", 9.0, 0.1, True, "", "ixx").to_dict()


@pytest.mark.parametrize("coefficient", ["CY", "Cl", "Cn"])
@pytest.mark.parametrize("signal", ["beta", "phat", "rhat", "aileron", "rudder", "alpha"])
def test_an_increment_is_over_the_signals_of_the_motion(coefficient, signal):
    assert names_over(coefficient)[signal] == signal
    learned = increment(Shape(coefficient, signal, -0.1, 0.1, 8, 0.0))
    assert learned.variant == f"{coefficient} over {signal}"
    assert signal_over(coefficient, signal) == signal
    assert unit_over(signal) == ("" if signal.endswith("hat") else "rad")


def test_increments_of_the_pitch_plane_keep_their_names():
    stated = {s.name: names_over("Cm")[s.name] for s in LONGITUDINAL.signals}
    assert stated == {"alpha": "alpha_rad", "qhat": "q_hat", "elevator": "elevator_rad"}
    assert names_over("alpha_rad") == names_over("CX") == names_over("CL")


def test_every_derivative_of_the_motion_is_a_parameter():
    assert [f"d{name}" for name in LATERAL.parameters] == OTHERS["derivatives:lateral"].split()


def test_the_answer_has_the_keys_of_an_answer_in_the_channels_of_the_motion():
    answer = lateral_answer().to_dict()
    assert set(answer) >= {
        *("verdict", "provisional", "anomaly", "remaining", "effects", "candidates", "error", "derivatives"),
        *("updated_aircraft", "detectability", "next_flight", "declared_model", "confirmed", "alternatives"),
        *("inclusion", "refined"),
    }
    assert set(answer["anomaly"]) >= {"statistic", "p_value"}
    assert set(answer["declared_model"]) >= {"consistent", "statistic", "degrees", "p_value", "shifts"}
    assert set(answer["derivatives"]) >= {"declared", "before", "after"}
    assert all(set(row) == set(LATERAL.parameters) for row in answer["derivatives"].values() if row)
    assert list(answer["error"]["channels"]) == ["beta_rad", "p_rad_s", "r_rad_s", "phi_rad", "ay_m_s2"]
    assert set(answer["error"]["after"]["held_out"]["free_run"]) == set(LATERAL.output_channels)
