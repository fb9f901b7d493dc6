"""Sizes with a noncentrality of 16 in calm, light and moderate air; printed by `blind.calibrate`.

Capped at the largest size of the effect, so that some cannot be seen in some air.
"""

from typing import Final

SIZE16: Final[dict[str, tuple[float, float, float]]] = {
    "elevator_delay": (0.0012, 0.00233, 0.00296),
    "actuator_lag": (0.0012, 0.00233, 0.00296),
    "rate_limit": (0.75, 0.9, 0.95),
    "backlash": (0.000217, 0.000731, 0.0011),
    "elevator_effectiveness": (0.16, 0.193, 0.202),
    "elevator_asymmetry": (0.0335, 0.106, 0.152),
    "cm_alpha_nonlinear:break": (0.052, 0.112, 0.16),
    "cm_alpha_nonlinear:quadratic": (0.672, 1.48, 2.12),
    "cl_alpha_nonlinear:break": (0.128, 0.357, 0.594),
    "cl_alpha_nonlinear:quadratic": (1.57, 4.5, 7.75),
    "downwash_lag": (12.2, 19.4, 20.9),
    "thrust_moment": (0.0453, 0.107, 0.145),
    "cg_shift": (0.0247, 0.0403, 0.0493),
    "inertia_error": (0.129, 0.168, 0.181),
    "mass_error": (0.0417, 0.047, 0.0531),
    "vane_arm": (0.0586, 0.369, 0.579),
    "vane_lag": (0.00145, 0.00934, 0.0145),
    "gyro_lag": (0.00158, 0.0023, 0.00289),
    "accelerometer_lag": (0.00445, 0.00828, 0.0104),
    "vane_scale": (0.0141, 0.0678, 0.104),
    "gyro_scale": (0.0127, 0.0719, 0.111),
    "accelerometer_scale": (0.0338, 0.129, 0.162),
    "airspeed_scale": (0.0501, 0.0619, 0.0651),
    "accelerometer_arm": (0.05, 0.0942, 0.106),
    "sensor_delay:alpha_rad": (0.00145, 0.00935, 0.0145),
    "sensor_delay:q_rad_s": (0.00158, 0.0023, 0.00289),
    "sensor_delay:az_m_s2": (0.00445, 0.00831, 0.0105),
    "structural_mode": (0.00122, 0.00148, 0.00168),
    "hinge_blowback": (0.957, 2.89, 3.99),
    "cm_hysteresis": (0.0245, 0.0897, 0.142),
    "fuel_slosh": (0.73, 1.43, 1.95),
    "thrust_lag": (0.0352, 0.119, 0.184),
    "separation_switch": (0.000944, 0.00256, 0.00374),
    "vane_friction": (0.000166, 0.000535, 0.000878),
}
