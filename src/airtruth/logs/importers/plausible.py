"""Is a mapping possible? Signs, units and axes of a log, held against gravity and kinematics.

Motions that the elevator causes are compared, so that gusts, which move a vane and no gyro, do not bend
the comparison.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from airtruth.logs.flight_log import FlightLog
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.units import DEG, FT, G0, KT, SLUG

Array = NDArray[np.float64]

NEAR: Final = 0.2
"""Relative distance within which a ratio counts as that of a known mistake."""
CLEAR: Final = 0.7
"""Squared correlation above which a comparison is certain."""
SURE: Final = 0.9
"""The same for an airspeed, on which gusts pull more."""
MOVED: Final = 0.75
"""Share of alpha that the elevator must move to be certain of an airspeed (never of one too small: gusts
lower the same factor)."""
FAINT: Final = 0.1
"""Squared correlation below which two channels that must agree do not."""
_CUTOFF_HZ: Final = 2.0
_LAGS_S: Final = (0.1, 0.3, 0.8, 2.0)


@dataclass(frozen=True)
class Problem:
    """Something in a log that physics contradicts.

    Attributes
    ----------
    certain : whether no flight could look so; such a log is refused.
    channel : channel to look at.
    sentence : what is seen, and the entry of the mapping that mends it.
    """

    certain: bool
    channel: str
    sentence: str


@dataclass(frozen=True)
class _Mistake:
    ratio: float
    found: str
    remedy: str


_AZ: Final = (
    _Mistake(-1.0, "gravity with the other sign", "sign = -1"),
    _Mistake(1.0 / G0, "g in place of m/s2", 'unit = "g"'),
    _Mistake(-1.0 / G0, "g in place of m/s2, and the other sign", 'unit = "g" and sign = -1'),
    _Mistake(1.0 / FT, "ft/s2 in place of m/s2", 'unit = "ft_s2"'),
    _Mistake(-1.0 / FT, "ft/s2 in place of m/s2, and the other sign", 'unit = "ft_s2" and sign = -1'),
    _Mistake(G0, "m/s2 stated as g", 'unit = "m_s2"'),
    _Mistake(-G0, "m/s2 stated as g, and the other sign", 'unit = "m_s2" and sign = -1'),
)
_ANGLE: Final = (
    _Mistake(-1.0, "the other sign", "sign = -1"),
    _Mistake(1.0 / DEG, "degrees taken as radians", "unit = {deg}"),
    _Mistake(DEG, "radians taken as degrees", "unit = {rad}"),
    _Mistake(-1.0 / DEG, "degrees taken as radians, and the other sign", "unit = {deg} and sign = -1"),
    _Mistake(-DEG, "radians taken as degrees, and the other sign", "unit = {rad} and sign = -1"),
)
_SPEED: Final = (
    _Mistake(3.43, "ft/s or km/h taken as m/s", 'unit = "ft_s" or "km_h"'),  # too near each other to tell
    _Mistake(1.0 / KT, "knots taken as m/s", 'unit = "kt"'),
    _Mistake(1.0 / 3.43, "m/s taken as ft/s or km/h", 'unit = "m_s"'),
    _Mistake(KT, "m/s taken as knots", 'unit = "m_s"'),
)


def problems(log: FlightLog) -> list[Problem]:
    """Everything in a log that physics contradicts; what cannot be judged is left alone.

    Parameters
    ----------
    log : runs with uniform times; channels may break the limits of the contract.
    """
    found = [*_gravity(log), *_magnitudes(log), *_air(log)]
    if any(p.certain and p.channel in ("az_m_s2", "alpha_rad", "q_rad_s", "theta_rad") for p in found):
        return found  # kinematics would only repeat it
    for law in (_attitude, _path, _elevator):
        found += law(log)
        if any(p.certain and p.channel != "altitude_m" for p in found):
            break  # the next law would find the same mistake again
    return found


def _gravity(log: FlightLog) -> Iterator[Problem]:
    az = log.channels.get("az_m_s2")
    if az is None:
        return
    mean = float(np.mean(az))
    ax = log.channels.get("ax_m_s2")
    if abs(mean) < 0.3 * G0 and ax is not None and abs(abs(np.mean(ax)) - G0) < 0.3 * G0:
        yield Problem(
            True, "az_m_s2", f"az_m_s2 averages {mean:.3g} m/s2 and ax_m_s2 {np.mean(ax):.3g}: swapped axes; "
            "exchange the columns of the two"
        )  # fmt: skip
        return
    ratio = mean / -G0
    mistake = _nearest(ratio, _AZ)
    if mistake:
        yield Problem(
            True, "az_m_s2", f"az_m_s2 averages {mean:.3g} m/s2 where flight has about {-G0:.1f}: {mistake.found}; "
            f"set channels.az_m_s2 {mistake.remedy}"
        )  # fmt: skip
    elif not 0.5 < ratio < 2.0:
        what = (
            "gravity was taken out (add offset), or it is another axis"
            if abs(ratio) < 0.5
            else "a wrong unit"
        )
        yield Problem(
            abs(ratio) < 0.2 or ratio < 0.0 or ratio > 5.0, "az_m_s2",
            f"az_m_s2 averages {mean:.3g} m/s2 where flight has about {-G0:.1f}: {what}; correct channels.az_m_s2",
        )  # fmt: skip


def _magnitudes(log: FlightLog) -> Iterator[Problem]:
    for name, most in (
        ("alpha_rad", 1.6),
        ("theta_rad", 1.6),
        ("elevator_rad", 45.0 * DEG),
        ("elevator_command_rad", 1.6),
    ):
        values = log.channels.get(name)
        if values is not None and (peak := float(np.abs(values).max())) > most:
            yield Problem(
                True, name, f"{name} reaches {peak:.3g} rad ({peak / DEG:.0f} deg): degrees taken as radians; "
                f'set channels.{name} unit = "deg"'
            )  # fmt: skip
    q = log.channels.get("q_rad_s")
    if q is not None and (peak := float(np.abs(q).max())) > 10.0:
        yield Problem(
            True, "q_rad_s", f"q_rad_s reaches {peak:.3g} rad/s: degrees taken as radians; "
            'set channels.q_rad_s unit = "deg_s"'
        )  # fmt: skip
    elevator = log.channels.get("elevator_rad")
    if (
        elevator is not None
        and 0.0 < np.ptp(elevator) < 0.05 * DEG
        and q is not None
        and np.ptp(q) > 2.0 * DEG
    ):
        yield Problem(
            False, "elevator_rad", f"elevator_rad moves by {np.ptp(elevator) / DEG:.2g} deg in all while the aircraft "
            'pitches: radians taken as degrees? then set channels.elevator_rad unit = "rad"'
        )  # fmt: skip
    airspeed = log.channels.get("airspeed_m_s")
    if airspeed is not None and not 5.0 < float(np.median(airspeed)) < 700.0:
        yield Problem(
            False,
            "airspeed_m_s",
            f"airspeed_m_s has a median of {np.median(airspeed):.3g} m/s; check its unit",
        )


def _air(log: FlightLog) -> Iterator[Problem]:
    density, altitude = log.channels.get("density_kg_m3"), log.channels.get("altitude_m")
    if density is not None:
        mean = float(np.mean(density))
        if _nearest(mean, (_Mistake(1.0 / SLUG * FT**3, "", ""),)) or mean < 0.004:
            yield Problem(
                True, "density_kg_m3", f"density_kg_m3 averages {mean:.3g} kg/m3: slug/ft3 taken as kg/m3; "
                'set channels.density_kg_m3 unit = "slug_ft3"'
            )  # fmt: skip
            return
        if not 0.01 < mean < 1.5:
            yield Problem(
                mean > 2.0, "density_kg_m3", f"density_kg_m3 averages {mean:.3g} kg/m3; check its unit"
            )
    if altitude is None:
        return
    height = float(np.mean(altitude))
    if not -500.0 < height < 30000.0:
        yield Problem(
            True, "altitude_m", f"altitude_m averages {height:.5g} m: feet taken as metres? "
            'set channels.altitude_m unit = "ft"'
        )  # fmt: skip
    elif density is not None:
        standard = float(density_kg_m3(np.array([height]))[0])
        if abs(mean / standard - 1.0) > 0.3:
            other = float(density_kg_m3(np.array([height * FT]))[0])
            feet = abs(mean / other - 1.0) < 0.15
            sentence = f"density_kg_m3 averages {mean:.3g} where {height:.5g} m has {standard:.3g} kg/m3"
            remedy = (
                'feet taken as metres? set channels.altitude_m unit = "ft"' if feet else "check both units"
            )
            yield Problem(feet, "altitude_m", f"{sentence}: {remedy}")


def _attitude(log: FlightLog) -> Iterator[Problem]:
    """theta' = q."""
    if not {"theta_rad", "q_rad_s", "elevator_rad"} <= log.channels.keys():
        return
    result = _compare(log, lambda c: c["theta_rad"], lambda c, dt: [_integral(c["q_rad_s"], dt)])
    if result is None:
        return
    (ratio,), agreement, _ = result
    mistake = _nearest(ratio, _ANGLE)
    if abs(ratio - 1.0) > NEAR and _alike(log, "alpha_rad"):
        yield Problem(
            True, "theta_rad", f"alpha_rad moves as the integral of q_rad_s and theta_rad by {ratio:.3g} of it: "
            "swapped; exchange the columns of alpha_rad and theta_rad"
        )  # fmt: skip
    elif agreement < FAINT:
        yield Problem(
            True, "q_rad_s", f"theta_rad does not follow the integral of q_rad_s (squared correlation {agreement:.2f}): "
            "one of them is another axis; map pitch rate and pitch attitude"
        )  # fmt: skip
    elif mistake:
        tail = mistake.found
        if mistake.ratio == -1.0:
            both = _sides(log)
            name = "theta_rad" if both == "q_rad_s" else "q_rad_s"
            remedy = "sign = -1"
        elif abs(mistake.ratio) > 1.0:
            name, remedy = ("theta_rad", mistake.remedy.format(deg='"deg"', rad='"rad"'))
            if float(np.ptp(log.channels["theta_rad"])) < 60.0 * DEG:
                name, tail, remedy = "q_rad_s", "radians taken as degrees", 'unit = "rad_s"'
        else:
            name, tail, remedy = "q_rad_s", "degrees taken as radians", 'unit = "deg_s"'
            if float(np.ptp(log.channels["q_rad_s"])) < 60.0 * DEG:
                name, tail, remedy = "theta_rad", "radians taken as degrees", 'unit = "rad"'
        yield Problem(
            agreement > CLEAR, name, f"theta_rad moves by {ratio:.3g} of the integral of q_rad_s: {tail}; "
            f"set channels.{name} {remedy}"
        )  # fmt: skip
    elif abs(ratio - 1.0) > 2.0 * NEAR:
        yield Problem(
            False, "theta_rad", f"theta_rad moves by {ratio:.3g} of the integral of q_rad_s; check both units"
        )


