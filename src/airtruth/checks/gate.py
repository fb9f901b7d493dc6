"""The gate: the physical checks that every log passes before a verb uses it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.checks import columns, times
from airtruth.checks.evidence import relations
from airtruth.checks.explanation import AERODYNAMIC, DECLARED, SUSPECT, Explanation, explain, odd_ones, total
from airtruth.checks.fault import Fault
from airtruth.checks.means import OUTSIDE, ranges
from airtruth.checks.relation import Relation
from airtruth.checks.sentences import culprit, evidence, left_out, runs
from airtruth.checks.stated import Stated, stated_of
from airtruth.checks.together import Runs
from airtruth.errors import LogError
from airtruth.logs.flight_log import PRESCRIBED, Batch, FlightLog, batches
from airtruth.logs.validate import validate
from airtruth.physics.motion import LONGITUDINAL
from airtruth.physics.reconstruction import NEEDED, is_reconstructed
from airtruth.units import G0

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_CONTROL: Final = LONGITUDINAL.controls[0]
"""Control whose column and command are judged apart from the others."""
UNRELATED: Final = 0.1
"""Squared correlation of theta with the integral of q below which one of them is another axis."""
UNRELATED_STD: Final = 0.05
"""Standard deviation of their factor below which that is certain [-]; clean flights in a spiral have 0.1 or more."""
LEVEL_LOAD: Final = 1.15
"""Load factor below which the wings are within 30 deg of level [-]."""


def inspect(log: FlightLog, aircraft: Aircraft | None = None) -> tuple[Fault, ...]:
    """Relation a structurally valid log against physics.

    The tests and their tolerances are those of `airtruth.checks.evidence`, `airtruth.checks.means` and
    `airtruth.checks.columns`; the mistakes that are told apart are those of `airtruth.checks.corrections.catalogue`. The evidence
    of all runs is combined, whatever their lengths: a sign or a unit belongs to the mapping. Not detectable: an indicated
    airspeed in place of the true one, a density without an altitude, an elevator command in place of the surface where the log
    or the aircraft has no command or actuator, and whatever gusts hide.

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
    runs = Runs(tuple(batches(log)))
    faults = [
        *columns.names(log),
        *columns.units(log),
        *columns.reconstructed(log),
        *another_aircraft(log, aircraft),
    ]
    faults += [*columns.repeated(log), *times.interpolated(log)]
    single = list(_column_faults(runs, aircraft, bool(log.metadata.get(PRESCRIBED))))
    faults += single
    if not any(fault.certain for fault in single):  # which spoil the tests of motion
        still = any(fault.channel == _CONTROL.channel for fault in single)
        faults += _motion_faults(
            runs.without(_CONTROL.channel) if still else runs, aircraft, stated_of(log.metadata), len(runs)
        )
    merged: dict[tuple[str, str, tuple[str, ...]], Fault] = {}
    for fault in faults:
        merged.setdefault((fault.channel, fault.code, fault.run_ids), fault)
    return tuple(sorted(merged.values(), key=lambda f: not f.certain))


def another_aircraft(log: FlightLog, aircraft: Aircraft | None) -> Iterator[Fault]:
    """An aircraft whose name is not that of the log's metadata."""
    named = log.metadata.get("aircraft")
    if aircraft is None or not isinstance(named, str) or named == aircraft.name:
        return
    yield Fault(
        "aircraft", log.run_ids, "aircraft",
        f"the log's metadata name the aircraft {named!r}, and the declared one is {aircraft.name!r}: use --aircraft {named}, "
        "unless both are the same aircraft", False, 1.0,
    )  # fmt: skip


@dataclass(frozen=True)
class Admitted:
    """A log that passed the gate.

    Attributes
    ----------
    log : its runs without the odd ones.
    faults : uncertain faults; with ``force`` the certain ones first.
    left_out : a sentence for each fault whose runs were left out.
    """

    log: FlightLog
    faults: tuple[Fault, ...]
    left_out: tuple[str, ...] = ()

    @property
    def forced(self) -> tuple[str, ...]:
        """Sentences of the certain faults that ``force`` overruled."""
        return tuple(fault.sentence for fault in self.faults if fault.certain)

    def remarks(self, *codes: str) -> tuple[str, ...]:
        """Record of the gate beside an answer: runs that were left out, and uncertain faults of some codes."""
        return (*self.left_out, *(f.sentence for f in self.faults if f.code in codes and not f.certain))


