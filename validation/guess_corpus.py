"""The corpus of `airtruth import --guess`: layouts of many sources, written from flights with known truth.

Each layout writes one file and states which channels the file does not determine. `HELD_OUT` names those that were written before
the first score and are not used to correct the guess.
"""

from __future__ import annotations

import datetime
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.io
from numpy.typing import NDArray

from validation import recorders
from validation.guess_flights import DURATION_S, measured
from validation.recorders import Topic

Array = NDArray[np.float64]

DEG, FT, KT, G0 = np.pi / 180.0, 0.3048, 1852.0 / 3600.0, 9.80665
"""Degree [rad], foot [m], knot [m/s], gravity [m/s2]."""
UNIT: Final = {
    "": 1.0,
    "rad": 1.0,
    "deg": DEG,
    "cdeg": 0.01 * DEG,
    "rad/s": 1.0,
    "deg/s": DEG,
    "m/s": 1.0,
    "kt": KT,
    "ft/s": FT,
    "km/h": 1 / 3.6,
    "g": G0,
    "m/s2": 1.0,
    "ft/s2": FT,
    "m": 1.0,
    "ft": FT,
    "mm": 1e-3,
    "cm": 1e-2,
    "kg/m3": 1.0,
    "slug/ft3": 515.378818,
    "pa": 1.0,
    "hpa": 100.0,
    "psf": 47.880259,
    "psi": 6894.757293,
    "%": 0.01,
}
"""Unit -> factor to SI."""
_LATERAL: Final = {"p": 0.05, "r": 0.02, "phi": 0.03, "beta": 0.015, "ay": 0.3, "psi": 0.05}
"""Channels of the other motion, which are noise here -> standard deviation [SI]."""


@dataclass(frozen=True)
class Layout:
    """A layout: its aircraft, the writer of its file, the suffix, and the channels that the file does not determine."""

    name: str
    craft: str
    suffix: str
    write: Callable[[Path, str, int], None]
    missing: frozenset[str] = frozenset()
    lost: frozenset[str] = field(default=frozenset())


Column = tuple[str, str, str] | tuple[str, str, str, int]
"""Header, channel, unit, and -1 for the opposite sign."""


def _values(craft: str, seed: int, t: Array, column: Column) -> Array:
    _, channel, unit, *sign = column
    factor = UNIT[unit] * (sign[0] if sign else 1)
    if channel in _LATERAL:
        rng = np.random.default_rng([seed, sorted(_LATERAL).index(channel), 7])
        return np.asarray(_LATERAL[channel] * rng.standard_normal(len(t)) / factor)
    return measured(craft, channel, t, seed) / factor


def table(
    columns: Sequence[Column],
    *,
    rate_hz: float = 50.0,
    time: str = "time",
    clock: float = 1.0,
    start: float = 0.0,
    delimiter: str = ",",
    decimal: str = ".",
    units_row: str = "",
    prose: Sequence[str] = (),
    jitter: float = 0.0,
    encoding: str = "utf-8",
    digits: int = 7,
    iso: bool = False,
    repeat: bool = False,
) -> Callable[[Path, str, int], None]:
    """A writer of a table of text: ``clock`` counts of the time column in a second, ``start`` its first value [s]."""

    def write(path: Path, craft: str, seed: int) -> None:
        rng = np.random.default_rng(seed)
        t = np.arange(int((DURATION_S - 0.5) * rate_hz)) / rate_hz
        t = t + jitter / rate_hz * rng.uniform(-1.0, 1.0, len(t))
        t -= t[0]
        if repeat:
            t = np.sort(np.concatenate([t, t[100:103]]))
        values = [_values(craft, seed, t, column) for column in columns]
        names = [time, *(c[0] for c in columns)]
        stamps = [f"{(t0 + start) * clock:.{0 if clock > 1.0 else 5}f}" for t0 in t]
        if iso:
            base = datetime.datetime(2024, 5, 1, 12, 0, 0)
            stamps = [
                (base + datetime.timedelta(seconds=float(t0))).isoformat(" ", "milliseconds") for t0 in t
            ]
        rows = [[s, *(f"{v[i]:.{digits}g}" for v in values)] for i, s in enumerate(stamps)]
        if decimal == ",":
            rows = [[cell.replace(".", ",") for cell in row] for row in rows]
        lines = [*prose, delimiter.join(names)]
        if units_row:
            lines.append(delimiter.join([units_row, *(c[2] for c in columns)]))
        lines += [delimiter.join(row) for row in rows]
        path.write_text("\n".join(lines) + "\n", encoding=encoding)

    return write