def _alike(log: FlightLog, name: str) -> bool:
    """Whether a channel moves as the integral of q, as theta does."""
    if name not in log.channels:
        return False
    result = _compare(log, lambda c: c[name], lambda c, dt: [_integral(c["q_rad_s"], dt)])
    return result is not None and bool(abs(result[0][0] - 1.0) < 0.1 and result[1] > 0.98)


def _sides(log: FlightLog) -> str:
    """Which of q and theta alpha agrees with, when they have opposite signs."""
    result = _alpha(log)
    return "q_rad_s" if result is not None and result[0][0] > 0.0 else "theta_rad"


def _alpha(log: FlightLog) -> tuple[Array, float, float] | None:
    """alpha = a int q + b int (az + g cos(theta - alpha))/V: (a, b), squared correlation, share."""

    def causes(c: dict[str, Array], dt: float) -> list[Array]:
        fall = (c["az_m_s2"] - c["az_m_s2"].mean()) / c["airspeed_m_s"]
        return [_integral(c["q_rad_s"], dt), _integral(fall, dt)]

    return _compare(log, lambda c: c["alpha_rad"], causes)


def _path(log: FlightLog) -> Iterator[Problem]:
    """alpha' = q + (az + g cos gamma)/V."""
    if not {"alpha_rad", "q_rad_s", "az_m_s2", "airspeed_m_s", "elevator_rad"} <= log.channels.keys():
        return
    result = _alpha(log)
    if result is None:
        return
    (pitch, heave), agreement, share = result
    law = "alpha' = q + (az + g cos gamma)/V"
    seen = f"in {law} the records have {pitch:.3g} q and {heave:.3g} (az + g cos gamma)/V"
    certain = bool(agreement > CLEAR)
    both = _nearest(pitch, _ANGLE)
    if agreement < FAINT:
        yield Problem(
            True, "alpha_rad", f"alpha_rad does not follow {law} (squared correlation {agreement:.2f}): one of "
            "alpha, q and az is another axis; map angle of attack, pitch rate and body z"
        )  # fmt: skip
    elif both and heave / pitch > 0.3:
        remedy = both.remedy.format(deg='"deg"', rad='"rad"')
        yield Problem(
            certain, "alpha_rad", f"{seen}: alpha_rad has {both.found}; set channels.alpha_rad {remedy}"
        )
    elif both and abs(heave) > 0.3:
        swapped = {
            1.0 / DEG: ("radians taken as degrees", '"rad_s"'),
            DEG: ("degrees taken as radians", '"deg_s"'),
        }
        found, unit = next(
            (v for k, v in swapped.items() if np.isclose(abs(both.ratio), k)), ("the other sign", "")
        )
        remedy = (f"unit = {unit}" if unit else "") + (" and sign = -1" if unit and both.ratio < 0 else "")
        yield Problem(
            certain, "q_rad_s", f"{seen}: q_rad_s has {found}; set channels.q_rad_s {remedy or 'sign = -1'}"
        )  # fmt: skip
    elif abs(pitch - 1.0) < 2.0 * NEAR and (speed := _nearest(heave / pitch, _SPEED)):
        yield Problem(
            bool(speed.ratio > 1.0 and agreement > SURE and share > MOVED), "airspeed_m_s",
            f"{seen}: airspeed_m_s looks like {speed.found}; set channels.airspeed_m_s {speed.remedy}",
        )  # fmt: skip
    elif abs(pitch - 1.0) > 2.0 * NEAR or abs(heave - 1.0) > 2.0 * NEAR:
        yield Problem(
            False, "alpha_rad", f"{seen}, both about 1 if units, axes and clocks agree; `airtruth check` says more"
        )  # fmt: skip