def admit(
    log: FlightLog, aircraft: Aircraft | None = None, *, source: str = "", force: bool = False
) -> Admitted:
    """Refuse a log that breaks the log contract or contradicts physics; leave out a minority of odd runs.

    Parameters
    ----------
    log : flight log.
    aircraft : as in `inspect`.
    source : name of the log in the message, usually its file.
    force : keep all runs and return the certain faults; a breach of the contract raises nevertheless.

    Raises
    ------
    LogError
        One sentence per breach of the contract, or per certain fault that concerns half of the runs or more.
    """
    validate(log, source=source or "flight log")
    faults = inspect(log, aircraft)
    certain = [fault for fault in faults if fault.certain]
    if not certain or force:
        return Admitted(log, faults)
    odd = {run_id for fault in certain for run_id in fault.run_ids}
    if 2 * len(odd) < len(log):
        rest = log.select([run_id for run_id in log.run_ids if run_id not in odd])
        kept = admit(rest, aircraft, source=source)
        heading = f"{source}: " if source else ""
        sentences = tuple(
            heading + left_out(fault.run_ids, len(log), len(rest), fault.sentence) for fault in certain
        )
        return replace(kept, left_out=(*sentences, *kept.left_out))
    usable = any(fault.code != "constant" for fault in certain)
    advice = "correct it, or continue with --force" if usable else "correct it"
    heading = f"{source or 'flight log'}: contradicts physics; {advice}"
    raise LogError("\n  - ".join([heading, *(fault.sentence for fault in certain)]))


def _motion_faults(
    several: Runs, aircraft: Aircraft | None, stated: Mapping[str, Stated], count: int
) -> list[Fault]:
    """Faults that relations between channels show: of the mapping, which all runs share, then of odd runs.

    Parameters
    ----------
    count : number of runs of the log.
    """
    reconstructed = is_reconstructed(several.channels)
    tested = several.without(LONGITUDINAL.vane) if reconstructed else several
    aircraft = None if reconstructed else aircraft
    distances = total(relations(tested, aircraft))
    suspect = distances > SUSPECT
    if not suspect.any():
        return list(_drift(several, count)) if reconstructed else []
    each, everyone = suspect[:-1], np.ones(len(tested), dtype=np.bool_)
    few, found = 2 * each.sum() < len(tested), []
    odd = _odd(tested, each, aircraft, stated) if few and each.any() else []
    if not odd and suspect[-1]:
        found = explain(tested, aircraft, stated, partial=len(tested) < count)
        helped = _helped(tested, found, aircraft, distances)
        if _certain(tested, found) and 2 * helped.sum() >= len(tested):
            return list(_explained(tested, helped, found, aircraft, count))
        found = [replace(one, certain=False) for one in found]
    if not odd and not few and len(tested) > 1:
        odd = _odd(tested, each, aircraft, stated)
    if not odd:
        found = found or explain(tested.some(each), aircraft, stated, partial=True)
        return list(_explained(tested, everyone if suspect[-1] else each, found, aircraft, count))
    faults: list[Fault] = []
    rest = everyone.copy()
    for which, one in odd:
        # a mistake of the mapping makes hardly any run worse, one of a run makes the others worse
        helped = which | _helped(tested, one, aircraft, distances)
        affected = helped if 2 * helped.sum() >= len(tested) else which
        faults += _explained(tested, affected, one, aircraft, count)
        rest &= ~affected
    return [*faults, *(_motion_faults(several.some(rest), aircraft, stated, count) if rest.any() else [])]


def _odd(
    several: Runs, suspect: Bools, aircraft: Aircraft | None, stated: Mapping[str, Stated]
) -> list[tuple[Bools, list[Explanation]]]:
    """Runs of some that show a mistake with certainty, each by itself or else all of them together."""
    places, some = np.flatnonzero(suspect), several.some(suspect)
    alike: dict[tuple[str, ...], tuple[Bools, list[Explanation]]] = {}
    for run, one in odd_ones(some, aircraft, stated).items():
        assert one.correction is not None
        key = (*one.correction.channels, one.correction.mistake)
        which, _ = alike.setdefault(key, (np.zeros(len(several), dtype=np.bool_), [one]))
        which[places[run]] = True
    if alike:
        return list(alike.values())
    together = explain(some, aircraft, stated, partial=True)
    return [(suspect, together)] if _certain(some, together) else []


