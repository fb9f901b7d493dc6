"""Sizes with a noncentrality of 16 in calm, light and moderate air; printed by `blind.calibrate`.

Capped at the largest size of the effect, so that some cannot be seen in some air.
"""

from typing import Final

SIZE16: Final[dict[str, tuple[float, float, float]]] = {
    "elevator_delay": (0.0012, 0.00233, 0.00297),
    "actuator_lag": (0.0012, 0.00234, 0.00297),
    "rate_limit": (0.8, 1.0, 1.05),
    "backlash": (0.000224, 0.00077, 0.00117),
    "elevator_effectiveness": (0.165, 0.196, 0.204),
    "elevator_asymmetry": (0.0354, 0.11, 0.163),
    "cm_alpha_nonlinear:break": (0.0527, 0.123, 0.181),
    "cm_alpha_nonlinear:quadratic": (0.678, 1.64, 2.41),
    "cl_alpha_nonlinear:break": (0.129, 0.357, 0.596),
    "cl_alpha_nonlinear:quadratic": (1.57, 4.51, 7.82),
    "downwash_lag": (12.3, 19.5, 21),
    "thrust_moment": (0.0619, 0.2, 0.2),
    "cg_shift": (0.06, 0.06, 0.06),
    "inertia_error": (0.131, 0.171, 0.182),
    "mass_error": (0.0489, 0.0737, 0.0872),
    "vane_arm": (0.0588, 0.381, 0.608),
    "vane_lag": (0.00146, 0.00951, 0.0149),
    "gyro_lag": (0.00158, 0.00231, 0.00291),
    "accelerometer_lag": (0.00445, 0.00828, 0.0104),
    "vane_scale": (0.0141, 0.0702, 0.107),
    "gyro_scale": (0.0127, 0.072, 0.111),
    "accelerometer_scale": (0.0338, 0.134, 0.168),
    "airspeed_scale": (0.0508, 0.0626, 0.066),
    "accelerometer_arm": (0.05, 0.0952, 0.107),
    "sensor_delay:alpha_rad": (0.00146, 0.00952, 0.0149),
    "sensor_delay:q_rad_s": (0.00158, 0.00231, 0.00291),
    "sensor_delay:az_m_s2": (0.00445, 0.00831, 0.0105),
    "structural_mode": (0.00122, 0.00149, 0.00169),
    "hinge_blowback": (1.11, 3.61, 4.96),
    "cm_hysteresis": (0.0248, 0.0904, 0.144),
    "fuel_slosh": (0.73, 1.43, 1.95),
    "thrust_lag": (0.0354, 0.12, 0.185),
    "separation_switch": (0.001, 0.00265, 0.00389),
    "vane_friction": (0.000167, 0.000544, 0.000898),
    "stall_state": (0.0198, 0.0675, 0.102),
    "cg_drift": (0.000121, 0.000439, 0.000722),
    "elevator_in_wake": (0.759, 2.15, 2.98),
    "vane_curve": (0.216, 0.725, 1.27),
    "gyro_g_sensitivity": (0.000788, 0.00409, 0.00643),
}
