"""Possible readings of each column, with the evidence of their name, unit and size."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import ATTITUDE, LATERAL
from airtruth.importers.attitude import continuous, euler_angles
from airtruth.importers.dictionary import (
    DIMENSIONS,
    QUATERNION,
    VELOCITY,
    DictionaryEntry,
    Lexicon,
    Words,
    compact,
)
from airtruth.importers.guessing.columns import Column, GroupClock
from airtruth.importers.guessing.readings import Candidates, Reading
from airtruth.importers.guessing.sides import mixed_with, pair
from airtruth.importers.guessing.slots import ALL_SLOTS, OPPOSITE, SIGN, SIGNED, SLOT_OF, size_of
from airtruth.importers.uniform import gaps
from airtruth.physics.atmosphere import altitude_of_pressure_m
from airtruth.physics.motion import LATERAL as MOTION
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import UNITS

Array = NDArray[np.float64]

_MULTIPLE, _SELDOM = 0.02, {"km_h": 0.1}
"""Frequency of a multiple of a unit (1/100 deg, mm) over that of others, where a file states no unit, and of a unit that few
recorders have [-] (judgement)."""
_NEVER_ASSUMED: Final = ("k", "degc", "degf", "in", "mrad", "mrad_s", "mph", "fl")
"""Units that are taken only where a file states them: temperatures, inches, milliradians, miles, flight levels (judgement)."""
FORMAT, EXACT, TRIMMED, PER_WORD = 12.0, 6.0, 5.0, 0.3
"""Logarithm of the evidence of a column that the format defines, of a name, of one among known words, and the loss for each of
them (judgement: one column of 150 000, of 400, of 150 has it by chance)."""
_RANK, _SECOND, OWN = 0.7, 0.3, 10.0
"""Loss for each rank of a column, and of a channel within its slot; evidence of a name of the user's own (judgement)."""
MIXED: Final = "one of several surfaces that are elevator and aileron together"
"""Why an elevon is no elevator."""


@dataclass(frozen=True)
class CommonTimes:
    """Common times on which readings are compared [s]; the step is 0 where the file has no times, and t_s counts rows.

    Attributes
    ----------
    pauses_s : (pauses, 2) end of each pause of all columns, and the time by which the comparison closes it [s].
    """

    t_s: Array
    dt_s: float
    pauses_s: Array = field(default_factory=lambda: np.zeros((0, 2)))

    def of(self, column: Column, clocks: Mapping[str, GroupClock], turn: float = 0.0) -> Array | None:
        """Values of a column on the grid; None where it has no times or hardly any value. ``turn`` is the jump of an angle."""
        t = times_of(column, clocks) if self.dt_s else np.arange(float(len(column.values)))
        if t is None or len(t) != len(column.values):
            return None
        t = without_pauses(rising(t), self.pauses_s)
        ok = np.isfinite(t) & np.isfinite(column.values)
        if ok.sum() < 4:
            return None
        t, x = t[ok], column.values[ok]
        order = np.argsort(t, kind="stable")
        x = continuous(x[order], turn) if turn else x[order]
        return np.asarray(np.interp(self.t_s, t[order], x))


def times_of(column: Column, clocks: Mapping[str, GroupClock]) -> Array | None:
    """Times of a column [s]: its own, those of its group, or those of the file."""
    if column.t_s is not None:
        return column.t_s
    clock = clocks.get(column.group) or clocks.get("")
    if clock is None and len(clocks) == 1:
        clock = next(iter(clocks.values()))
    return clock.t_s if clock is not None and len(clock.t_s) == len(column.values) else None


def rising(t: Array) -> Array:
    """Times without the steps back of a counter that wraps or restarts, for comparisons between channels [s]."""
    steps = np.diff(t)
    if not len(steps) or not (steps < 0.0).any():
        return t
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 1.0
    return np.concatenate([t[:1], t[0] + np.cumsum(np.where(steps < 0.0, usual, steps))])


def pauses_of(t_s: Array) -> Array:
    """(pauses, 2) end of each pause between samples, and the time beyond a usual step that it lasts [s].

    A recorder that pauses between manoeuvres flies another one afterwards: a line between both is no motion.

    Parameters
    ----------
    t_s : times of all columns, ascending and each once [s].
    """
    found = gaps(t_s)
    usual = float(np.median(np.diff(t_s))) if found else 0.0
    return np.array([(end, end - start - usual) for start, end in found]).reshape(-1, 2)


def without_pauses(t_s: Array, pauses_s: Array) -> Array:
    """Times with the pauses of all columns closed, see `pauses_of` [s]."""
    closed = np.concatenate([[0.0], np.cumsum(pauses_s[:, 1])])
    return np.asarray(t_s - closed[np.searchsorted(pauses_s[:, 0], t_s, side="right")])