def topics(
    spec: Mapping[str, tuple[float, Sequence[Column]]],
    units: Mapping[str, str] | None = None,
    start: float = 12.0,
) -> Callable[[str, int], list[Topic]]:
    """Topics with rates of their own: name -> rate and fields."""

    def made(craft: str, seed: int) -> list[Topic]:
        result = []
        for number, (name, (rate, columns)) in enumerate(spec.items()):
            t = np.arange(int((DURATION_S - 0.5) * rate)) / rate + 0.0007 * number
            fields = {c[0]: _values(craft, seed, t, c) for c in columns}
            stated = {c[0]: (units or {}).get(c[2], c[2]) for c in columns if c[2]}
            result.append(Topic(name, t + start, fields, stated, "f" * len(fields)))
        return result

    return made


def dataflash(spec: Callable[[str, int], list[Topic]]) -> Callable[[Path, str, int], None]:
    """A writer of a DataFlash log."""
    return lambda path, craft, seed: _sized(path.write_bytes(recorders.dataflash(spec(craft, seed))))


def _sized(_: int) -> None:
    return None


def ulog(
    spec: Callable[[str, int], list[Topic]], further: Callable[[str, int], list[Topic]] | None = None
) -> Callable[[Path, str, int], None]:
    """A writer of a PX4 log (docs.px4.io, ULog file format): a format and a subscription for each topic, then its data."""

    def write(path: Path, craft: str, seed: int) -> None:
        listed = [*spec(craft, seed), *(further(craft, seed) if further else [])]
        path.write_bytes(ulog_bytes(listed))

    return write


def ulog_bytes(listed: Sequence[Topic]) -> bytes:
    """A PX4 log; fields "xyz[1]" become arrays."""

    def message(kind: str, body: bytes) -> bytes:
        return struct.pack("<HB", len(body), ord(kind)) + body

    heads: list[bytes] = []
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    data: list[tuple[int, bytes]] = []
    for number, topic in enumerate(listed):
        sizes: dict[str, int] = {}
        for name in topic.fields:
            base = name.split("[")[0]
            sizes[base] = sizes.get(base, 0) + 1
        kinds = "".join(
            f"float {name};" if size == 1 and f"{name}[0]" not in topic.fields else f"float[{size}] {name};"
            for name, size in sizes.items()
        )
        parts.append(message("F", f"{topic.name}:uint64_t timestamp;{kinds}".encode()))
        heads.append(message("A", struct.pack("<BH", 0, number) + topic.name.encode()))
        columns = np.stack(list(topic.fields.values()), axis=1)
        for t, row in zip(topic.t_s, columns, strict=True):
            stamp = round(1e6 * t)
            data.append((stamp, message("D", struct.pack(f"<HQ{len(row)}f", number, stamp, *row))))
    return b"".join([*parts, *heads, *(body for _, body in sorted(data, key=lambda one: one[0]))])


