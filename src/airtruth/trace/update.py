"""The update: a copy of the declared aircraft with the accepted effects, and the refitted derivatives, in it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from airtruth.aircraft import Aircraft
from airtruth.effects.change import AeroTerm, Change
from airtruth.effects.writing import Corrections, write_aircraft
from airtruth.physics.short_period import PARAMETERS
from airtruth.trace.prepare import Case
from airtruth.trace.search import Stage


def accepted_change(stages: Sequence[Stage]) -> Change:
    """What the accepted effects change at their estimated sizes."""
    final = stages[-1].gls
    return final.hypothesis.added(final.point.sizes)


def _counted_from_zero(term: AeroTerm, counted_from_rad: float) -> AeroTerm:
    """A term of the angle of attack that the linear model counts from a record's own trim, as an aircraft has it."""
    return replace(term, at=term.at + counted_from_rad) if term.signal == "alpha" else term


def write_update(
    case: Case, stages: Sequence[Stage], aircraft: Aircraft, out: Path, refitted: bool
) -> str | None:
    """Write the updated aircraft to OUT/aircraft/NAME; None where no effect was accepted.

    An earlier update in that place is replaced. An aircraft without a JSBSim model takes effects of its
    sensors only; others need a model first (`airtruth aircraft new`).

    Parameters
    ----------
    refitted : write the increments of the derivatives too; those that an effect sets free are always written.

    Raises
    ------
    AircraftError, StoreError
        If the model cannot take the effect, or the folder cannot be written.
    """
    change = accepted_change(stages)
    if change == Change():
        return None
    if aircraft.file.jsbsim is None and change.in_aircraft:
        return None
    folder = out / "aircraft" / aircraft.name
    if folder.exists():
        shutil.rmtree(folder)
    plants = [record.plant for record in case.fitted.records]
    counted_from = float(np.mean([p.alpha_shift_rad for p in plants]))
    change = replace(change, aero=tuple(_counted_from_zero(t, counted_from) for t in change.aero))
    increments = dict(zip(PARAMETERS, stages[-1].gls.point.shared[:6].tolist(), strict=True))
    corrections = None
    if not refitted:
        increments = {PARAMETERS[i]: increments[PARAMETERS[i]] for i in stages[-1].gls.hypothesis.loose}
    if increments and aircraft.file.jsbsim is not None and np.isfinite(list(increments.values())).all():
        elevator = float(np.mean([p.trim_elevator_rad for p in plants]))
        corrections = Corrections(increments, plants[0].trim_alpha_rad + counted_from, elevator)
    names = ", ".join(e.key for e in stages[-1].gls.hypothesis.effects)
    note = f"Traced from measured records: {names}."
    if corrections is not None:
        note += " Derivatives refitted: " + ", ".join(f"{k} {v:+.4g}" for k, v in increments.items()) + "."
    return str(write_aircraft(aircraft, change, folder, note, corrections))
