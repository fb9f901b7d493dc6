"""The assignment of readings to slots with the most evidence, and how far ahead of its rivals each reading is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.importers.guessing.evidence import RELATIONS, SlotFinding, SlotRelation, compared
from airtruth.importers.guessing.readings import Reading
from airtruth.importers.guessing.sides import are_sides
from airtruth.importers.guessing.slots import ALL_SLOTS, SLOTS

BEAM: Final = 30
"""Assignments that the search keeps [-] (judgement: twice as many give the same ones)."""
PER_SLOT: Final = 14
"""Readings of a slot that the search considers [-] (judgement)."""
HOPELESS: Final = 16.0
"""Evidence behind the best reading of a slot from which a reading is not considered [-] (judgement: 1.6 times what a relation may
give)."""
CERTAIN: Final = 3.0
"""Lead in evidence below which a reading is in doubt [-]: odds of 20 to 1."""
_SYSTEM: Final = {
    **dict.fromkeys(("m_s", "m", "m_s2", "km_h", "mm", "cm", "cm_s", "kg_m3"), "metric"),
    **dict.fromkeys(("ft_s", "ft", "ft_s2", "kt", "slug_ft3"), "us"),
}
"""Unit -> system of units."""
_MIXED: Final = 1.2
"""Loss of a file that mixes degrees and radians, or metres and feet, where it does not state them (judgement)."""
_ONE_SENSOR: Final = 6.0
"""Loss where the axes of one instrument have different units (judgement)."""
_AXES: Final = (("ax", "az"), ("ay", "az"), ("p", "q"), ("r", "q"))
"""Slots of one instrument: accelerometers and gyroscopes."""
_SAME: Final = (0.9, 0.15, 0.15)
"""Least correlation, and largest departures of factor and level, of two sensors of one quantity [-] (judgement)."""

State = Mapping[str, Reading | None]


@dataclass(frozen=True)
class Decision:
    """The reading of a slot.

    lead : evidence over the best rival that differs; rival : that rival, None where the rival is to leave the slot empty.
    findings : relations that bear on it.
    others : readings of further columns that agree with it.
    """

    reading: Reading
    lead: float
    rival: Reading | None
    findings: tuple[SlotFinding, ...]
    others: tuple[Reading, ...]


class AssignmentSearch:
    """A beam search over slots, whose criterion is the sum of the evidence of names, units and physics."""

    def __init__(
        self,
        readings: Mapping[str, Sequence[Reading]],
        dt_s: float,
        slots: Mapping[str, tuple[str, ...]] = SLOTS,
        relations: Sequence[SlotRelation] = RELATIONS,
        given: Mapping[str, Reading] | None = None,
    ) -> None:
        """Readings of the slots that are searched, the relations that are tested, and readings of other slots that are given."""
        self.dt_s = dt_s
        self.relations, self.given = relations, dict(given or {})
        self.readings = {slot: _plausible(readings.get(slot, ())) for slot in slots}
        self._cache: dict[tuple[int, ...], SlotFinding] = {}

    def score(self, state: State) -> float:
        """Evidence of an assignment."""
        used = [r for r in state.values() if r is not None]
        total = sum(r.evidence for r in used) + sum(f.log_ratio for _, f in self.findings(state))
        keys = [(c.full, c.key) for r in used if r.kind == "column" for c in r.columns]
        total -= 30.0 * (len(keys) - len(set(keys)))
        for family in (("rad", "deg"), ("metric", "us")):
            kinds: dict[str, bool] = {}
            for r in used:
                if r.kind != "column":
                    continue
                kind = r.unit.split("_")[0].lstrip("cm") if family[0] == "rad" else _SYSTEM.get(r.unit, "")
                if kind in family:
                    kinds[kind] = kinds.get(kind, False) or not r.unit_from
            total -= _MIXED * (len(kinds) > 1 and any(kinds.values()))
        total -= _ONE_SENSOR * sum(
            bool(one and other and one.unit != other.unit and not (one.unit_from and other.unit_from))
            for one, other in ((state.get(a), state.get(b)) for a, b in _AXES)
        )
        velocity = {r.slot for r in used if r.kind == "velocity"}
        units = {r.unit for r in used if r.kind == "velocity" and r.slot == "airspeed"}
        for r in used:
            if r.kind == "velocity" and "airspeed" in velocity and r.unit not in units:
                total -= 30.0
        return total

    def findings(self, state: State) -> list[tuple[tuple[str, ...], SlotFinding]]:
        """Relations whose slots are all filled."""
        result: list[tuple[tuple[str, ...], SlotFinding]] = []
        if not self.dt_s:
            return result
        filled = {slot: r for slot, r in state.items() if r is not None}
        for number, relation in enumerate(self.relations):
            if not all(slot in filled for slot in relation.needs):
                continue
            used = (*relation.needs, *(s for s in relation.uses if s in filled))
            key = (number, *(id(filled[slot]) for slot in used))
            if key not in self._cache:
                values = {slot: filled[slot].values for slot in used}
                self._cache[key] = relation.test(values, self.dt_s)
            result.append((relation.needs, self._cache[key]))
        return result

    def best(self) -> list[tuple[float, dict[str, Reading | None]]]:
        """Assignments by evidence, the best first."""
        states: list[tuple[float, dict[str, Reading | None]]] = [(0.0, {**self.given})]
        for slot, readings in self.readings.items():
            grown = []
            for _, state in states:
                for reading in (*readings, None):
                    new = {**state, slot: reading}
                    grown.append((self.score(new), new))
            grown.sort(key=lambda one: -one[0])
            states = grown[:BEAM]
        return states

    def decisions(self) -> dict[str, Decision]:
        """Slot -> its reading, with the lead over the best assignment that reads the slot otherwise."""
        states = self.best()
        top, state = states[0]
        result = {}
        for slot, reading in state.items():
            if reading is None or slot in self.given:
                continue
            rivals: list[tuple[float, Reading | None]] = []
            others: dict[int, Reading] = {}
            swapped = [
                (self.score({**state, slot: r}), r) for r in (*self.readings[slot], None) if r is not reading
            ]
            for score, rival in [*swapped, *((s, one[slot]) for s, one in states[1:])]:
                if rival is reading:
                    continue
                if rival is not None and self._alike(reading, rival):
                    if rival.columns != reading.columns:
                        others[id(rival.column)] = rival
                    continue
                rivals.append((score, rival))
            score, rival = max(rivals, key=lambda one: one[0], default=(-np.inf, None))
            found = tuple(f for needs, f in self.findings(state) if slot in needs)
            result[slot] = Decision(reading, top - score, rival, found, tuple(others.values()))
        return result

    def _alike(self, one: Reading, other: Reading) -> bool:
        """Whether two readings are of one quantity: equal but for a sensor's error, or ranked by the source of both."""
        least, factor_off, level_off = _SAME
        if one.columns == other.columns:
            same = one.channel == other.channel or len(ALL_SLOTS[one.slot]) > 1
            return same and bool(np.allclose(one.values, other.values))
        if one.named.startswith("format") and other.named.startswith("format") and one.rank < other.rank:
            return True
        _, factor, share = compared(one.values, other.values, self.dt_s, 1)
        scale = max(abs(float(np.median(one.values))), float(one.values.std()), 1e-9)
        level = abs(float(np.median(one.values) - np.median(other.values))) / scale
        moves = share > least**2 and abs(factor - 1.0) < factor_off
        if moves and are_sides(one, other):  # each surface has a rigging of its own
            return True
        steady = one.slot in ("airspeed", "altitude", "density", "throttle", "gps_altitude", "ground_speed")
        return bool(level < level_off and (moves or steady))


def _plausible(readings: Sequence[Reading]) -> list[Reading]:
    """Readings that physics may still bring to the front, the best first."""
    ranked = sorted(readings, key=lambda r: -r.evidence)
    return [r for r in ranked if r.evidence > ranked[0].evidence - HOPELESS][:PER_SLOT]


__all__ = ["CERTAIN", "AssignmentSearch", "Decision"]
