"""Columns of a log that cannot be what they are named: misspelt, of another unit, copied, constant, frozen."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.channels import LATERAL, SIGNALS
from airtruth.checks.excitation import turns
from airtruth.checks.fault import Fault
from airtruth.checks.rotation import (
    bank_coupling,
    banked,
    given,
    headed,
    pitched,
    rates,
    side_gravity,
    sideslip_turn,
)
from airtruth.checks.spectra import integral
from airtruth.logs.flight_log import Batch, FlightLog
from airtruth.logs.store import STATED_UNITS
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import is_reconstructed
from airtruth.units import G0, UNITS

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

OTHERS: Final = frozenset(
    {
        "flap_rad", "gamma_rad", "latitude_rad", "longitude_rad", "latitude_deg", "longitude_deg",
    }
)  # fmt: skip
"""Columns that resemble a channel and are none: flaps, the flight path and the position."""
SIDE: Final = tuple(n for n in LATERAL if n not in (*MOTION.surfaces, *MOTION.commands))
"""Channels of the lateral motion that move where the aircraft rolls or yaws."""
PITCH: Final = (*LONGITUDINAL.output_channels, "theta_rad", "ax_m_s2")
"""Channels of the longitudinal motion that move where the aircraft pitches."""
ALIKE: Final = 0.84
"""Similarity (`difflib`) above which a column is taken for a misspelt channel; elevator_cmd_rad has 0.89."""
COPIED: Final = 1e-9
"""One minus the correlation of two channels below which one is a copy; float32 of one signal has 1e-13."""
MOVED: Final = 1e-12
"""Standard deviation below which a channel does not move [SI]; rounding of a constant."""
FROZEN_S: Final = 0.25
"""Shortest time of equal samples that counts as frozen [s]."""
FROZEN_SAMPLES: Final = 8
"""Fewest equal samples that count as frozen: coarse instruments repeat some."""
FROZEN_SHARE: Final = 0.15
"""Share of a channel's range by which a frozen stretch must differ from what the other channels require [-]."""
COARSE: Final = (0.2, 4)
"""Share of equal neighbours elsewhere in a run above which a channel is coarse [-], and how many times longer it then has
to be still [-] (judgement): a quantised accelerometer in calm air repeats a value for a quarter of a second.
"""
JUMP: Final = 8.0
"""Jump to or from zero, in robust standard deviations of the channel's steps, that marks a dropout."""
FAR: Final = 3.0
"""Standard deviations of a channel between its median and zero above which a zero is a dropout."""
FEWEST_DROPOUTS: Final = 3
"""Fewest samples in a log that are dropouts: one or two may be real."""

SPIKE: Final = 12.0
"""Distance of an outlier from the median of its neighbours, in robust standard deviations of the channel's steps, and in
distances of nine tenths of the samples."""
SPIKE_SAMPLES: Final = 5
"""Samples of that median: one or two successive samples are an outlier, a real peak has three or more."""
SPIKE_S: Final = 0.2
"""Longest time of these samples [s]: motion of an aircraft lasts longer, and coarser records are not tested (judgement)."""
SPIKE_SHARE: Final = 0.01
"""The least distance of an outlier, as a share of what `SIGNALS` allows [-]: the resolution of a channel is finer (judgement)."""


def names(log: FlightLog) -> Iterator[Fault]:
    """Columns that resemble a channel that the log lacks."""
    recorded = set(MOTION.gyros) <= set(log.channels)
    absent = [n for n in SIGNALS if n not in log.channels and (recorded or n not in LATERAL)]
    for column in log.channels:
        if column in SIGNALS or column.casefold() in OTHERS:
            continue
        near = _resembled(column.casefold(), absent)
        if near is None:
            continue
        name, likeness = near
        yield Fault(
            name, log.run_ids, "name",
            f"{column}: no channel has this name, and the log lacks {name}, which it resembles: the column would "
            f"be ignored; rename it to {name} if it is that channel, in {SIGNALS[name].unit}, or leave it out",
            True, likeness,
        )  # fmt: skip


def _resembled(column: str, absent: list[str]) -> tuple[str, float] | None:
    best: tuple[str, float] | None = None
    for name in absent:
        likeness = difflib.SequenceMatcher(None, column, name).ratio()
        stem = SIGNALS[name].stem
        if column == stem or (column.startswith(stem + "_") and len(column) <= len(name) + 4):
            likeness = max(likeness, 0.95)
        if likeness >= ALIKE and (best is None or likeness > best[1]):
            best = name, likeness
    return best