def _drift(several: Runs, count: int) -> Iterator[Fault]:
    """A reconstruction that leaves the range of an angle of attack."""
    alpha = several.without(*(name for name in several.channels if name != LONGITUDINAL.vane))
    for test in ranges(alpha):
        ids = tuple(several.run_ids[i] for i in np.flatnonzero(test.distance[:-1]))
        yield Fault(
            LONGITUDINAL.vane, ids, "impossible",
            f"{LONGITUDINAL.vane}: reconstructed, in {runs(ids, count)}: {evidence(test)}: the channels that it was computed "
            f"from ({', '.join(NEEDED)}, and where mapped ax_m_s2, theta_rad, altitude_m) contradict each other, or the "
            "record is too long for their errors; cut it to one manoeuvre, and check their units and signs", True, OUTSIDE,
        )  # fmt: skip


def _certain(several: Runs, found: Sequence[Explanation]) -> bool:
    """Whether explanations refuse their runs."""
    return any(
        one.certain if one.correction is not None else _refuses(several, one.failed[0]) for one in found
    )


def _refuses(several: Runs, failed: Relation) -> bool:
    """Whether a test that no mistake explains rules out a flight."""
    return (failed.name == "range" and float(failed.distance[-1]) >= OUTSIDE) or _unrelated(several, failed)


def _helped(several: Runs, found: Sequence[Explanation], aircraft: Aircraft | None, before: Array) -> Bools:
    """Runs whose distances the corrections together do not increase."""
    changed = several
    for one in found:
        if one.correction is not None:
            changed = changed.changed(one.correction.apply)
    return np.asarray(total(relations(changed, aircraft))[:-1] <= before[:-1])


def _explained(
    several: Runs, which: Bools, found: Sequence[Explanation], aircraft: Aircraft | None, count: int
) -> Iterator[Fault]:
    """The faults of some runs."""
    doubtful = [one.failed[0].channels[0] for one in found if one.correction is None]
    for one in found:
        if one.correction is not None:
            yield from _sentences(several, which, one, aircraft, count, doubtful)
            continue
        ids = tuple(several.run_ids[i] for i in np.flatnonzero(which))
        (failed,) = one.failed
        if failed.name == "range":
            ids = tuple(several.run_ids[i] for i in np.flatnonzero(_range_of(several, failed))) or ids
        name = failed.channels[0]
        sentence = (
            f"{name}: inconsistent in {runs(ids, count)}: {evidence(failed)}; check its unit, sign and axis"
        )
        code = "impossible" if failed.name == "range" else "inconsistent"
        yield Fault(name, ids, code, sentence, _refuses(several, failed), float(failed.distance[-1]))


def _range_of(several: Runs, failed: Relation) -> Bools:
    """Runs that leave the range of a channel."""
    own = next((t for t in ranges(several) if t.channels == failed.channels), None)
    return np.zeros(len(several), dtype=np.bool_) if own is None else np.asarray(own.distance[:-1] > 0.0)


def _sentences(
    several: Runs,
    which: Bools,
    one: Explanation,
    aircraft: Aircraft | None,
    count: int,
    doubtful: Sequence[str],
) -> Iterator[Fault]:
    """A mistake in some runs, a fault for each channel that shares it; ``doubtful`` are channels that no mistake explains."""
    made = one.correction
    assert made is not None
    ids = tuple(several.run_ids[i] for i in np.flatnonzero(which))
    for part, failed in zip(made.parts or (made,), one.failed, strict=True):
        name = part.channels[0]
        others = [other.channels[0] for other in made.parts if other is not part]
        cure = part.cure if others else one.cure
        if 2 * len(ids) < count:
            cure = f"the other {count - len(ids)} runs exclude it as a mistake of the mapping"
        elif one.declared and aircraft is not None:
            cure += f"; or the declared {declared_names(one.declared)} of {aircraft.name} is wrong"
        for held in (n for n in failed.channels if n in doubtful) if failed.name in AERODYNAMIC else ():
            cure += f"; or map another column to {held}: this test takes it as right, and it is inconsistent"
        mistake = (one.mistake if one.certain else f"possibly {one.mistake}") + _like(others)
        sentence = f"{name}: {mistake} in {runs(ids, count)}: {evidence(failed, one.row)}; {cure}"
        yield Fault(name, ids, part.code, sentence, one.certain, one.gain)