def _elevator(log: FlightLog) -> Iterator[Problem]:
    """Trailing edge down pitches the nose down: the sign of elevator in q' with alpha and q held."""
    if not {"alpha_rad", "q_rad_s", "elevator_rad"} <= log.channels.keys():
        return
    rows, left = [], []
    for c, dt in _moving(log):
        s = {name: _smooth(c[name], dt) for name in ("alpha_rad", "q_rad_s", "elevator_rad")}
        rows.append(np.stack([_centred(s[n]) for n in ("elevator_rad", "alpha_rad", "q_rad_s")]))
        left.append(_centred(np.gradient(s["q_rad_s"], dt)))
    if not rows:
        return
    x, y = np.concatenate(rows, axis=1), np.concatenate(left)
    others = x[1:].T
    own = x[0] - others @ np.linalg.lstsq(others, x[0], rcond=None)[0]
    rest = y - others @ np.linalg.lstsq(others, y, rcond=None)[0]
    power = float(np.sqrt((own @ own) * (rest @ rest)))
    if power == 0.0:
        return
    correlation = float(own @ rest) / power
    if correlation > 0.3:
        yield Problem(
            correlation > 0.6, "elevator_rad",
            "elevator_rad, with alpha and q held, pitches the nose up when it moves up in value (correlation "
            f"{correlation:.2f} with q'): trailing edge down must be positive; set channels.elevator_rad sign = -1",
        )  # fmt: skip