def units(log: FlightLog) -> Iterator[Fault]:
    """Units in the file's metadata that contradict the names of the columns; unknown units are left alone."""
    stated = log.metadata.get(STATED_UNITS)
    if not isinstance(stated, Mapping):
        return
    for name, unit in stated.items():
        if name not in log.channels or name not in SIGNALS:
            continue
        own, plain = SIGNALS[name], _plain(str(unit))
        if plain == _plain(own.unit) or not any(plain in table for table in UNITS.values()):
            continue
        cure = (
            f'import the file with unit = "{plain}" under [channels.{name}]'
            if plain in UNITS[own.dimension]
            else "rename the column"
        )
        yield Fault(
            name, log.run_ids, "metadata",
            f"{name}: the file's metadata state the unit {unit}, the column's name states {own.unit}; {cure}, or "
            "correct the metadata", True, 1.0,
        )  # fmt: skip


def reconstructed(log: FlightLog) -> Iterator[Fault]:
    """An angle of attack that no vane measured, which the import marks by the columns of its errors."""
    if not is_reconstructed(log.channels):
        return
    vane, *measured = LONGITUDINAL.output_channels
    others = " and ".join(measured)
    yield Fault(
        vane, log.run_ids, "reconstructed",
        f"{vane}: reconstructed from inertial measurements and airspeed, no vane was recorded: gusts are not in it, it "
        f"agrees with {others} by construction, and no error of a vane can be estimated; identify adds its "
        f"uncertainty to the intervals, trace takes {others} as outputs and alpha as a state", False, 1.0,
    )  # fmt: skip


def repeated(log: FlightLog) -> Iterator[Fault]:
    """Runs that hold the samples of an earlier run: they would count as independent evidence."""
    first: dict[str, str] = {}
    copies = []
    for i, run_id in enumerate(log.run_ids):
        values = [np.ascontiguousarray(log.channels[name][log.rows(i)]) for name in sorted(log.channels)]
        if not any(np.ptp(x) > 0.0 for x in values):
            continue
        digest = hashlib.sha256(b"".join(x.tobytes() for x in values))
        earlier = first.setdefault(digest.hexdigest(), run_id)
        if earlier != run_id:
            copies.append((run_id, earlier))
    if copies:
        run_id, earlier = copies[0]
        more = f", and {len(copies) - 1} further runs repeat others" if len(copies) > 1 else ""
        yield Fault(
            "run_id", tuple(run for run, _ in copies), "copy",
            f"run_id: run {run_id!r} has the samples of run {earlier!r}{more}: copies count as independent evidence, and "
            "intervals become too narrow; leave them out", False, float(len(copies)),
        )  # fmt: skip


def _plain(unit: str) -> str:
    """ "deg/s", "m/s^2", "degrees" as the keys of `airtruth.units.UNITS`."""
    text = unit.strip().lower().replace("²", "2").replace("³", "3").replace("^", "").replace("**", "")
    words = {
        "degrees": "deg",
        "degree": "deg",
        "radians": "rad",
        "radian": "rad",
        "sec": "s",
        "knots": "kt",
        "kts": "kt",
    }
    parts = [words.get(part, part) for part in text.replace(" ", "_").replace("/", "_").split("_")]
    return "" if text in ("-", "1") else "_".join(parts)


def copies(batch: Batch, aircraft: Aircraft | None, prescribed: bool = False) -> Iterator[tuple[str, str]]:
    """Pairs of channels that hold the same values, up to a factor and a constant, in every run.

    A surface and its command differ by the declared actuator, unless the surface was prescribed.
    """
    turning = turns(batch.channels, batch.dt_s).all() if MOTION.gyros[0] in batch.channels else False
    named = {n: v for n, v in batch.channels.items() if n in SIGNALS and (turning or n not in LATERAL)}
    moving = {n: v for n, v in named.items() if (v.std(axis=1) > MOVED).all()}
    followed = [
        {c.channel, c.command}
        for c in (*LONGITUDINAL.controls, *MOTION.controls)
        if c in MOTION.controls
        or prescribed
        or aircraft is None
        or getattr(aircraft.file, c.actuator) is None
    ]
    for one, other in combinations(moving, 2):
        pair = {one, other}
        if pair == {"altitude_m", "density_kg_m3"} or pair in followed:
            continue
        a, b = (moving[n] - moving[n].mean(axis=1, keepdims=True) for n in (one, other))
        product = np.einsum("rn,rn->r", a, b) ** 2
        power = np.einsum("rn,rn->r", a, a) * np.einsum("rn,rn->r", b, b)
        if (product > (1.0 - COPIED) * power).all():
            yield one, other


