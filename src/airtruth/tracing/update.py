"""The updated aircraft: a copy of the declared one with the accepted effects and the refitted derivatives."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import FILE, Aircraft
from airtruth.aircraft.corrected import write_corrected
from airtruth.aircraft.jsbsim.short_period import TrimPoint
from airtruth.aircraft.origin import MARK, UNKNOWN, Origin, Term, rounded
from airtruth.aircraft.write import Corrections, write_aircraft
from airtruth.effects.increment import Increment
from airtruth.errors import StoreError
from airtruth.logs import atomic
from airtruth.physics.motion import LONGITUDINAL, VANES
from airtruth.physics.terms import DECLARED, AeroTerm, Change, ReadingTerm, SensorTerm, declared_total
from airtruth.quantity import Quantity
from airtruth.tracing.accepted import AcceptedEffect, IncrementTable
from airtruth.tracing.axial_force import AxialForce
from airtruth.tracing.increment_table import increment_table
from airtruth.tracing.inference.hypothesis import Hypothesis
from airtruth.tracing.inference.posterior import PosteriorFit
from airtruth.tracing.inference.robust import robust_covariance
from airtruth.tracing.model.records import Signals
from airtruth.tracing.model.response import moved_past_sensors_m
from airtruth.tracing.prepare import Case
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.update_origin import source_text, with_spread
from airtruth.units import G0

Array = NDArray[np.float64]

WITHOUT_EFFECTS: Final = "without_effects"
"""Folder beside that of the updated aircraft: one without a JSBSim model, as it flies without the accepted effects."""
_WITH_ARM: Final = ("vane", "accelerometer")
"""Instruments whose reading depends on where they are."""
_DECIMALS: Final = 6
"""Decimals of the trim about which the derivatives are refitted [rad] (judgement: finer than any sensor of angles)."""
_Term = TypeVar("_Term", AeroTerm, ReadingTerm)


def accepted_change(case: Case, fit: PosteriorFit, sizes: Array, chord_m: float) -> Change:
    """The effects of a fit at some sizes, with sensors that a shift of the CG has moved relative to it.

    Parameters
    ----------
    fit : hypothesis and common parameters; sizes : of its effects.
    """
    change = fit.hypothesis.added(sizes)
    shift = declared_total(change.declared, "cg")
    if shift == DECLARED["cg"]:
        return change
    moved_m = moved_past_sensors_m(fit.point.common, shift, chord_m, fit.point.of.common)
    outputs = case.fitted.layout.motion.outputs
    moved = [y for y in outputs if y.instrument in _WITH_ARM and (y.channel not in VANES or case.has_vane)]
    arms = (SensorTerm(y.channel, "arm", moved_m) for y in moved)
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


@dataclass(frozen=True)
class Revision:
    """Change of the declared aircraft by the records of one motion.

    Attributes
    ----------
    change : terms of the accepted effects, alpha counted from zero; std : standard deviations of their numbers.
    corrections : refitted derivatives.
    names : keys of the effects; bands : lines on what is learned; source : method, date and records.
    signals : of the fitted records.
    is_needed : whether effects or derivatives change at all.
    """

    change: Change
    std: Mapping[Term, float]
    corrections: Corrections
    names: tuple[str, ...]
    bands: tuple[str, ...]
    source: str
    signals: tuple[Signals, ...]
    is_needed: bool

    @property
    def note(self) -> str:
        """The reason of the change, for the heads of the files."""
        found = ", ".join(self.names) or "none of the library"
        text = f"Effects: {found}. Derivatives refitted. Source: {self.source}."
        return text + "".join(f"\n{line}" for line in self.bands)

    @property
    def whole(self) -> tuple[Change, Mapping[Term, float]]:
        """The change with the refitted derivatives, and the standard deviations of all its numbers."""
        terms = self.corrections.terms()
        stated: dict[Term, float] = {terms[name]: std for name, std in self.corrections.std.items()}
        return self.change + Change(aero=tuple(terms.values())), {**self.std, **stated}


def revision_of(
    case: Case,
    rounds: Sequence[SearchRound],
    aircraft: Aircraft,
    refit: bool = False,
    axial: AxialForce | None = None,
    elsewhere: Collection[str] = (),
) -> Revision:
    """Change of the declared aircraft by a finished search.

    Parameters
    ----------
    refit : whether the refitted derivatives are written although no effect was accepted: the records contradict the
        declared ones, or determine them better.
    axial : increments of CX that ax shows; None for none.
    elsewhere : keys of effects that the revision of another motion states.
    """
    fit = rounds[-1].reported
    covariance = robust_covariance(case.fitted, fit)
    shift = case.fitted.alpha_shift_rad

    def change_at(sizes: Array) -> Change:
        change = accepted_change(case, fit, sizes, aircraft.constants.chord_m)
        return from_zero_alpha(_without(change, fit.hypothesis, sizes, elsewhere), shift)

    change, std = with_spread(change_at, fit.point.sizes, covariance[fit.layout.sizes, fit.layout.sizes])
    along = () if axial is None else axial.increments
    change += Change() if axial is None else axial.change
    explanation = rounds[-1].explanation
    return Revision(
        change=change,
        std=std,
        corrections=_corrections(case, fit, covariance),
        names=tuple(
            dict.fromkeys(
                [
                    *(e.key for e in fit.hypothesis.effects),
                    *(e.key for e in along),
                    *(() if explanation is None else explanation.effects),
                ]
            )
        ),
        bands=(*_bands(case, fit), *map(_band, along)),
        source=source_text([r.signals.run_id for r in case.fitted.records]),
        signals=tuple(r.signals for r in case.fitted.records),
        is_needed=change != Change() or explanation is not None or refit,
    )


def _without(change: Change, hypothesis: Hypothesis, sizes: Array, keys: Collection[str]) -> Change:
    """A change without the declared quantities and the errors of sensors that some effects of a hypothesis state."""
    named = [e for e in hypothesis.effects if e.key in keys]
    values = dict(zip(hypothesis.effects, hypothesis.values(sizes), strict=True))
    stated = Change()
    for effect in named:
        stated += effect.change(values[effect])
    return replace(
        change,
        declared=tuple(t for t in change.declared if t not in stated.declared),
        sensors=tuple(t for t in change.sensors if t not in stated.sensors),
    )


def write_update(revisions: Sequence[Revision], aircraft: Aircraft, out: Path) -> str | None:
    """Write the aircraft with the accepted effects and the refitted derivatives of each motion to OUT/aircraft/NAME.

    A complete new folder replaces an earlier update, or nothing changes. An aircraft without a JSBSim model is written
    in any case, with a JSBSim model of the refitted derivatives; OUT/without_effects/NAME is the same without the effects,
    which a plan flies.

    Parameters
    ----------
    revisions : of each motion that is answered, that of the pitch plane first; an effect is stated by one of them alone.

    Returns
    -------
    The folder; None where nothing of an aircraft with a JSBSim model is to be changed.

    Raises
    ------
    AircraftError, StoreError
        If the model cannot take the effect, or the folder cannot be written; as `updated_folder`.
    """
    folder = updated_folder(aircraft, out)
    needed = [r for r in revisions if r.is_needed]
    if not needed and aircraft.file.jsbsim is not None:
        atomic.remove_folder(folder)
        return None
    kept = needed or revisions
    note = "\n".join(r.note for r in kept)
    source = "; ".join(dict.fromkeys(r.source for r in kept))
    updated = aircraft
    for r in kept:
        updated = _with_derivatives(updated, r.corrections, r.corrections.std, r.source)
    if aircraft.file.jsbsim is not None:
        change, std = Change(), dict[Term, float]()
        for more, stated in (r.whole for r in kept):
            change, std = change + more, {**std, **stated}
        with atomic.new_folder(folder) as new:
            write_aircraft(updated, change, new, note, origin=Origin(source, std))
        return str(folder)
    change, std, without = Change(), dict[Term, float](), aircraft
    for r in kept:
        change, std = change + r.change, {**std, **r.std}
        without = _with_derivatives(without, r.corrections, {}, r.source)
    _write_flying(updated, kept[0], change, folder, note, Origin(source, std))
    _write_flying(without, kept[0], Change(), folder.parents[1] / WITHOUT_EFFECTS / aircraft.name, note)
    return str(folder)


def _corrections(case: Case, fit: PosteriorFit, covariance: Array) -> Corrections:
    """The refitted derivatives, about the mean trim of the fitted records."""
    layout = case.fitted.layout
    motion, own = layout.motion, layout.common.derivatives
    values = fit.point.common[own].tolist()
    deviations = np.sqrt(np.diag(covariance)[own]).tolist()
    std = dict(zip(motion.parameters, deviations, strict=True))
    origins = np.array([record.plant.trim_signals for record in case.fitted.records]).T
    trim = {s.name: float(np.mean(at)) for s, at in zip(motion.signals, origins, strict=True)}
    trim[motion.flow] += case.fitted.alpha_shift_rad
    return Corrections(
        {name: rounded(value, std[name]) for name, value in zip(motion.parameters, values, strict=True)},
        {name: round(at, _DECIMALS) for name, at in trim.items()},
        std,
        motion,
    )


def _write_flying(
    aircraft: Aircraft, revision: Revision, change: Change, folder: Path, note: str, origin: Origin = UNKNOWN
) -> None:
    """An aircraft without a JSBSim model, as one that flies in level flight at the trim of the fitted records."""
    signals, trim = revision.signals, revision.corrections.trim
    if revision.corrections.motion is LONGITUDINAL:
        attack, surface = trim[LONGITUDINAL.flow], trim[LONGITUDINAL.controls[0].name]
    else:
        attack, surface = float(np.mean([s.alpha_rad[0] for s in signals])), 0.0
    airspeed, density = (
        float(np.mean([x[0] for x in own]))
        for own in ([s.airspeed_m_s for s in signals], [s.density_kg_m3 for s in signals])
    )
    at = TrimPoint(airspeed, density, attack, surface, -G0 * math.cos(attack))
    with atomic.new_folder(folder) as new:
        write_corrected(aircraft, aircraft.file.derivatives, at, change, new, note, origin)


def _with_derivatives(
    aircraft: Aircraft, corrections: Corrections, std: Mapping[str, float], source: str
) -> Aircraft:
    """The aircraft with other [derivatives]: all that one without a JSBSim model has, and beside a model what it flies.

    Parameters
    ----------
    std : standard deviations of the refitted derivatives, which contain the declared ones; without one that stays.
    """
    increments = corrections.increments
    moved = {
        name: Quantity(value=q.value + increments[name], std=std.get(name, q.std), source=source)
        if name in increments  # those of another motion stay as they are declared
        else q
        for name, q in aircraft.file.derivatives.items()
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


__all__ = [
    "WITHOUT_EFFECTS",
    "Revision",
    "accepted_change",
    "from_zero_alpha",
    "revision_of",
    "updated_folder",
    "write_update",
]
