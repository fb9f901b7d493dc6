"""A mapping as text: each line with what it rests on, and what is in doubt as a comment."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import PITCH_PLANE, SIGNALS
from airtruth.importers.guessing.assignment import CERTAIN, Decision
from airtruth.importers.guessing.candidates import MIXED, CommonTimes
from airtruth.importers.guessing.columns import Column
from airtruth.importers.guessing.evidence import control
from airtruth.importers.guessing.readings import Candidates, Reading
from airtruth.importers.guessing.sides import other_side
from airtruth.importers.guessing.slots import ALL_SLOTS, LATERAL_SLOTS, SLOT_OF
from airtruth.importers.guessing.times import Times, entry
from airtruth.physics.atmosphere import density_kg_m3
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import NEEDED

Array = NDArray[np.float64]

_DENSITY: Final = 0.03
"""Relative error of the density up to which the unit of an altitude may be assumed [-] (judgement: less than that of the air's
temperature, 15 K)."""
_WITNESSES: Final = ("ground_speed", "gps_altitude")
"""Slots that are evidence and no channels."""
_ORDER: Final = tuple(SIGNALS[name].stem for name in PITCH_PLANE)
"""Slots in the order of a log's columns."""
_SIDES: Final = ("elevator", "rudder")
"""Slots of surfaces whose two sides move together."""
_FEW: Final = 3
"""Columns that a comment lists [-] (judgement)."""


@dataclass(frozen=True)
class Proposal:
    """Text of the mapping, and sentences on needed channels that are missing or in doubt, and on optional ones in doubt."""

    lines: tuple[str, ...]
    doubts: tuple[str, ...]
    optional: tuple[str, ...]