def constant(batch: Batch) -> Iterator[tuple[str, Bools, float]]:
    """Channels that keep one value in runs in which the others move, the runs, and their number."""
    c = batch.channels
    judged = [n for n in (*PITCH, *LONGITUDINAL.surfaces) if n in c]
    still = {n: np.ptp(c[n], axis=1) == 0.0 for n in judged}
    moving = sum((~still[n]).astype(int) for n in judged if n in PITCH)
    aside = c.keys() >= set(MOTION.gyros)
    turning = turns(c, batch.dt_s) if aside else np.zeros(len(batch.run_ids), dtype=np.bool_)
    for name in judged:
        bad = still[name] & (moving > 0)
        if name not in PITCH:
            bad &= ~turning  # a manoeuvre of roll or yaw needs none
        if bad.any():
            yield name, np.asarray(bad), float(bad.sum())
    for name in (n for n in SIDE if n in c and aside):
        bad = turning & (np.ptp(c[name], axis=1) == 0.0)
        if bad.any():
            yield name, np.asarray(bad), float(bad.sum())
    for control in MOTION.controls:
        if {control.channel, control.command} <= c.keys():
            bad = (np.ptp(c[control.channel], axis=1) == 0.0) & (np.ptp(c[control.command], axis=1) > 0.0)
            if bad.any():
                yield control.channel, np.asarray(bad), float(bad.sum())


def dropouts(batch: Batch) -> Iterator[tuple[str, Bools, int]]:
    """Channels with samples of exactly zero amid others, and the runs and number of samples.

    A channel that is about zero (a rate) drops out only where it jumps to zero and back: at rest it may be zero, and so may a
    coarse sample on its way from one sign to the other.
    """
    for name in (*PITCH, "airspeed_m_s", "density_kg_m3", *SIDE):
        x = batch.channels.get(name)
        if x is None:
            continue
        zero = x == 0.0
        bad = np.array([_drops_out(*run) for run in zip(x, zero, strict=True)])
        count = int(zero[bad].sum())
        if count >= FEWEST_DROPOUTS:
            yield name, bad, count


def _drops_out(x: Array, zero: Bools) -> bool:
    if not zero.any() or zero.all():
        return False
    rest = x[~zero]
    if abs(np.median(rest)) > FAR * max(float(rest.std()), 1e-12):
        return True
    steps = np.diff(x)
    inside = ~zero[1:] & ~zero[:-1]
    if not inside.any():
        return False
    usual = max(1.4826 * float(np.median(np.abs(steps[inside]))), 1e-3 * float(np.ptp(x)))
    edges = np.flatnonzero(zero[1:] != zero[:-1]) + 1
    if zero[0]:
        edges = edges[1:]
    starts, ends = edges[:-1:2], edges[1::2]
    before, after = x[starts[: ends.size] - 1], x[ends]
    far = np.minimum(np.abs(before), np.abs(after)) > JUMP * usual
    return bool((far & (before * after > 0.0)).any())


def spikes(batch: Batch) -> Iterator[tuple[str, Bools, int]]:
    """Channels with isolated outliers, and the runs and number of samples.

    An outlier is farther from the median of its neighbours than all of the motion that remains without outliers, and than
    nine tenths of the samples are by far.
    """
    if (SPIKE_SAMPLES - 1) * batch.dt_s > SPIKE_S:
        return
    from scipy.ndimage import median_filter

    for name in (*PITCH, "airspeed_m_s", "altitude_m", *SIDE):
        x = batch.channels.get(name)
        if x is None:
            continue
        smooth = median_filter(x, size=(1, SPIKE_SAMPLES), mode="mirror")
        distance = np.abs(x - smooth)
        usual = 1.4826 * np.median(np.abs(np.diff(x, axis=1)), axis=1)
        most = np.maximum(usual, np.quantile(distance, 0.9, axis=1))
        allowed = SPIKE_SHARE * SIGNALS[name].limit
        out = distance > np.maximum(np.maximum(SPIKE * most, np.ptp(smooth, axis=1)), allowed)[:, None]
        if out.any():
            yield name, out.any(axis=1), int(out.sum())