def quaternion(
    names: Sequence[str], topic: str, rate: float, conjugate: float = 1.0
) -> Callable[[str, int], list[Topic]]:
    """A topic with the attitude as a quaternion, the scalar first."""

    def made(craft: str, seed: int) -> list[Topic]:
        t = np.arange(int((DURATION_S - 0.5) * rate)) / rate
        half = 0.5 * measured(craft, "theta_rad", t, seed)
        heading = 0.4
        w, y = np.cos(half) * np.cos(heading), np.sin(half) * np.cos(heading)
        x, z = -np.sin(half) * np.sin(heading), np.cos(half) * np.sin(heading)
        return [
            Topic(
                topic,
                t + 12.0,
                dict(zip(names, (w, conjugate * x, conjugate * y, conjugate * z), strict=True)),
                {},
            )
        ]

    return made


def both(*made: Callable[[str, int], list[Topic]]) -> Callable[[str, int], list[Topic]]:
    """Topics of several makers."""
    return lambda craft, seed: [topic for one in made for topic in one(craft, seed)]


def matrix(
    columns: Sequence[Column], labels: bool = True, name: str = "fdata"
) -> Callable[[Path, str, int], None]:
    """A .mat file with one matrix, whose labels are "* alpha (deg)"."""

    def write(path: Path, craft: str, seed: int) -> None:
        t = np.arange(int((DURATION_S - 0.5) * 50.0)) / 50.0
        data = np.column_stack([t, *(_values(craft, seed, t, c) for c in columns)])
        content: dict[str, Any] = {name: data}
        if labels:
            words = ["time (sec)", *(f"{c[0]} ({c[2].replace('/s', '/sec')})" for c in columns)]
            content["varlab"] = np.array(["* " + w for w in words], dtype=object)
        scipy.io.savemat(path, content)

    return write


def struct_file(
    spec: Mapping[str, Sequence[Column]], rate: float = 100.0
) -> Callable[[Path, str, int], None]:
    """A .mat file with a struct of structs, each with a time."""

    def write(path: Path, craft: str, seed: int) -> None:
        t = np.arange(int((DURATION_S - 0.5) * rate)) / rate
        content = {
            group: {"time": t, **{c[0]: _values(craft, seed, t, c) for c in columns}}
            for group, columns in spec.items()
        }
        scipy.io.savemat(path, content)

    return write


