"""Sizes with a noncentrality of 16 in calm, light and moderate air; printed by `blind.calibrate`.

Capped at the largest size of the effect, so that some cannot be seen in some air.
"""

from typing import Final

SIZE16: Final[dict[str, tuple[float, float, float]]] = {
    "elevator_delay": (0.0012, 0.00228, 0.00251),
    "actuator_lag": (0.00121, 0.00229, 0.00253),
    "rate_limit": (0.75, 0.9, 0.95),
    "backlash": (0.000217, 0.000695, 0.000814),
    "elevator_effectiveness": (0.125, 0.172, 0.178),
    "elevator_asymmetry": (0.0336, 0.102, 0.117),
    "cm_alpha_nonlinear:break": (0.0504, 0.103, 0.117),
    "cm_alpha_nonlinear:quadratic": (0.661, 1.38, 1.58),
    "cl_alpha_nonlinear:break": (0.128, 0.305, 0.458),
    "cl_alpha_nonlinear:quadratic": (1.57, 3.8, 5.81),
    "downwash_lag": (8.07, 13.2, 13.3),
    "thrust_moment": (0.046, 0.14, 0.166),
    "cg_shift": (0.0221, 0.0416, 0.045),
    "inertia_error": (0.103, 0.169, 0.179),
    "mass_error": (0.0251, 0.0371, 0.0409),
    "vane_arm": (0.0586, 0.297, 0.453),
    "vane_lag": (0.00146, 0.00747, 0.0114),
    "gyro_lag": (0.00158, 0.00225, 0.00248),
    "accelerometer_lag": (0.00447, 0.00771, 0.00944),
    "vane_scale": (0.0141, 0.0554, 0.0821),
    "gyro_scale": (0.0127, 0.0565, 0.0891),
    "accelerometer_scale": (0.0338, 0.114, 0.144),
    "airspeed_scale": (0.05, 0.07, 0.075),
    "accelerometer_arm": (0.05, 0.0905, 0.0988),
    "sensor_delay:alpha_rad": (0.00146, 0.00747, 0.0114),
    "sensor_delay:q_rad_s": (0.00158, 0.00224, 0.00247),
    "sensor_delay:az_m_s2": (0.00444, 0.00751, 0.00903),
    "structural_mode": (0.00122, 0.00146, 0.00154),
    "hinge_blowback": (0.961, 2.79, 3.16),
    "cm_hysteresis": (0.0247, 0.087, 0.105),
    "fuel_slosh": (0.748, 1.48, 1.61),
    "thrust_lag": (0.0348, 0.11, 0.129),
    "separation_switch": (0.000932, 0.00239, 0.00277),
    "vane_friction": (0.000166, 0.00047, 0.000638),
}
