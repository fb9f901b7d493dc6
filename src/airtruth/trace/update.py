"""The update: a copy of the declared aircraft with the accepted effects, and the refitted derivatives, in it."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from airtruth.aircraft import FILE, Aircraft
from airtruth.effects.change import AeroTerm, Change
from airtruth.effects.writing import MARK, Corrections, write_aircraft
from airtruth.errors import StoreError
from airtruth.logs import atomic
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


def place(aircraft: Aircraft, out: Path) -> Path:
    """OUT/aircraft/NAME, where the updated aircraft goes.

    Raises
    ------
    StoreError
        If what stands there is the declared aircraft, or anything but an earlier update: nothing of the user's is
        ever replaced.
    """
    folder = out / "aircraft" / aircraft.name
    if aircraft.name in (".", ".."):
        raise StoreError(f"{aircraft.folder}: {aircraft.name!r} names no folder; give the aircraft a name")
    here, declared = folder.resolve(), aircraft.folder.resolve()
    if here == declared or here in declared.parents or declared in here.parents:
        raise StoreError(f"{folder}: the declared aircraft itself stands there; choose another --out")
    if folder.exists() and any(folder.iterdir() if folder.is_dir() else [folder]) and not _is_update(folder):
        raise StoreError(f"{folder}: exists and is not an earlier update of a trace; choose another --out")
    return folder


def _is_update(folder: Path) -> bool:
    try:
        return MARK in (folder / FILE).read_text(encoding="utf-8")
    except OSError:
        return False


def write_update(
    case: Case, stages: Sequence[Stage], aircraft: Aircraft, out: Path, refitted: bool
) -> str | None:
    """Write the updated aircraft to OUT/aircraft/NAME; None where no effect was accepted.

    An earlier update in that place is replaced, by a whole one or by none. An aircraft without a JSBSim model
    takes effects of its sensors only; others need a model first (`airtruth aircraft new`).

    Parameters
    ----------
    refitted : write the increments of the derivatives too; those that an effect sets free are always written.

    Raises
    ------
    AircraftError, StoreError
        If the model cannot take the effect, or the folder cannot be written; as `place`.
    """
    folder = place(aircraft, out)
    change = accepted_change(stages)
    if change == Change() or (aircraft.file.jsbsim is None and change.in_aircraft):
        _remove(folder)
        return None
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
    atomic.make_folder(folder.parent)
    try:
        with tempfile.TemporaryDirectory(prefix=".new-", dir=folder.parent) as beside:
            made = write_aircraft(aircraft, change, Path(beside) / folder.name, note, corrections)
            _remove(folder)
            made.rename(folder)
    except OSError as error:
        raise atomic.write_error(folder, error) from None
    return str(folder)


def _remove(folder: Path) -> None:
    if folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError as error:
            raise atomic.write_error(folder, error) from None