PLAIN: Final[list[tuple[str, str, str]]] = [
    ("tas", "airspeed_m_s", "m/s"),
    ("alpha", "alpha_rad", "deg"),
    ("theta", "theta_rad", "deg"),
    ("q", "q_rad_s", "deg/s"),
    ("ax", "ax_m_s2", "m/s2"),
    ("az", "az_m_s2", "m/s2"),
    ("elevator", "elevator_rad", "deg"),
    ("alt", "altitude_m", "m"),
]
"""Header, channel and unit of a plain table."""
_NEW_PX4: Final = topics(
    {
        "airspeed_validated": (
            10.0,
            [
                ("indicated_airspeed_m_s", "ias_m_s", "m/s"),
                ("calibrated_airspeed_m_s", "ias_m_s", "m/s"),
                ("true_airspeed_m_s", "airspeed_m_s", "m/s"),
            ],
        ),
        "vehicle_angular_velocity": (
            100.0,
            [("xyz[0]", "p", "rad/s"), ("xyz[1]", "q_rad_s", "rad/s"), ("xyz[2]", "r", "rad/s")],
        ),
        "vehicle_acceleration": (
            100.0,
            [("xyz[0]", "ax_m_s2", "m/s2"), ("xyz[1]", "ay", "m/s2"), ("xyz[2]", "az_m_s2", "m/s2")],
        ),
        "vehicle_air_data": (
            20.0,
            [
                ("baro_alt_meter", "altitude_m", "m"),
                ("baro_pressure_pa", "pressure_pa", "pa"),
                ("rho", "density_kg_m3", "kg/m3"),
            ],
        ),
        "vehicle_local_position": (
            10.0,
            [
                ("vx", "airspeed_m_s", "m/s"),
                ("vy", "beta", "m/s"),
                ("vz", "climb_m_s", "m/s", -1),
                ("ax", "ay", "m/s2"),
                ("ay", "ay", "m/s2"),
                ("az", "ay", "m/s2"),
            ],
        ),
        "vehicle_rates_setpoint": (
            50.0,
            [("roll", "p", "rad/s"), ("pitch", "q_rad_s", "rad/s"), ("yaw", "r", "rad/s")],
        ),
        "vehicle_attitude_setpoint": (
            50.0,
            [("roll_body", "phi", "rad"), ("pitch_body", "theta_rad", "rad")],
        ),
        "actuator_servos": (
            100.0,
            [("control[0]", "p", ""), ("control[1]", "elevator_rad", ""), ("control[2]", "r", "")],
        ),
    }
)
_OLD_PX4: Final = topics(
    {
        "sensor_combined": (
            100.0,
            [
                ("gyro_rad[0]", "p", "rad/s"),
                ("gyro_rad[1]", "q_rad_s", "rad/s"),
                ("gyro_rad[2]", "r", "rad/s"),
                ("accelerometer_m_s2[0]", "ax_m_s2", "m/s2"),
                ("accelerometer_m_s2[1]", "ay", "m/s2"),
                ("accelerometer_m_s2[2]", "az_m_s2", "m/s2"),
            ],
        ),
        "airspeed": (
            10.0,
            [("indicated_airspeed_m_s", "ias_m_s", "m/s"), ("true_airspeed_m_s", "airspeed_m_s", "m/s")],
        ),
        "vehicle_gps_position": (5.0, [("alt", "altitude_m", "mm"), ("vel_m_s", "airspeed_m_s", "m/s")]),
        "actuator_controls_0": (
            100.0,
            [("control[0]", "p", ""), ("control[1]", "elevator_rad", "", -1), ("control[3]", "throttle", "")],
        ),
        "vehicle_rates_setpoint": (
            50.0,
            [("roll", "p", "rad/s"), ("pitch", "q_rad_s", "rad/s"), ("yaw", "r", "rad/s")],
        ),
    }
)
_PX4_QUAT: Final = quaternion(("q[0]", "q[1]", "q[2]", "q[3]"), "vehicle_attitude", 100.0)
_APM: Final = {
    "deg/s": "deg/s",
    "m/s2": "m/s/s",
    "deg": "deg",
    "m/s": "m/s",
    "m": "m",
    "rad/s": "rad/s",
    "pa": "Pa",
}
_ARDUPILOT: Final = {
    "ATT": (
        25.0,
        [
            ("DesRoll", "phi", "deg"),
            ("Roll", "phi", "deg"),
            ("DesPitch", "theta_rad", "deg"),
            ("Pitch", "theta_rad", "deg"),
        ],
    ),
    "IMU": (
        100.0,
        [
            ("GyrX", "p", "rad/s"),
            ("GyrY", "q_rad_s", "rad/s"),
            ("GyrZ", "r", "rad/s"),
            ("AccX", "ax_m_s2", "m/s2"),
            ("AccY", "ay", "m/s2"),
            ("AccZ", "az_m_s2", "m/s2"),
        ],
    ),
    "ARSP": (10.0, [("Airspeed", "ias_m_s", "m/s")]),
    "BARO": (10.0, [("Press", "pressure_pa", "pa")]),
    "RCOU": (50.0, [("C1", "p", ""), ("C2", "elevator_rad", ""), ("C4", "r", "")]),
}
_WORDS: Final[list[Column]] = [
    ("True Airspeed [kt]", "airspeed_m_s", "kt"),
    ("AOA [deg]", "alpha_rad", "deg"),
    ("Pitch Angle [deg]", "theta_rad", "deg"),
    ("Pitch Rate [deg/s]", "q_rad_s", "deg/s"),
    ("Nx [g]", "ax_m_s2", "g"),
    ("Nz [g]", "az_m_s2", "g", -1),
    ("Elevator Position [deg]", "elevator_rad", "deg"),
    ("Pressure Altitude [ft]", "altitude_m", "ft"),
]
_PLUS: Final[list[Column]] = [
    ("p", "p", "deg/s"),
    ("r", "r", "deg/s"),
    ("phi", "phi", "deg"),
    ("beta", "beta", "deg"),
    ("ay", "ay", "m/s2"),
]