def declared_names(tests: Sequence[str]) -> str:
    """The numbers of aircraft.toml behind tests, "mass, wing_area or CLalpha"."""
    names = list(dict.fromkeys(name for test in tests for name in DECLARED[test]))
    return f"{', '.join(names[:-1])} or {names[-1]}"


def _like(others: Sequence[str]) -> str:
    return f", like {' and '.join(others)}," if others else ""


_SAMPLES: Final = (
    (
        columns.dropouts, "dropout", sum,
        "zero in {:.0f} samples of {}, amid others that are not: dropouts; cut the runs there, or interpolate them before the "
        "import",
    ),
    (
        columns.spikes, "spike", sum,
        "isolated outliers in {:.0f} samples of {}: errors of the recording; replace them by interpolated values before the "
        "import, or cut the runs there",
    ),
    (
        columns.frozen, "dropout", max,
        "one value for up to {:.3g} s in {}, while the other channels require a change: the sensor was stuck; cut the runs there",
    ),
)  # fmt: skip
"""Tests of samples: the runs that show a fault and a figure of each batch, code, the figure of all, and the words."""


def _column_faults(several: Runs, aircraft: Aircraft | None, prescribed: bool) -> Iterator[Fault]:
    """Faults of single columns, each of all runs that show it."""
    count = len(several)

    def named(bad: Bools) -> tuple[tuple[str, ...], str]:
        ids = tuple(several.run_ids[i] for i in np.flatnonzero(bad))
        return ids, runs(ids, count)

    for name, bad, _ in _over(several, columns.constant):
        ids, where = named(bad)
        certain = name != _CONTROL.channel or _commanded(several.some(bad))
        yield Fault(
            name, ids, "constant",
            f"{name}: constant in {where}, while other channels move: the sensor was not recorded; leave these "
            "runs or the channel out", certain, float(bad.sum()),
        )  # fmt: skip
    for found, code, combined, words in _SAMPLES:
        for name, bad, figures in _over(several, found):
            ids, where = named(bad)
            figure = float(combined(figures))
            yield Fault(name, ids, code, f"{name}: {words.format(figure, where)}", True, figure)
    pairs = [set(columns.copies(part, aircraft, prescribed)) for part in several.parts]
    for one, other in sorted(set.intersection(*pairs)):
        commanded = {one, other} == {_CONTROL.channel, _CONTROL.command}
        wrong = _CONTROL.channel if commanded else culprit(relations(several, aircraft), one, other)
        right = other if wrong == one else one
        yield Fault(
            wrong, several.run_ids, "copy",
            f"{wrong}: the values of {right} in {runs(several.run_ids, count)}: one column was mapped twice; "
            f"map the column of {wrong}, or leave it out", True, 1.0,
        )  # fmt: skip


def _over(
    several: Runs, test: Callable[[Batch], Iterable[tuple[str, Bools, float]]]
) -> list[tuple[str, Bools, list[float]]]:
    """Channels that a test of one batch finds, with all their runs and the figure of each batch."""
    found: dict[str, tuple[Bools, list[float]]] = {}
    first = 0
    for part in several.parts:
        for name, bad, figure in test(part):
            whole, figures = found.setdefault(name, (np.zeros(len(several), dtype=np.bool_), []))
            whole[first : first + len(part.run_ids)] |= bad
            figures.append(figure)
        first += len(part.run_ids)
    return [(name, whole, figures) for name, (whole, figures) in found.items()]


def _unrelated(several: Runs, failed: Relation) -> bool:
    """Whether theta and q have nothing in common although the wings are level: a turn has more load."""
    *_, normal = LONGITUDINAL.output_channels
    if failed.name != "theta" or normal not in several.channels:
        return False
    load = float(np.median(several.each(lambda c, dt_s: np.median(c[normal], axis=1)))) / -G0
    _, std, share, _ = failed.figures[-1]
    return bool(load <= LEVEL_LOAD and share < UNRELATED and std < UNRELATED_STD)


def _commanded(several: Runs) -> bool:
    name = _CONTROL.command
    return name in several.channels and bool(
        (several.each(lambda c, dt_s: np.ptp(c[name], axis=1)) > 0.0).all()
    )


__all__ = ["Admitted", "admit", "inspect"]
