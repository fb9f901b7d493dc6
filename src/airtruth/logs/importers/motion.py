"""Signs, units and axes of a log, held against the kinematics of its motion.

Motions that the elevator causes are compared, so that gusts, which move a vane and no gyro, do not bend
the comparison.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, lfilter, sosfiltfilt

from airtruth.logs.flight_log import FlightLog
from airtruth.logs.importers.mistakes import NEAR, Mistake, Problem, nearest
from airtruth.units import DEG, KT

Array = NDArray[np.float64]

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


_ANGLE: Final = (
    Mistake(-1.0, "the other sign", "sign = -1"),
    Mistake(1.0 / DEG, "degrees taken as radians", "unit = {deg}"),
    Mistake(DEG, "radians taken as degrees", "unit = {rad}"),
    Mistake(-1.0 / DEG, "degrees taken as radians, and the other sign", "unit = {deg} and sign = -1"),
    Mistake(-DEG, "radians taken as degrees, and the other sign", "unit = {rad} and sign = -1"),
)
_SPEED: Final = (
    Mistake(3.43, "ft/s or km/h taken as m/s", 'unit = "ft_s" or "km_h"'),  # too near each other to tell
    Mistake(1.0 / KT, "knots taken as m/s", 'unit = "kt"'),
    Mistake(1.0 / 3.43, "m/s taken as ft/s or km/h", 'unit = "m_s"'),
    Mistake(KT, "m/s taken as knots", 'unit = "m_s"'),
)


def attitude(log: FlightLog) -> Iterator[Problem]:
    """theta' = q."""
    if not {"theta_rad", "q_rad_s", "elevator_rad"} <= log.channels.keys():
        return
    result = _compare(log, lambda c: c["theta_rad"], lambda c, dt: [_integral(c["q_rad_s"], dt)])
    if result is None:
        return
    (ratio,), agreement, _ = result
    mistake = nearest(ratio, _ANGLE)
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


def path(log: FlightLog) -> Iterator[Problem]:
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
    both = nearest(pitch, _ANGLE)
    if agreement < FAINT:  # gusts that drown the manoeuvre look the same
        yield Problem(
            False, "alpha_rad", f"alpha_rad does not follow {law} (squared correlation {agreement:.2f}): one of "
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
    elif abs(pitch - 1.0) < 2.0 * NEAR and (speed := nearest(heave / pitch, _SPEED)):
        yield Problem(
            bool(speed.ratio > 1.0 and agreement > SURE and share > MOVED), "airspeed_m_s",
            f"{seen}: airspeed_m_s looks like {speed.found}; set channels.airspeed_m_s {speed.remedy}",
        )  # fmt: skip
    elif certain and (abs(pitch - 1.0) > 2.0 * NEAR or abs(heave - 1.0) > 2.0 * NEAR):
        yield Problem(
            False, "alpha_rad", f"{seen}, both about 1 if units, axes and clocks agree; `airtruth check` says more"
        )  # fmt: skip


def elevator_sign(log: FlightLog) -> Iterator[Problem]:
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


__all__ = ["attitude", "elevator_sign", "path"]