def candidates(
    columns: Sequence[Column], words: Lexicon, grid: CommonTimes, clocks: Mapping[str, GroupClock]
) -> Candidates:
    """Every reading that names, units and ranges allow."""
    found, parts_of_pairs = Candidates(), Candidates()
    parts: dict[tuple[str, str], Column] = {}
    turned: dict[tuple[str, DictionaryEntry, str], dict[int, Column]] = {}
    forward, down = ({c.group for c in columns if compact(c.name) in (x, x + "body")} for x in "uw")
    velocities = forward & down
    for column in columns:
        known = words.entry(column.full)
        if known is not None:
            entry, part = known
            if entry.quaternion:
                numbers = [
                    i for i, one in enumerate(entry.match) if DictionaryEntry((one,)).matches(column.full)
                ]
                turned.setdefault((column.group, entry, part.title), {})[numbers[0]] = column
            elif entry.synthetic:
                found.synthetic.append((column, entry.refuse or ""))
            elif entry.surface:
                found.surfaces.append((column, entry.surface))
            elif entry.refuse is not None:
                if entry.refuse:
                    found.refused.append((column, entry.refuse, ""))
            elif entry.channel != "t_s":
                evidence = FORMAT - _RANK * (entry.rank - 1)
                _read(found, column, entry.channel, evidence, f"format {part.title}", grid, clocks, entry)
            continue
        for channel, evidence, reason in _meanings(column, words):
            if channel == "elevon_rad":
                found.surfaces.append((column, MIXED))
                for surface in () if reason else (*LONGITUDINAL.surfaces, mixed_with(column.name)):
                    _read(parts_of_pairs, column, surface, evidence, "named", grid, clocks, None)
            elif channel in (*QUATERNION, *VELOCITY):
                parts.setdefault((column.group, channel), column)
                if channel != "v_m_s" or column.group in velocities:
                    break
            elif reason and channel.startswith("elevator") and reason[1]:
                found.surfaces.append((column, reason[0]))
            elif reason and channel not in LATERAL:
                found.refused.append((column, reason[0], channel))
            elif reason:
                continue
            elif channel != "t_s" and not (compact(column.name) == "v" and column.group in velocities):
                _read(found, column, channel, evidence, "named", grid, clocks, None)
    for (_, entry, title), components in turned.items():
        if len(components) == 4:
            four = tuple(components[i] for i in range(4))
            _attitude(found, four, entry.quaternion, title, grid, clocks)
    for group in {group for group, _ in parts}:
        four = tuple(parts[group, name] for name in QUATERNION if (group, name) in parts)
        if len(four) == 4:
            _attitude(found, four, "wxyz", "", grid, clocks)
        if (group, "u_m_s") in parts and (group, "w_m_s") in parts:
            three = tuple(parts[group, name] for name in VELOCITY if (group, name) in parts)
            _velocity(found, three, grid, clocks)
    pair(found, parts_of_pairs, MIXED)
    return found


