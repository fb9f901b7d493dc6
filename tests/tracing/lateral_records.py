"""Records of the lateral-directional motion, simulated apart from the code under test, for the tests of the tracer."""

from __future__ import annotations

import numpy as np

from airtruth import aircraft
from airtruth.physics.motion import LATERAL
from airtruth.physics.terms import Change
from airtruth.tracing.model.parameters import ParameterLayout
from airtruth.tracing.model.plant import LAYOUTS, ForceTable, Plant
from airtruth.tracing.model.records import FINE, Signals, TraceRecord
from airtruth.tracing.model.response import filter_inputs, kernel_input, respond
from airtruth.tracing.model.settings import Settings
from airtruth.units import DEG, G0

GTM = aircraft.load("gtm")
C = GTM.constants
V, DENSITY, ALPHA = 42.85, 0.993, 5.56 * DEG
TRUTH = np.array(
    [
        *(-1.0158, 0.063, 0.8565, -0.0157, 0.3406),
        *(-0.1403, -0.3352, 0.1472, -0.0718, 0.0266),
        *(0.2185, -0.0528, -0.3897, -0.0035, -0.1700),
    ]
)
DT, LENGTH = 0.02, 840.0
LAYOUT = ParameterLayout(LATERAL)
NOISE = np.array([0.033 * DEG, 0.522 * DEG, 0.333 * DEG, 0.05 * DEG, 0.0065 * G0])
SETTINGS = Settings(
    noise=NOISE,
    noise_prior=0.1,
    bias_std=np.array([*np.full(4, 0.5 * DEG), 0.3]),
    gust_m_s=0.2,
    log_gust_std=1.5,
    thrust_std=0.05,
    trim_std=np.array([0.1, 0.03, 0.03]),
    resolution=np.zeros(5),
    layout=LAYOUT,
)


def plant(derivatives=TRUTH, alpha_slope=0.0):
    """Tables of two points per axis; every derivative changes by ``alpha_slope`` of itself per radian of alpha."""
    axis, s, b = np.array([-1.0, 1.0]), C.wing_area_m2, C.span_m
    table = np.asarray(derivatives).reshape(3, 5)
    values = np.zeros((5, 2, 2, 3))
    for signal in range(5):
        for i, a in enumerate(axis):
            own = table[:, signal] * s * np.array([1.0, b, b]) * (1.0 + alpha_slope * (a - ALPHA))
            values[signal, i] = np.outer(axis, own)
    return Plant(
        aircraft=GTM,
        motion=LATERAL,
        tables=tuple(
            ForceTable(names, (axis, axis), own)
            for names, own in zip(LAYOUTS[LATERAL.name], values, strict=True)
        ),
        constant=np.zeros((2, 3)),
        trims={"alpha": ALPHA} | dict.fromkeys((s.name for s in LATERAL.signals), 0.0),
        neutral_rad=np.zeros(2),
        derivatives=np.asarray(derivatives, dtype=float),
        derivative_cov=np.diag((0.1 * np.abs(TRUTH) + 1e-3) ** 2),
        trim=None,
    )


def record(y, aileron, rudder, plant_=None, sub=2, dt=DT, name="a", **known):
    """A record as `reading.read` makes it; aileron, rudder and the known inputs are constants or functions of time."""
    samples = len(y)
    grid = np.arange((samples - 1) * sub + 1) * dt / sub
    fine = np.arange((samples - 1) * sub * FINE + 1) * dt / (sub * FINE)

    def on(x, t):
        return x(t) if callable(x) else np.full(t.size, float(x))

    own = {"v": V, "density": DENSITY, "theta": ALPHA, "alpha": ALPHA, "q": 0.0, "ax": 0.0, "az": -G0} | known
    speed = on(own["v"], grid)
    signals = Signals(
        run_id=name,
        dt_s=dt,
        sub=sub,
        y=np.ascontiguousarray(y),
        controls_rad=np.stack([on(aileron, fine), on(rudder, fine)]),
        airspeed_m_s=speed,
        ground_m_s=on(own.get("ground", speed[0]), grid) if "ground" in own else speed,
        density_kg_m3=on(own["density"], grid),
        theta_rad=on(own["theta"], grid),
        altitude_m=2133.6,
        throttle=None,
        motion=LATERAL,
        alpha_rad=on(own["alpha"], grid),
        q_rad_s=on(own["q"], grid),
        ax_m_s2=on(own["ax"], grid),
        az_m_s2=on(own["az"], grid),
        control_std_rad=np.zeros(2),
        corner_rad2=np.zeros((2, 0)),
        surface_noise_rad2=np.zeros((2, 0)),
        assumed=("az_m_s2",),  # known inputs of no flight, whose path is that of the air
    )
    return TraceRecord(signals, plant_ or plant(), LENGTH)


def common(**values):
    """Common parameters, zero but for those that are named; rotary gusts, rolloff and a CG past the sensors without a share."""
    entries = LAYOUT.common
    made = np.zeros(entries.size)
    for name, value in ({"rotary": -0.5, "rolloff": -0.5, "mounting": -0.5} | values).items():
        made[entries.index(name)] = value
    return made


def per_record(start=(0.0, 0.0, 0.0, 0.0), level=1e-9, **values):
    entries = LAYOUT.per_record
    made = np.zeros(entries.size)
    made[entries.motion_start] = start
    made[entries.log_gust] = np.log(level)
    for name, value in values.items():
        made[entries.index(name)] = value
    return made


def responded(made, change=None, common_=None, own=None, free_run=False):
    return respond(
        made,
        SETTINGS,
        change or Change(),
        common() if common_ is None else common_,
        per_record() if own is None else own,
        free_run=free_run,
    )


def free(made, change=None, common_=None, own=None):
    """Outputs of a simulation."""
    return made.signals.y - responded(made, change, common_, own, free_run=True).e


def kernel(made, change=None, common_=None, own=None):
    given = filter_inputs(made, change or Change())
    return given, kernel_input(
        given, SETTINGS, common() if common_ is None else common_, per_record() if own is None else own
    )