def _compare(
    log: FlightLog,
    effect: Callable[[dict[str, Array]], Array],
    causes: Callable[[dict[str, Array], float], Sequence[Array]],
) -> tuple[Array, float, float] | None:
    """Factors (k,) of an effect on its causes, both as the elevator moves them; squared correlation; and
    the share of the effect that the elevator moves.
    """
    lefts, rights, whole = [], [], 0.0
    for c, dt in _moving(log):
        basis = _bank(c["elevator_rad"], dt)
        rows = np.stack([_smooth(x, dt) for x in (effect(c), *causes(c, dt))])
        t = np.linspace(-1.0, 1.0, rows.shape[1])
        trend = np.linalg.qr(np.stack([np.ones_like(t), t]).T)[0]
        basis, rows = (x - (x @ trend) @ trend.T for x in (basis, rows))
        span = np.linalg.svd(basis, full_matrices=False)[2]
        whole += float(rows[0] @ rows[0])
        rows = (rows @ span.T) @ span
        lefts.append(rows[0])
        rights.append(rows[1:])
    if not lefts:
        return None
    y, x = np.concatenate(lefts), np.concatenate(rights, axis=1).T
    if not (y @ y > 0.0 and (x * x).sum() > 0.0):
        return None
    factors = np.linalg.lstsq(x, y, rcond=None)[0]
    left = y - x @ factors
    return np.asarray(factors), float(1.0 - (left @ left) / (y @ y)), float(y @ y) / whole