def _but(columns: Sequence[Column], *names: str) -> list[Column]:
    return [c for c in columns if c[0] not in names]


def _in(columns: Sequence[Column], **units: str) -> list[Column]:
    return [(c[0], c[1], units.get(c[0], c[2]), *c[3:]) for c in columns]


_NO_ELEVATOR, _NO_VANE = frozenset({"elevator_rad"}), frozenset({"alpha_rad"})
"""Channels that some files do not determine."""

LAYOUTS: Final = (
    Layout("px4 new", "model", ".ulg", ulog(both(_NEW_PX4, _PX4_QUAT)), _NO_ELEVATOR | _NO_VANE),
    Layout("px4 old", "model", ".ulg", ulog(both(_OLD_PX4, _PX4_QUAT)), _NO_ELEVATOR | _NO_VANE),
    Layout("ardupilot", "model", ".bin", dataflash(topics(_ARDUPILOT, _APM)), _NO_ELEVATOR | _NO_VANE),
    Layout(
        "ardupilot aetr aoa",
        "model",
        ".bin",
        dataflash(
            topics(
                {
                    **_ARDUPILOT,
                    "AETR": (25.0, [("Ail", "p", ""), ("Elev", "elevator_rad", "cdeg")]),
                    "AOA": (10.0, [("AOA", "alpha_rad", "deg"), ("SSA", "beta", "deg")]),
                },
                _APM,
            )
        ),
        _NO_ELEVATOR | _NO_VANE,
    ),
    Layout("plain csv deg", "model", ".csv", table(PLAIN)),
    Layout(
        "plain csv rad",
        "single",
        ".csv",
        table(_in(PLAIN, alpha="rad", theta="rad", q="rad/s", elevator="rad")),
    ),
    Layout("centidegrees", "model", ".csv", table(_in(PLAIN, elevator="cdeg"))),
    Layout("units row", "single", ".csv", table(PLAIN, units_row="s")),
    Layout("brackets kt ft", "single", ".csv", table(_WORDS, time="Time [s]")),
    Layout(
        "brackets jet semicolon comma",
        "jet",
        ".csv",
        table(_WORDS, time="Zeit [s]", delimiter=";", decimal=","),
    ),
    Layout("no vane", "single", ".csv", table(_but(PLAIN, "alpha")), _NO_VANE),
    Layout("no vane jet kt ft", "jet", ".csv", table(_but(_WORDS, "AOA [deg]"), time="Time [s]"), _NO_VANE),
    Layout(
        "uvw",
        "model",
        ".csv",
        table(
            [
                ("u", "u_m_s", "m/s"),
                ("v", "beta", "m/s"),
                ("w", "w_m_s", "m/s"),
                *_PLUS,
                *_but(PLAIN, "tas", "alpha"),
            ]
        ),
    ),
    Layout(
        "knots and feet unstated", "single", ".csv", table(_in(PLAIN, tas="kt", alt="ft", ax="g", az="g"))
    ),
    Layout(
        "feet per second unstated",
        "jet",
        ".csv",
        table(_in(PLAIN, tas="ft/s", alt="ft", ax="ft/s2", az="ft/s2")),
    ),
    Layout("lateral beside", "single", ".csv", table([*_PLUS, *PLAIN])),
    Layout(
        "sidpac",
        "single",
        ".mat",
        matrix(
            [
                ("vt", "airspeed_m_s", "ft/s"),
                ("beta", "beta", "deg"),
                ("alpha", "alpha_rad", "deg"),
                ("p", "p", "deg/s"),
                ("q", "q_rad_s", "deg/s"),
                ("r", "r", "deg/s"),
                ("phi", "phi", "deg"),
                ("the", "theta_rad", "deg"),
                ("ax", "ax_m_s2", "g"),
                ("ay", "ay", "g"),
                ("az", "az_m_s2", "g"),
                ("el", "elevator_rad", "deg"),
                ("h", "altitude_m", "ft"),
            ]
        ),
    ),
    Layout(
        "ahrs dadc prefixes",
        "jet",
        ".csv",
        table(
            [
                ("Dadc1_tas", "airspeed_m_s", "kt"),
                ("vane_AOA", "alpha_rad", "deg"),
                ("Ahrs1_PitchAtt", "theta_rad", "deg"),
                ("Ahrs1_bPitchRate", "q_rad_s", "deg/s"),
                ("Ahrs1_bLongAccel", "ax_m_s2", "g"),
                ("Ahrs1_bNormAccel", "az_m_s2", "g", -1),
                ("delta_e", "elevator_rad", "deg"),
                ("Dadc1_PressAlt", "altitude_m", "ft"),
            ]
        ),
    ),
    Layout("8 Hz", "jet", ".csv", table(_WORDS, rate_hz=8.0, time="Time [s]")),
    Layout("400 Hz", "model", ".csv", table(PLAIN, rate_hz=400.0)),
    Layout("milliseconds", "model", ".csv", table(PLAIN, time="time_ms", clock=1e3, start=5000.0)),
    Layout("microseconds", "single", ".csv", table(PLAIN, time="timestamp", clock=1e6, start=300.0)),
    Layout("iso times", "single", ".csv", table(PLAIN, iso=True)),
    Layout(
        "whitespace units",
        "single",
        ".txt",
        table([(f"{c[0]} [{c[2]}]", *c[1:]) for c in PLAIN], time="time [s]", delimiter="  "),
    ),
    Layout(
        "prose",
        "jet",
        ".asc",
        table(PLAIN, delimiter="   ", units_row="s", prose=("Data file: flight 7", "9 variables", "")),
    ),
    Layout("jitter", "model", ".csv", table(PLAIN, jitter=0.2)),
    Layout(
        "jsbsim csv",
        "single",
        ".csv",
        table(
            [
                ("Elevator Command (norm)", "elevator_command_rad", ""),
                ("Elevator Position (deg)", "elevator_rad", "deg"),
                ("P (deg/s)", "p", "deg/s"),
                ("Q (deg/s)", "q_rad_s", "deg/s"),
                ("R (deg/s)", "r", "deg/s"),
                ("Q_{inertial} (deg/s)", "q_rad_s", "deg/s"),
                ("V_{Total} (ft/s)", "airspeed_m_s", "ft/s"),
                ("V_{Inertial} (ft/s)", "airspeed_m_s", "ft/s"),
                ("Rho (slugs/ft^3)", "density_kg_m3", "slug/ft3"),
                ("Altitude ASL (ft)", "altitude_m", "ft"),
                ("Theta (deg)", "theta_rad", "deg"),
                ("Alpha (deg)", "alpha_rad", "deg"),
                ("Beta (deg)", "beta", "deg"),
                ("/fdm/jsbsim/accelerations/a-pilot-x-ft_sec2", "ax_m_s2", "ft/s2"),
                ("/fdm/jsbsim/accelerations/a-pilot-z-ft_sec2", "az_m_s2", "ft/s2"),
            ],
            time="Time",
        ),
    ),
    Layout(
        "garmin g1000",
        "single",
        ".csv",
        table(
            [
                ("AltB", "altitude_m", "ft"),
                ("AltMSL", "altitude_m", "ft"),
                ("IAS", "ias_m_s", "kt"),
                ("GndSpd", "airspeed_m_s", "kt"),
                ("Pitch", "theta_rad", "deg"),
                ("Roll", "phi", "deg"),
                ("NormAc", "norm_acc", ""),
                ("TAS", "airspeed_m_s", "kt"),
            ],
            rate_hz=8.0,
        ),
        frozenset({"elevator_rad", "q_rad_s", "alpha_rad", "ax_m_s2"}),
    ),
    # Held out from here on.
    Layout(
        "onspeed",
        "single",
        ".csv",
        table(
            [
                ("IAS", "ias_m_s", "kt"),
                ("AngleofAttack", "beta", "deg"),
                ("boomAlpha", "alpha_rad", "deg"),
                ("Pitch", "theta_rad", "deg"),
                ("PitchRate", "q_rad_s", "deg/s"),
                ("VerticalG", "az_m_s2", "g", -1),
                ("ForwardG", "ax_m_s2", "g"),
                ("Palt", "altitude_m", "ft"),
                ("PStatic", "pressure_pa", "psi"),
                ("elevator", "elevator_rad", "deg"),
            ],
            time="timeStamp",
            clock=1e3,
            start=100.0,
        ),
    ),
    Layout(
        "flightgear",
        "single",
        ".csv",
        table(
            [
                ("/velocities/airspeed-kt", "ias_m_s", "kt"),
                ("/orientation/alpha-deg", "alpha_rad", "deg"),
                ("/orientation/pitch-deg", "theta_rad", "deg"),
                ("/orientation/pitch-rate-degps", "q_rad_s", "deg/s"),
                ("/accelerations/pilot/x-accel-fps_sec", "ax_m_s2", "ft/s2"),
                ("/accelerations/pilot/z-accel-fps_sec", "az_m_s2", "ft/s2"),
                ("/position/altitude-ft", "altitude_m", "ft"),
                ("/surface-positions/elevator-pos-norm", "elevator_rad", ""),
            ],
            time="Time",
        ),
        _NO_ELEVATOR,
    ),
    Layout(
        "ros quaternion",
        "model",
        ".csv",
        table(
            [
                ("airspeed", "airspeed_m_s", "m/s"),
                ("gyro_y", "q_rad_s", "rad/s"),
                ("accel_x", "ax_m_s2", "m/s2"),
                ("accel_z", "az_m_s2", "m/s2"),
                ("pitch", "theta_rad", "rad"),
                ("aoa", "alpha_rad", "rad"),
                ("pitch_setpoint", "theta_rad", "rad"),
                ("elevator", "elevator_rad", "rad"),
                ("baro_altitude", "altitude_m", "m"),
            ]
        ),
    ),
    Layout(
        "jategaonkar",
        "jet",
        ".csv",
        table(
            [
                ("Vtas", "airspeed_m_s", "m/s"),
                ("alphaNB", "alpha_rad", "rad"),
                ("theta", "theta_rad", "rad"),
                ("q", "q_rad_s", "rad/s"),
                ("ax", "ax_m_s2", "m/s2"),
                ("az", "az_m_s2", "m/s2"),
                ("eta", "elevator_rad", "rad"),
                ("rho", "density_kg_m3", "kg/m3"),
            ],
            rate_hz=25.0,
        ),
    ),
    Layout(
        "elevator up positive",
        "single",
        ".csv",
        table(
            [*_but(_WORDS, "Elevator Position [deg]"), ("ELEV [deg]", "elevator_rad", "deg", -1)],
            time="Time [s]",
        ),
    ),
    Layout(
        "struct of structs",
        "single",
        ".mat",
        struct_file(
            {
                "imu": [
                    ("q", "q_rad_s", "rad/s"),
                    ("ax", "ax_m_s2", "m/s2"),
                    ("az", "az_m_s2", "m/s2"),
                    ("theta", "theta_rad", "rad"),
                ],
                "adc": [
                    ("tas", "airspeed_m_s", "m/s"),
                    ("alpha", "alpha_rad", "rad"),
                    ("alt", "altitude_m", "m"),
                ],
                "fcs": [("elevator", "elevator_rad", "rad")],
            }
        ),
    ),
    Layout(
        "dataflash of a test centre",
        "single",
        ".bin",
        dataflash(
            topics(
                {
                    "AIR": (
                        20.0,
                        [
                            ("TAS", "airspeed_m_s", "m/s"),
                            ("Alt", "altitude_m", "m"),
                            ("AOA", "alpha_rad", "deg"),
                        ],
                    ),
                    "NAVX": (
                        100.0,
                        [
                            ("Pitch", "theta_rad", "deg"),
                            ("GyrY", "q_rad_s", "deg/s"),
                            ("AccX", "ax_m_s2", "m/s2"),
                            ("AccZ", "az_m_s2", "m/s2"),
                            ("Elev", "elevator_rad", "deg"),
                        ],
                    ),
                },
                _APM,
            )
        ),
    ),
    Layout(
        "dynamic pressure",
        "jet",
        ".csv",
        table([*_but(PLAIN, "tas"), ("rho", "density_kg_m3", "kg/m3"), ("IAS [kt]", "ias_m_s", "kt")]),
    ),
    Layout(
        "tabs german",
        "single",
        ".csv",
        table([(f"{c[0]} [{c[2]}]", *c[1:]) for c in PLAIN], time="Zeit [s]", delimiter="\t", decimal=","),
    ),
    Layout(
        "latin-1 degrees",
        "single",
        ".csv",
        table(
            [
                ("TAS [m/s]", "airspeed_m_s", "m/s"),
                ("Alpha [°]", "alpha_rad", "deg"),
                ("Theta [°]", "theta_rad", "deg"),
                ("q [°/s]", "q_rad_s", "deg/s"),
                ("ax [m/s²]", "ax_m_s2", "m/s2"),
                ("az [m/s²]", "az_m_s2", "m/s2"),
                ("Elevator [°]", "elevator_rad", "deg"),
                ("Altitude [m]", "altitude_m", "m"),
            ],
            time="Time [s]",
            encoding="cp1252",
        ),
    ),
    Layout("repeated stamps", "model", ".csv", table(PLAIN, repeat=True)),
    Layout(
        "kilometres per hour",
        "model",
        ".csv",
        table([("TAS [km/h]", "airspeed_m_s", "km/h"), *_but(PLAIN, "tas")]),
    ),
    Layout("altitude in cm", "model", ".csv", table([("alt [cm]", "altitude_m", "cm"), *_but(PLAIN, "alt")])),
    Layout(
        "satellite altitude",
        "single",
        ".csv",
        table([("gps_alt [m]", "altitude_m", "m"), *_but(PLAIN, "alt")]),
    ),
    Layout(
        "commands beside",
        "single",
        ".csv",
        table(
            [
                ("elevator_cmd", "elevator_command_rad", "deg"),
                ("pitch_cmd", "theta_rad", "deg"),
                ("q_ref", "q_rad_s", "deg/s"),
                *PLAIN,
            ]
        ),
    ),
    Layout(
        "x-plane",
        "single",
        ".csv",
        table(
            [
                ("Vtrue,_ktas ", "airspeed_m_s", "kt"),
                ("Q,rad/s ", "q_rad_s", "rad/s"),
                ("pitch,__deg ", "theta_rad", "deg"),
                ("alpha,__deg ", "alpha_rad", "deg"),
                ("Gload,norml ", "az_m_s2", "g", -1),
                ("Gload,axial ", "ax_m_s2", "g"),
                ("elev1,__deg ", "elevator_rad", "deg"),
                ("__alt,ftmsl ", "altitude_m", "ft"),
            ],
            time="_totl,_time ",
            delimiter="|",
        ),
    ),
)
"""Every layout; those after "garmin g1000" are held out."""
HELD_OUT: Final = tuple(layout.name for layout in LAYOUTS[28:] if layout.name != "x-plane")
"""Layouts that were written before the first score and do not serve to correct the guess; that of X-Plane did later."""

__all__ = ["HELD_OUT", "LAYOUTS", "PLAIN", "Layout", "dataflash", "table", "topics", "ulog", "ulog_bytes"]
