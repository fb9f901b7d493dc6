"""The gate: the physical checks that every log passes before a verb uses it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.checks import columns, times
from airtruth.checks.corrections import Correction
from airtruth.checks.evidence import OUTSIDE, relations
from airtruth.checks.explanation import SUSPECT, Explanation, explain
from airtruth.checks.fault import Fault
from airtruth.checks.relation import Relation
from airtruth.checks.sentences import culprit, evidence, runs
from airtruth.errors import LogError
from airtruth.logs.flight_log import Batch, FlightLog, batches
from airtruth.logs.validate import validate
from airtruth.units import G0

Bools = NDArray[np.bool_]

UNRELATED: Final = 0.1
"""Squared correlation of theta with the integral of q below which one of them is another axis."""
UNRELATED_STD: Final = 0.05
"""Standard deviation of their factor below which that is certain [-]; clean flights in a spiral have 0.1 or more."""
LEVEL_LOAD: Final = 1.15
"""Load factor below which the wings are within 30 deg of level [-]."""


def inspect(log: FlightLog, aircraft: Aircraft | None = None) -> tuple[Fault, ...]:
    """Relation a structurally valid log against physics.

    The tests and their tolerances are those of `airtruth.checks.evidence` and `airtruth.checks.columns`; the
    mistakes that are told apart are those of `airtruth.checks.corrections.catalogue`. Not detectable: an
    indicated airspeed in place of the true one, a density without an altitude, an elevator command in place
    of the surface where the log or the aircraft has no command or actuator, and whatever gusts hide.

    Parameters
    ----------
    log : flight log that `airtruth.logs.validate.validate` accepts.
    aircraft : declared aircraft; its mass, area and derivatives add tests of airspeed, density and elevator.

    Returns
    -------
    tuple of Fault
        The certain faults first; empty for a plausible log.
    """
    wrong = tuple(times.clock(log))
    if wrong:  # every other test compares rates of change
        return wrong
    faults = [*columns.names(log), *columns.units(log), *columns.reconstructed(log)]
    faults += [*columns.repeated(log), *times.interpolated(log)]
    for batch in batches(log):
        faults += _batch_faults(batch, aircraft, len(log.run_ids))
    merged: dict[tuple[str, str], Fault] = {}
    for fault in faults:
        merged.setdefault((fault.channel, fault.code), fault)
    return tuple(sorted(merged.values(), key=lambda f: not f.certain))


def require(
    log: FlightLog, aircraft: Aircraft | None = None, *, source: str = "", force: bool = False
) -> tuple[Fault, ...]:
    """Refuse a log that breaks the log contract or contradicts physics.

    Parameters
    ----------
    log : flight log.
    aircraft : as in `inspect`.
    source : name of the log in the message, usually its file.
    force : return the certain faults and do not raise; a breach of the contract raises nevertheless.

    Returns
    -------
    tuple of Fault
        The uncertain faults; with ``force`` the certain ones first.

    Raises
    ------
    LogError
        One sentence per breach of the contract, or per certain fault.
    """
    validate(log, source=source or "flight log")
    faults = inspect(log, aircraft)
    certain = [fault.sentence for fault in faults if fault.certain]
    if certain and not force:
        usable = any(fault.code != "constant" for fault in faults if fault.certain)
        advice = "correct it, or continue with --force" if usable else "correct it"
        heading = f"{source or 'flight log'}: contradicts physics; {advice}"
        raise LogError("\n  - ".join([heading, *certain]))
    return faults


def _batch_faults(batch: Batch, aircraft: Aircraft | None, total: int) -> list[Fault]:
    """Faults of runs of one length: first those of single columns, which spoil the tests of motion."""
    faults = list(_column_faults(batch, aircraft, total))
    if any(fault.certain for fault in faults):
        return faults
    if any(fault.channel == "elevator_rad" for fault in faults):
        batch = replace(batch, channels={n: v for n, v in batch.channels.items() if n != "elevator_rad"})
    results = relations(batch, aircraft)
    suspect = np.asarray(sum(test.distance for test in results) > SUSPECT)
    if not suspect.any():
        return faults
    each = suspect[:-1]
    parts = [*_groups(results, each)] if each.any() and not each.all() else []
    if suspect[-1]:
        parts.append(np.ones(len(each), dtype=np.bool_))
    for which in parts:
        found = explain(_some(batch, which), aircraft, partial=not which.all())
        faults += _explained(batch, which, found, aircraft, total)
        if any(fault.certain for fault in faults):
            return faults
    return faults


def _groups(results: list[Relation], suspect: Bools) -> Iterator[Bools]:
    """Suspect runs that fail the same test most."""
    distances = np.stack([test.distance[:-1] for test in results])
    worst = distances.argmax(axis=0)
    for test in np.unique(worst[suspect]):
        yield suspect & (worst == test)


def _explained(
    batch: Batch, which: Bools, found: list[Explanation], aircraft: Aircraft | None, total: int
) -> Iterator[Fault]:
    """The faults of some runs; a mistake is reported for every run that its correction does not make worse."""
    for one in found:
        if one.correction is not None:
            affected = which | _helped(batch, one.correction, aircraft) if one.certain else which
            ids = [batch.run_ids[i] for i in np.flatnonzero(affected)]
            for part, failed in zip(one.correction.parts or (one.correction,), one.failed, strict=True):
                name = part.channels[0]
                others = [other.channels[0] for other in one.correction.parts if other is not part]
                cure = part.cure if others else one.cure
                mistake = (one.mistake if one.certain else f"possibly {one.mistake}") + _like(others)
                sentence = f"{name}: {mistake} in {runs(ids, total)}: {evidence(failed)}; {cure}"
                yield Fault(name, ids[0], part.code, sentence, one.certain, one.gain)
            continue
        ids = [batch.run_ids[i] for i in np.flatnonzero(which)]
        (failed,) = one.failed
        name, outside = failed.channels[0], failed.name == "range"
        sentence = (
            f"{name}: inconsistent in {runs(ids, total)}: {evidence(failed)}; check its unit, sign and axis"
        )
        code = "impossible" if outside else "inconsistent"
        distance = float(failed.distance[-1])
        certain = (outside and distance >= OUTSIDE) or _unrelated(batch, failed)
        yield Fault(name, ids[0], code, sentence, certain, distance)


def _like(others: Sequence[str]) -> str:
    return f", like {' and '.join(others)}," if others else ""


def _helped(batch: Batch, correction: Correction, aircraft: Aircraft | None) -> Bools:
    """Runs whose distances a correction does not increase."""
    changed = replace(batch, channels={**batch.channels, **correction.apply(batch.channels)})
    before, after = (
        np.asarray(sum(test.distance[:-1] for test in relations(one, aircraft))) for one in (batch, changed)
    )
    return np.asarray(after <= before)


def _column_faults(batch: Batch, aircraft: Aircraft | None, total: int) -> Iterator[Fault]:
    def named(bad: Bools) -> tuple[str, str]:
        ids = [batch.run_ids[i] for i in np.flatnonzero(bad)]
        return ids[0], runs(ids, total)

    for name, bad in columns.constant(batch):
        first, where = named(bad)
        certain = name != "elevator_rad" or _commanded(batch, bad)
        yield Fault(
            name, first, "constant",
            f"{name}: constant in {where}, while other channels move: the sensor was not recorded; leave these "
            "runs or the channel out", certain, float(bad.sum()),
        )  # fmt: skip
    for name, bad, count in columns.dropouts(batch):
        first, where = named(bad)
        yield Fault(
            name, first, "dropout",
            f"{name}: zero in {count} samples of {where}, amid others that are not: dropouts; cut the runs "
            "there, or interpolate them before the import", True, float(count),
        )  # fmt: skip
    for name, bad, count in columns.spikes(batch):
        first, where = named(bad)
        yield Fault(
            name, first, "spike",
            f"{name}: isolated outliers in {count} samples of {where}: errors of the recording; replace them by "
            "interpolated values before the import, or cut the runs there", True, float(count),
        )  # fmt: skip
    for name, bad, longest in columns.frozen(batch):
        first, where = named(bad)
        yield Fault(
            name, first, "dropout",
            f"{name}: one value for up to {longest:.3g} s in {where}, while the other channels require a "
            "change: the sensor was stuck; cut the runs there", True, longest,
        )  # fmt: skip
    for one, other in columns.copies(batch, aircraft):
        commanded = {one, other} == {"elevator_rad", "elevator_command_rad"}
        wrong = "elevator_rad" if commanded else culprit(relations(batch, aircraft), one, other)
        right = other if wrong == one else one
        yield Fault(
            wrong, batch.run_ids[0], "copy",
            f"{wrong}: the values of {right} in {runs(batch.run_ids, total)}: one column was mapped twice; "
            f"map the column of {wrong}, or leave it out", True, 1.0,
        )  # fmt: skip


def _unrelated(batch: Batch, failed: Relation) -> bool:
    """Whether theta and q have nothing in common although the wings are level: a turn has more load."""
    load = float(np.median(batch.channels["az_m_s2"])) / -G0 if "az_m_s2" in batch.channels else np.inf
    if failed.name != "theta" or load > LEVEL_LOAD:
        return False
    _, std, share, _ = failed.figures[-1]
    return bool(share < UNRELATED and std < UNRELATED_STD)


def _commanded(batch: Batch, which: Bools) -> bool:
    command = batch.channels.get("elevator_command_rad")
    return command is not None and bool((np.ptp(command[which], axis=1) > 0.0).all())


def _some(batch: Batch, which: Bools) -> Batch:
    index = np.flatnonzero(which)
    channels = {name: values[index] for name, values in batch.channels.items()}
    ids = tuple(batch.run_ids[i] for i in index)
    return replace(batch, run_ids=ids, t_s=batch.t_s[index], channels=channels)


__all__ = ["inspect", "require"]