def _tokens(name: str) -> Iterator[list[str]]:
    """Words of a name: by camel case, and by punctuation alone."""
    rough = [w for w in re.split(r"[\W_]+", name) if w]
    camel = [t for w in rough for t in re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+", w)]
    yield [t.lower() for w in rough for t in re.findall(r"[^\W\d]+|\d+", w)]
    yield [t.lower() for t in camel]


def _meanings(column: Column, words: Lexicon) -> Iterator[tuple[str, float, tuple[str, bool] | None]]:
    """Possible meanings of a name, its evidence, and why it is something else (and whether it still is a surface's motion)."""
    whole = compact(column.name)
    exact = words.meanings(whole)
    topic = [t for t in re.split(r"[\W_]+", column.group.lower()) if t] if not column.variable else []
    context, refused = words.context, words.refused
    spoiled = next((refused[t] for t in topic if t in refused), None)
    if exact:
        own = words.parts[0].title == Words.title and whole in words.parts[0].names
        for channel in exact:
            yield channel, OWN if own else EXACT, (spoiled, False) if spoiled else None
        return
    best: dict[str, tuple[float, tuple[str, bool] | None]] = {}
    for tokens in _tokens(column.name):
        for start in range(len(tokens)):
            for end in range(len(tokens), start, -1):
                outside = tokens[:start] + tokens[end:]
                channels = words.meanings("".join(tokens[start:end]))
                if not channels:
                    continue
                other = [t for t in outside if t not in context and not t.isdigit() and t not in refused]
                reason = next((refused[t] for t in outside if t in refused), spoiled)
                if other and not reason:
                    continue
                is_surface = bool({"pwm", "norm"} & set(outside))
                for channel in channels:
                    evidence = TRIMMED - PER_WORD * len(outside)
                    if channel not in best or evidence > best[channel][0]:
                        best[channel] = (evidence, (reason, is_surface) if reason else None)
    for channel, (evidence, why) in best.items():
        yield channel, evidence, why


def _read(
    found: Candidates,
    column: Column,
    channel: str,
    evidence: float,
    named: str,
    grid: CommonTimes,
    clocks: Mapping[str, GroupClock],
    entry: DictionaryEntry | None,
) -> None:
    """Add the readings of a column as a channel: units that are not excluded, and both signs."""
    slot = SLOT_OF.get(channel)
    if slot is None:
        return
    finite = column.values[np.isfinite(column.values)]
    if not len(finite):
        return
    if not finite.any():
        if channel not in ("height_m", "throttle"):
            found.zero.append((channel, column))
        return
    raw = grid.of(column, clocks)
    if raw is None:
        return
    table = UNITS[DIMENSIONS[channel]]
    stated = entry.unit if entry is not None else column.unit.name if column.unit else ""
    if column.unit is not None and entry is None and stated not in table:
        return
    fixed = (
        column.unit.sign if column.unit is not None and column.unit.sign < 0 else entry.sign if entry else 0
    )
    evidence -= _SECOND * ALL_SLOTS[slot].index(channel)
    likelihoods = {stated: 0.0} if stated else _likelihoods(table)
    signs = (fixed,) if fixed else (1, -1) if slot in SIGNED else (1,)
    offset = entry.offset if entry is not None else 0.0
    for unit, likely in likelihoods.items():
        if channel in ATTITUDE:
            raw = grid.of(column, clocks, 2.0 * np.pi / table[unit])
            assert raw is not None
        for sign in signs:
            with np.errstate(over="ignore"):  # an absurd size has a factor that no unit explains
                values = _physical(channel, sign * table[unit] * (raw + offset))
            turned = SIGN.get(slot, OPPOSITE)
            signed = (
                0.0
                if fixed
                else float(np.log(turned if sign < 0 else 1.0 - turned))
                if len(signs) > 1
                else 0.0
            )
            where = stated if not stated else ("format" if entry else "stated")
            found.readings.setdefault(slot, []).append(
                Reading(slot, channel, (column,), unit, sign, values, evidence + likely + signed + size_of(slot, values),
                        named, where, offset=offset, rank=entry.rank if entry else 1)
            )  # fmt: skip


def _likelihoods(table: Mapping[str, float]) -> dict[str, float]:
    """Unit -> logarithm of its frequency, where a file states none."""
    units = [unit for unit in table if unit not in _NEVER_ASSUMED]
    multiples = {u for u in units if u[1:] in table and u[:1] in ("c", "m", "k")}
    frequency = np.array([_MULTIPLE if u in multiples else _SELDOM.get(u, 1.0) for u in units])
    return dict(zip(units, np.log(frequency / frequency.sum()).tolist(), strict=True))


def _physical(channel: str, values: Array) -> Array:
    """Values as those of the slot: an airspeed of a dynamic pressure, an altitude of a static one."""
    if channel == "dynamic_pressure_pa":
        return np.sqrt(2.0 * np.maximum(values, 0.0) / 1.225)
    if channel == "static_pressure_pa":
        return np.asarray(altitude_of_pressure_m(np.clip(values, 5500.0, 110000.0)))
    return values


def _attitude(
    found: Candidates,
    four: tuple[Column, ...],
    order: str,
    title: str,
    grid: CommonTimes,
    clocks: Mapping[str, GroupClock],
) -> None:
    evidence = FORMAT if title else EXACT
    parts = [grid.of(column, clocks) for column in four]
    if any(p is None for p in parts):
        return
    rows = np.stack([p for p in parts if p is not None])
    stacked = rows if order == "wxyz" else rows[[3, 0, 1, 2]]
    if not (np.abs(np.sqrt((stacked**2).sum(axis=0)) - 1.0) < 0.05).all():
        return
    for frame, loss in (("ned", 0.0),) if title else (("ned", 0.3), ("enu", 1.4)):
        angles = euler_angles(stacked, frame=frame)  # type: ignore[arg-type]
        for slot, angle in zip(("phi", "theta", "psi"), angles, strict=True):
            reading = Reading(
                slot, f"{slot}_rad", four, "rad", 1, angle if slot == "theta" else np.unwrap(angle), evidence - loss,
                f"format {title}" if title else "named", "stated", kind="attitude", order=order, frame=frame,
            )  # fmt: skip
            found.readings.setdefault(slot, []).append(reading)


def _velocity(
    found: Candidates, three: tuple[Column, ...], grid: CommonTimes, clocks: Mapping[str, GroupClock]
) -> None:
    u, w = grid.of(three[0], clocks), grid.of(three[-1], clocks)
    if u is None or w is None:
        return
    table = UNITS["speed"]
    stated = three[0].unit.name if three[0].unit and three[0].unit.name in table else ""
    for unit, likely in ({stated: 0.0} if stated else _likelihoods(table)).items():
        v = grid.of(three[1], clocks) if len(three) > 2 else None
        made = [
            ("airspeed", "airspeed_m_s", np.hypot(u, w) * table[unit]),
            ("alpha", LONGITUDINAL.vane, np.arctan2(w, u)),
        ]
        if v is not None:
            made.append(("beta", MOTION.vane, np.arctan2(v, np.hypot(u, w))))
        for slot, channel, values in made:
            found.readings.setdefault(slot, []).append(
                Reading(slot, channel, three, unit, 1, values, EXACT - 1.0 + likely + size_of(slot, values), "named",
                        "stated" if stated else "", kind="velocity")
            )  # fmt: skip


__all__ = ["MIXED", "CommonTimes", "candidates", "pauses_of", "rising", "times_of", "without_pauses"]
