"""The updated aircraft: a copy of the declared one with the accepted effects and the refitted derivatives."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np

from airtruth.aircraft import FILE, Aircraft
from airtruth.aircraft.corrected import write_corrected
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.aircraft.write import MARK, Corrections, write_aircraft
from airtruth.effects.increment import Increment
from airtruth.errors import StoreError
from airtruth.logs import atomic
from airtruth.physics.short_period import PARAMETERS
from airtruth.physics.terms import DECLARED, AeroTerm, Change, ReadingTerm, SensorTerm, declared_total
from airtruth.tracing.accepted import AcceptedEffect, IncrementTable
from airtruth.tracing.axial_force import AxialForce
from airtruth.tracing.increment_table import increment_table
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.robust import robust_covariance
from airtruth.tracing.model.parameters import Common
from airtruth.tracing.model.response import moved_past_sensors_m
from airtruth.tracing.model.settings import VANE
from airtruth.tracing.prepare import Case
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.units import G0

WITHOUT_EFFECTS: Final = "without_effects"
"""Folder beside that of the updated aircraft: one without a JSBSim model, as it flies without the accepted effects."""
_WITH_ARM: Final = (VANE, "az_m_s2")
"""Channels whose reading depends on where their sensor is."""
_Term = TypeVar("_Term", AeroTerm, ReadingTerm)


def accepted_change(case: Case, rounds: Sequence[SearchRound], chord_m: float) -> Change:
    """The accepted effects at their estimated sizes, with sensors that a shift of the CG has moved relative to it."""
    final = rounds[-1].reported
    change = final.hypothesis.added(final.point.sizes)
    shift = declared_total(change.declared, "cg")
    if shift == DECLARED["cg"]:
        return change
    moved_m = moved_past_sensors_m(final.point.common, shift, chord_m)
    arms = (SensorTerm(c, "arm", moved_m) for c in _WITH_ARM if c != VANE or case.has_vane)
    return replace(change, sensors=(*change.sensors, *arms))


def updated_folder(aircraft: Aircraft, out: Path) -> Path:
    """OUT/aircraft/NAME, the folder of the updated aircraft.

    Raises
    ------
    StoreError
        If it, or `WITHOUT_EFFECTS` beside it, contains the declared aircraft, lies inside it, or holds anything but an
        earlier update: no file of the user is ever replaced.
    """
    if aircraft.name in (".", ".."):
        raise StoreError(f"{aircraft.folder}: {aircraft.name!r} names no folder; give the aircraft a name")
    folder, without = (out / name / aircraft.name for name in ("aircraft", WITHOUT_EFFECTS))
    for each in (folder, *([without] if aircraft.file.jsbsim is None else [])):
        _require_free(each, aircraft)
    return folder


def _require_free(folder: Path, aircraft: Aircraft) -> None:
    here, declared = folder.resolve(), aircraft.folder.resolve()
    if here == declared or here in declared.parents:
        raise StoreError(f"{folder}: holds the declared aircraft itself; choose another --out")
    if declared in here.parents:
        raise StoreError(f"{folder}: lies inside the folder of the declared aircraft; choose another --out")
    if folder.exists() and any(folder.iterdir() if folder.is_dir() else [folder]) and not _is_update(folder):
        raise StoreError(f"{folder}: exists and is not an earlier update of a trace; choose another --out")


def _is_update(folder: Path) -> bool:
    try:
        return MARK in (folder / FILE).read_text(encoding="utf-8")
    except OSError:
        return False


def write_update(
    case: Case,
    rounds: Sequence[SearchRound],
    aircraft: Aircraft,
    out: Path,
    refit: bool = False,
    axial: AxialForce | None = None,
) -> str | None:
    """Write the aircraft with the accepted effects and the refitted derivatives to OUT/aircraft/NAME.

    A complete new folder replaces an earlier update, or nothing changes. An aircraft without a JSBSim model is written
    in any case, with a JSBSim model of the refitted derivatives; OUT/without_effects/NAME is the same without the effects,
    which a plan flies.

    Parameters
    ----------
    refit : whether the refitted derivatives are written although no effect was accepted: the records contradict the
        declared ones, or determine them better.
    axial : increments of CX that ax shows; None for none.

    Returns
    -------
    The folder; None where nothing of an aircraft with a JSBSim model is to be changed.

    Raises
    ------
    AircraftError, StoreError
        If the model cannot take the effect, or the folder cannot be written; as `updated_folder`.
    """
    folder = updated_folder(aircraft, out)
    change = accepted_change(case, rounds, aircraft.constants.chord_m)
    along = () if axial is None else axial.increments
    change += Change() if axial is None else axial.change
    released = rounds[-1].null.hypothesis.spread is not None
    if change == Change() and not (released or refit) and aircraft.file.jsbsim is not None:
        atomic.remove_folder(folder)
        return None
    fit = rounds[-1].reported
    plants = [record.plant for record in case.fitted.records]
    shift = case.fitted.alpha_shift_rad
    change = from_zero_alpha(change, shift)
    increments = dict(zip(PARAMETERS, fit.point.common[Common.derivatives].tolist(), strict=True))
    release = rounds[-1].release
    causes = release.sets[0].effects if released and release is not None else ()
    names = dict.fromkeys([*(e.key for e in fit.hypothesis.effects), *(e.key for e in along), *causes])
    found = ", ".join(names) or "no effect of the library"
    note = f"Traced from measured records: {found}."
    corrections = None
    refitted = bool(np.isfinite(list(increments.values())).all())
    alpha = float(np.mean([p.trim_alpha_rad for p in plants])) + shift
    elevator = float(np.mean([p.trim_elevator_rad for p in plants]))
    if refitted:
        aircraft = _with_derivatives(aircraft, increments)
        note += " Derivatives refitted: " + ", ".join(f"{k} {v:+.4g}" for k, v in increments.items()) + "."
    note += "".join(f"\n{line}" for line in (*_bands(case, fit), *map(_band, along)))
    if aircraft.file.jsbsim is None:
        at = _measured_trim(case, alpha, elevator)
        _write_flying(_with_std(aircraft, case, fit), at, change, folder, note)
        _write_flying(aircraft, at, Change(), folder.parents[1] / WITHOUT_EFFECTS / aircraft.name, note)
        return str(folder)
    if refitted:
        corrections = Corrections(increments, alpha, elevator)
    with atomic.new_folder(folder) as new:
        write_aircraft(aircraft, change, new, note, corrections)
    return str(folder)


def _measured_trim(case: Case, alpha_rad: float, elevator_rad: float) -> TrimPoint:
    """The trim of the fitted records, in level flight."""
    signals = [record.signals for record in case.fitted.records]
    return TrimPoint(
        airspeed_m_s=float(np.mean([s.airspeed_m_s[0] for s in signals])),
        density_kg_m3=float(np.mean([s.density_kg_m3[0] for s in signals])),
        alpha_rad=alpha_rad,
        elevator_rad=elevator_rad,
        az_m_s2=-G0 * math.cos(alpha_rad),
    )


def _write_flying(aircraft: Aircraft, at: TrimPoint, change: Change, folder: Path, note: str) -> None:
    with atomic.new_folder(folder) as new:
        write_corrected(aircraft, aircraft.file.derivatives, at, change, new, note)


def _with_std(aircraft: Aircraft, case: Case, fit: PosteriorFit) -> Aircraft:
    """The aircraft with the standard deviations of the refitted derivatives, which contain the declared ones."""
    std = np.sqrt(np.diag(robust_covariance(case.fitted, fit))[Common.derivatives])
    refitted = {
        name: aircraft.file.derivatives[name].model_copy(update={"std": float(value)})
        for name, value in zip(PARAMETERS, std, strict=True)
    }
    file = aircraft.file.model_copy(update={"derivatives": refitted})
    return aircraft.model_copy(update={"file": file})


def _with_derivatives(aircraft: Aircraft, increments: Mapping[str, float]) -> Aircraft:
    """The aircraft with other [derivatives]: all that one without a JSBSim model has, and beside a model what it flies."""
    declared = aircraft.file.derivatives
    moved = {
        name: q.model_copy(
            update={"value": q.value + increments.get(name, 0.0), "source": "refitted by a trace"}
        )
        for name, q in declared.items()
    }
    file = aircraft.file.model_copy(update={"derivatives": moved})
    return aircraft.model_copy(update={"file": file})


def _bands(case: Case, fit: PosteriorFit) -> Iterator[str]:
    """One line for each learned increment: its 95 % band at the points of its table."""
    learned = [e for e in fit.hypothesis.effects if isinstance(e, Increment) and e.shape.cells]
    covariance = robust_covariance(case.fitted, fit) if learned else np.zeros((0, 0))
    for effect in learned:
        yield _line(effect.key, increment_table(case.fitted, fit, covariance, effect))


def _band(effect: AcceptedEffect) -> str:
    return "" if effect.table is None else _line(effect.key, effect.table)


def _line(key: str, table: IncrementTable) -> str:
    rows = zip(table.at, table.low, table.high, table.samples, strict=True)
    band = "; ".join(
        f"{x:.4g}: {low:.3g} to {high:.3g} ({samples} samples)" for x, low, high, samples in rows
    )
    return f"95 % band of {key}: {band}."


def from_zero_alpha(change: Change, shift_rad: float) -> Change:
    """Terms that count alpha from zero, as an aircraft does; the linear model counts it from the trim of a record.

    Parameters
    ----------
    change : as the filter has it; shift_rad : angle of attack of the trim [rad].
    """
    of_alpha = {"alpha", *(s.name for s in change.states if s.signal == "alpha")}

    def moved(term: _Term) -> _Term:
        return replace(term, at=term.at + shift_rad) if term.signal in of_alpha else term

    return replace(
        change,
        aero=tuple(
            replace(moved(t), factor_at=t.factor_at + (shift_rad if t.factor == "alpha" else 0.0))
            for t in change.aero
        ),
        readings=tuple(moved(t) for t in change.readings),
    )


__all__ = ["WITHOUT_EFFECTS", "accepted_change", "from_zero_alpha", "updated_folder", "write_update"]