def _moving(log: FlightLog) -> Iterator[tuple[dict[str, Array], float]]:
    """Channels and sample period of each run in which elevator and pitch rate move."""
    for run in range(len(log.run_ids)):
        rows = log.rows(run)
        if rows.stop - rows.start < 30:
            continue
        c = {name: values[rows] for name, values in log.channels.items()}
        if all(np.isfinite(v).all() for v in c.values()) and np.ptp(c["elevator_rad"]) > 0.0 < np.ptp(
            c["q_rad_s"]
        ):
            yield c, float(log.t_s[rows.stop - 1] - log.t_s[rows.start]) / (rows.stop - rows.start - 1)


def _bank(elevator: Array, dt_s: float) -> Array:
    """The elevator through low-passes of several lengths, as a basis of what it causes."""
    from scipy.signal import lfilter

    rows = [_centred(elevator)]
    for length in _LAGS_S:
        pole = np.exp(-dt_s / length)
        rows.append(lfilter([1.0 - pole], [1.0, -pole], rows[-1]))
    return np.stack([_smooth(r, dt_s) for r in (*rows, _integral(rows[0], dt_s))])


def _smooth(x: Array, dt_s: float) -> Array:
    cutoff = min(_CUTOFF_HZ, 0.2 / dt_s)
    return np.asarray(sosfiltfilt(butter(2, cutoff, fs=1.0 / dt_s, output="sos"), x))


def _centred(x: Array) -> Array:
    return np.asarray(x - x.mean())


def _integral(x: Array, dt_s: float) -> Array:
    return np.concatenate([[0.0], np.cumsum(0.5 * dt_s * (x[1:] + x[:-1]))])


def _nearest(ratio: float, mistakes: Sequence[_Mistake]) -> _Mistake | None:
    if abs(ratio - 1.0) <= NEAR:
        return None
    close = [(abs(ratio / m.ratio - 1.0), m) for m in mistakes]
    distance, best = min(close, key=lambda pair: pair[0])
    return best if distance <= NEAR else None


__all__ = ["Problem", "problems"]