def frozen(batch: Batch) -> Iterator[tuple[str, Bools, float]]:
    """Channels that stay at one value while the others require a change, and the longest such time [s]."""
    c, dt = batch.channels, batch.dt_s
    required = _required(c, dt)
    fewest = max(FROZEN_SAMPLES, round(FROZEN_S / dt))
    for name, change in required.items():
        x = c[name]
        equal = np.diff(x, axis=1) == 0.0
        bad, longest = np.zeros(len(x), dtype=np.bool_), 0.0
        for run in np.flatnonzero((equal.sum(axis=1) >= fewest) & ~equal.all(axis=1)):
            for start, stop in _still(equal[run], fewest):
                missing = float(np.ptp(change[run, start : stop + 1]))
                scale = max(float(np.ptp(x[run])), float(np.ptp(change[run])))
                if missing > FROZEN_SHARE * scale:
                    bad[run] = True
                    longest = max(longest, (stop - start) * dt)
        if bad.any():
            yield name, bad, longest


def _required(c: Mapping[str, Array], dt_s: float) -> dict[str, Array]:
    """Channels as the others require them, up to a constant and a slope."""
    result = _required_aside(c, dt_s)
    channels = LONGITUDINAL.output_channels
    if not {*channels, "airspeed_m_s"} <= c.keys():
        return result
    of_alpha, of_q, of_az = channels
    alpha, q, az, speed = (c[n] for n in (*channels, "airspeed_m_s"))
    turned = pitched(c, dt_s)
    if "theta_rad" in c:
        result["theta_rad"] = turned
        result[of_q] = np.gradient(c["theta_rad"], dt_s, axis=1)
    attitude = c.get("theta_rad", turned)
    path = integral((az + G0 * np.cos(attitude - alpha)) / speed, dt_s)
    result[of_alpha] = turned + path
    result.setdefault(of_q, np.gradient(alpha - path, dt_s, axis=1))
    result[of_az] = speed * (np.gradient(alpha, dt_s, axis=1) - q)
    return result


def _required_aside(c: Mapping[str, Array], dt_s: float) -> dict[str, Array]:
    """The lateral channels likewise."""
    result: dict[str, Array] = {}
    if not {*MOTION.gyros, "airspeed_m_s"} <= c.keys():
        return result
    of_beta, of_p, of_r, of_phi, of_ay = MOTION.output_channels
    p, q, r, phi, theta = rates(c)
    if of_phi in c:
        result[of_phi] = banked(c, dt_s)
        result[of_p] = np.gradient(phi, dt_s, axis=1) - bank_coupling(q, r, phi, theta)
    if "psi_rad" in c:
        result["psi_rad"] = headed(c, dt_s)
        result[of_r] = np.gradient(np.unwrap(c["psi_rad"], axis=1), dt_s, axis=1)
    if {of_beta, of_ay, of_phi} <= c.keys():
        alpha, speed = given(c, LONGITUDINAL.output_channels[0]), c["airspeed_m_s"]
        turn, pull = sideslip_turn(p, r, alpha), side_gravity(theta, phi)
        push = (c[of_ay] + pull) / speed
        result[of_beta] = integral(turn + push, dt_s)
        slope = np.gradient(c[of_beta], dt_s, axis=1)
        result[of_ay] = speed * (slope - turn) - pull
        result.setdefault(of_r, p * np.sin(alpha) + push - slope)
    return result


def _still(equal: Bools, fewest: int) -> list[tuple[int, int]]:
    """Stretches of equal samples that the resolution of a channel does not explain."""
    found = list(_stretches(equal, fewest))
    inside = sum(stop - start for start, stop in found)
    share, longer = COARSE
    if equal.sum() - inside <= share * (equal.size - inside):
        return found
    return [(start, stop) for start, stop in found if stop - start >= longer * fewest]


def _stretches(equal: Bools, fewest: int) -> Iterator[tuple[int, int]]:
    """First and last sample of stretches of at least so many equal samples."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], equal.astype(np.int8), [0]])))
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        if stop - start >= fewest:
            yield int(start), int(stop)


__all__ = [
    "constant",
    "copies",
    "dropouts",
    "frozen",
    "names",
    "reconstructed",
    "repeated",
    "spikes",
    "units",
]