class Writer:
    """Writes the decisions on a file."""

    def __init__(
        self,
        decisions: Mapping[str, Decision],
        found: Candidates,
        times: Times,
        grid: CommonTimes,
    ) -> None:
        self.decisions, self.found, self.times, self.grid = decisions, found, times, grid
        self.mapped: set[str] = set()
        self.doubts: list[str] = []
        self.optional: list[str] = []
        self.used: list[Column] = []

    def proposal(self) -> Proposal:
        """Tables of time, channels and what is computed."""
        body = [line for slot in _ORDER for line in self._slot(slot)]
        body += self._velocity()
        body += [line for slot in LATERAL_SLOTS for line in self._slot(slot)]
        body += self._missing()
        if not any(line.startswith("\n[channels.") for line in body):
            body.insert(0, "\n[channels]")
        if self.times.missing:
            self.doubts.append(
                "no time was found; state [time] column and unit, or the sample rate as rate_hz"
            )
        return Proposal((*self.times.table(self.used), *body), tuple(self.doubts), tuple(self.optional))

    def _slot(self, slot: str) -> Iterator[str]:
        decision = self.decisions.get(slot)
        if slot == "density" and decision is None:
            return
        if decision is None:
            if slot == "altitude":
                yield from self._satellites()
            return
        doubt = self._doubt(slot, decision)
        name = decision.reading.channel
        if doubt:
            listed = self.optional if slot in LATERAL_SLOTS else self.doubts
            listed.append(f"{name} is in doubt: {doubt}")
            yield f"\n# [channels.{name}] # in doubt: {doubt}"
            lines = (line for text in self._lines(decision) for line in text.splitlines())
            yield from (f"# {line}" for line in lines if not line.startswith("#"))
            if decision.rival is not None:
                yield f"# rival: {_shown(decision.rival)}"
            return
        self._take(decision.reading)
        if decision.reading.kind == "velocity" or (
            slot in LATERAL_SLOTS and decision.reading.kind == "attitude"
        ):
            return
        if decision.reading.kind == "attitude":
            r = decision.reading
            keys = ", ".join(json.dumps(c.key) for c in r.columns)
            yield f"\n[attitude] # theta from a quaternion\nquaternion = [{keys}]"
            yield f'order = "{r.order}"\nframe = "{r.frame}"'
            yield from self.times.clock(r.column)
        else:
            text = SIGNALS[name].description if name in SIGNALS else _INSTEAD.get(name, "")
            yield f"\n[channels.{name}] # {text}"
            yield from self._lines(decision)
        yield f"# rests on: {self._basis(slot, decision)}"
        if decision.others:
            yield f"# the same in {', '.join(repr(r.column.full) for r in decision.others[:_FEW])}"

    def _take(self, reading: Reading) -> None:
        self.mapped.add(ALL_SLOTS[reading.slot][0])
        self.used += reading.columns

    def _doubt(self, slot: str, decision: Decision) -> str:
        """Why a reading is not used; "" if it is."""
        r = decision.reading
        if r.channel == "height_m" and self._reference() is None:
            return (
                f"{r.column.full!r} counts from a point whose elevation the file does not hold; state reference_m, the "
                "elevation above sea level, and remove the comment signs"
            )
        if r.column.unknown and not r.unit_from:
            return (
                f"the file states the unit {r.column.unknown!r}, which is not known, and its size fits {r.unit!r}; state unit, "
                "and scale if no unit of the list is right"
            )
        if decision.lead >= CERTAIN or (slot == "altitude" and self._harmless(decision)):
            return ""
        odds = f"the odds are {np.exp(max(decision.lead, 0.0)):.2g} to 1"
        if decision.rival is None:
            against = "; ".join(f.words for f in decision.findings if f.log_ratio < 0.0)
            return f"its name fits, and its size or physics does not ({against or odds}); check column, unit and sign"
        if decision.rival.columns == r.columns:
            what = "unit" if decision.rival.unit != r.unit else "sign"
            both = (
                f"{r.unit!r} or {decision.rival.unit!r}"
                if what == "unit"
                else f"sign = {r.sign} or {-r.sign}"
            )
            return f"neither header nor physics decides its {what}, {both} ({odds}); choose one and remove the comment signs"
        return f"another column fits nearly as well ({odds}); choose one and remove the comment signs"

    def _harmless(self, decision: Decision) -> bool:
        """Whether the rival altitude gives nearly the same density."""
        rival = decision.rival
        if rival is None or rival.columns != decision.reading.columns:
            return False
        one, other = (
            float(density_kg_m3(np.clip(np.median(r.values), -500.0, 20000.0)))
            for r in (decision.reading, rival)
        )
        return abs(one / other - 1.0) < _DENSITY

    def _basis(self, slot: str, decision: Decision) -> str:
        r = decision.reading
        parts = [r.named + (", unit stated" if r.unit_from == "stated" and r.named == "named" else "")]
        figures = [f.words for f in decision.findings if f.log_ratio > 1.0]
        if not r.unit_from:
            if decision.lead < CERTAIN:
                parts.append(
                    f"unit assumed: the rival changes the density by less than {100 * _DENSITY:.0f} %"
                )
            else:
                parts.append(
                    "unit measured by its size and what follows" if figures else "unit assumed by its size"
                )
        if figures:
            parts.append("measured: " + "; ".join(figures[:_FEW]))
        return "; ".join(parts)

    def _lines(self, decision: Decision) -> Iterator[str]:
        r = decision.reading
        other = other_side(r, decision.others) if r.slot in _SIDES else None
        if r.kind == "pair":
            yield entry(*r.columns, weights=r.weights)
        else:
            yield entry(*((r.column, other.column) if other is not None else (r.column,)))
        yield f'unit = "{r.unit}"'
        if r.sign < 0:
            yield "sign = -1"
        if r.offset:
            yield f"offset = {r.offset:g}"
        if r.channel == "height_m":
            yield f"reference_m = {self._reference() or 0.0:.1f} # from the satellites' altitude"
        yield from self.times.clock(r.column)

    def _reference(self) -> float | None:
        """Elevation of the point from which a height counts, by the satellites' altitude [m]."""
        one, other = self.decisions.get("altitude"), self.decisions.get("gps_altitude")
        if one is None or other is None or other.lead < CERTAIN:
            return None
        return float(np.median(other.reading.values - one.reading.values))

    def _satellites(self) -> Iterator[str]:
        decision = self.decisions.get("gps_altitude")
        if decision is None or "density" in self.decisions or decision.lead < CERTAIN:
            return
        self.used += decision.reading.columns
        self.mapped.add("altitude_m")
        yield "\n[channels.height_m] # height above sea level, in place of the pressure altitude"
        yield from self._lines(decision)
        yield "reference_m = 0.0"
        yield f"# rests on: {decision.reading.named}; assumed: 100 m from the pressure altitude are 1 % of density"

    def _velocity(self) -> Iterator[str]:
        used = [
            self.decisions[s].reading
            for s in ("airspeed", "alpha")
            if s in self.decisions
            and self.decisions[s].reading.kind == "velocity"
            and ALL_SLOTS[s][0] in self.mapped
        ]
        if not used:
            return
        r = used[0]
        yield "\n[body_velocity] # airspeed and alpha from the velocity in body axes"
        for name, column in zip("uvw" if len(r.columns) == 3 else "uw", r.columns, strict=True):
            yield f"{name} = {json.dumps(column.key)}"
        yield f'unit = "{r.unit}"'
        if r.column.variable:
            yield f"variable = {json.dumps(r.column.variable)}"
        yield from self.times.clock(r.column)
        findings = [
            f.words
            for s in ("airspeed", "alpha")
            if s in self.decisions
            for f in self.decisions[s].findings
            if f.log_ratio > 1.0
        ]
        yield "# rests on: " + "; ".join(
            ["named", *(["measured: " + "; ".join(findings[:_FEW])] if findings else [])]
        )

    def _missing(self) -> Iterator[str]:
        """Channels that a log needs and the guess does not have."""
        doubted = {d.reading.channel for d in self.decisions.values()}
        for name in LONGITUDINAL.required:
            if name in self.mapped:
                continue
            if name == LONGITUDINAL.vane and name not in doubted and set(NEEDED) <= self.mapped:
                for column, why in self.found.synthetic:
                    yield f"\n# {column.full!r} is {why}"
                yield "\n[reconstruct] # no vane: alpha follows from q, az and airspeed\nalpha = true"
                continue
            if name in LONGITUDINAL.surfaces and name not in doubted:
                yield from self._surface(name)
                continue
            if name in doubted or (name == "airspeed_m_s" and self._doubted("airspeed")):
                continue
            yield from self._lacking(name)
        if not {"density_kg_m3", "altitude_m"} & self.mapped:
            self.doubts.append(
                "density_kg_m3 or altitude_m was not found; state a column, or the density as a value"
            )
            yield "\n# [channels.density_kg_m3] # needed, or altitude_m: a column, or a number"
            yield '# value = 1.225\n# unit = "kg_m3"'

    def _lacking(self, name: str) -> Iterator[str]:
        """A channel that no column gives."""
        named = self.found.readings.get(SLOT_OF[name])
        self.doubts.append(
            f"{name}: {named[0].column.full!r} has its name, and no unit and sign fits its size and physics; check what it "
            "holds, and state column, unit and sign"
            if named
            else f"{name} was not found; state its column and unit, or import a file that holds it"
        )
        yield f"\n# [channels.{name}] # needed, not found: {SIGNALS[name].description}"
        yield '# column = "..."\n# unit = "..."'

    def _doubted(self, slot: str) -> bool:
        return slot in self.decisions and ALL_SLOTS[slot][0] not in self.mapped

    def _surface(self, name: str) -> Iterator[str]:
        """Columns that follow the elevator without being an angle."""
        ranked = sorted(self._effects(), key=lambda one: -abs(one[2]))[:_FEW]
        if not ranked:
            yield from self._lacking(name)
            return
        column, why, _ = ranked[0]
        if why == MIXED:
            yield from self._mixed(name)
            return
        self.doubts.append(
            f"{name}: {column.full!r} is {why}; measure the deflection at two of its values and state them as calibration"
        )
        yield f"\n# [channels.{name}] # needed: {column.full!r} is {why}"
        yield from (f"# {line}" for line in entry(column).splitlines())
        finite = column.values[np.isfinite(column.values)]
        low, high = float(finite.min()), float(finite.max())
        yield f"# calibration = [[{low:.6g}, ...], [{high:.6g}, ...]] # value, deflection [deg], trailing edge down positive"
        yield '# unit = "deg"'
        for other, _, effect in ranked:
            yield f"# {other.full!r}: t = {effect:+.1f} of its effect on q'"

    def _mixed(self, name: str) -> Iterator[str]:
        """Surfaces that are elevator and aileron together."""
        mixed = [column for column, why in self.found.surfaces if why == MIXED]
        names = ", ".join(json.dumps(c.key) for c in mixed)
        self.doubts.append(
            f"{name}: {names} are {MIXED.replace('one of ', '')}; state columns, and weights or a calibration of each, "
            "with trailing edge down positive"
        )
        yield f"\n# [channels.{name}] # needed: {names} are {MIXED.replace('one of ', '')}"
        yield f"# columns = [{names}]\n# weights = [0.5, 0.5] # of angles trailing edge down; -0.5 of a mirrored servo"
        yield '# calibration = [[..., ...], [..., ...]] # value, deflection [deg], where they are no angles\n# unit = "deg"'

    def _effects(self) -> Iterator[tuple[Column, str, float]]:
        values = {
            s: d.reading.values
            for s, d in self.decisions.items()
            if s in ("q", "az", "alpha", "airspeed", "theta")
        }
        for column, why in self.found.surfaces:
            x = self.grid.of(column, self.times.clocks)
            if x is None or np.ptp(x) == 0.0:
                continue
            effect = 0.0
            if {"q", "az"} <= values.keys():
                value, std = control({**values, "elevator": x}, self.grid.dt_s)
                effect = value / std if np.isfinite(value) and std > 0.0 else 0.0
            yield column, why, effect


_INSTEAD: Final = {
    "dynamic_pressure_pa": "instead of airspeed_m_s",
    "indicated_airspeed_m_s": "the true airspeed follows from it",
    "calibrated_airspeed_m_s": "the true airspeed follows from it",
    "equivalent_airspeed_m_s": "the true airspeed follows from it",
    "static_pressure_pa": "the pressure altitude follows from it",
    "height_m": "height above a point",
}
"""Quantity -> what it is mapped for."""


def _shown(r: Reading) -> str:
    sign = ", sign = -1" if r.sign < 0 else ""
    return f"{r.channel} = {r.column.full!r}, unit = {r.unit!r}{sign}"


__all__ = ["Proposal", "Writer"]
