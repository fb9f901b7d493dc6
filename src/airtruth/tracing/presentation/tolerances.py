"""The table of the free runs and the modes of a trace against the tolerances of a training simulator."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Final

from airtruth.channels import shown
from airtruth.physics.motion import LATERAL
from airtruth.physics.proof_of_lateral import BANK_RAD, RUDDER_RAD, SPIRAL_S, TOLERANCES, LateralProof
from airtruth.physics.proof_of_match import OF_CHANNEL, PROOFS, Tolerance
from airtruth.table import MISSING, Cell, Group, Number, Row, Table
from airtruth.tracing.answer import TraceAnswer
from airtruth.tracing.presentation.error_table import SET_NAMES
from airtruth.tracing.stage_errors import SETS, STAGES, Excursions, Tolerances
from airtruth.units import DEG, G0

_IN_G: Final = "az_m_s2"
"""Channel that is shown in multiples of the standard gravity."""
_SLIP: Final = f"sideslip at {RUDDER_RAD / DEG:.0f} deg {LATERAL.controls[1].name}"
"""The steady sideslip in words."""
_MODES: Final = {
    "dutch_roll_period_s": ("Dutch roll, period [s]", 1.0),
    "dutch_roll_damping": ("Dutch roll, damping ratio [-]", 1.0),
    "dutch_roll_half_s": ("Dutch roll, time to half [s]", 1.0),
    "dutch_roll_peaks_s": ("Dutch roll, bank after sideslip [s]", 1.0),
    "spiral_bank_rad": (f"spiral, bank after {SPIRAL_S:.0f} s from {BANK_RAD / DEG:.0f} [deg]", DEG),
    "sideslip_bank_rad": (f"{_SLIP}, bank [deg]", DEG),
    "sideslip_angle_rad": (f"{_SLIP}, beta [deg]", DEG),
    "sideslip_control_rad": (f"{_SLIP}, {LATERAL.controls[0].name} [deg]", DEG),
}
"""Field of `LateralProof` -> heading with the display unit, and that unit in SI."""


def tolerance_table(answer: TraceAnswer) -> Table | None:
    """Largest distances of the free runs beside their tolerance, per stage, held-out records first; then the modes.

    Returns
    -------
    The table; None where the answer states no tolerances.
    """
    stated = answer.tolerances
    if stated is None:
        return None
    names = [stage for stage in STAGES if stage in stated.stages]
    groups = []
    for records in SETS:
        cells = [stated.stages[name].on(records) for name in names]
        if any(cells):
            heading = f"Largest distance, free run, {SET_NAMES[records]}"
            groups.append(Group(heading, tuple(_rows(stated, cells))))
    if stated.modes:
        groups.append(
            Group("Modes at the mean condition of the fitted records", tuple(_modes(stated, names)))
        )
    return Table(
        title="Tolerances of a training simulator",
        columns=("", "tolerance", *names),
        groups=tuple(groups),
        notes=tuple(_notes(answer, stated)),
        keys=2,
    )


def _notes(answer: TraceAnswer, stated: Tolerances) -> Iterator[str]:
    proof = PROOFS[answer.motion.name]
    first, *others = [shown(channel)[0].partition(" ")[0] for channel in proof.tolerances]
    every = " and ".join([first, *others])
    if proof.pitch is not None:
        start = f"pitch is the integral of the distance in {first} from the start of the record"
        every = f"pitch or {first}, and {' and '.join(others)}. {start}"
    yield (
        f"Source: {stated.source} ({proof.name}): {every}. samples inside: mean over the records. records within: "
        "number of records that stay inside throughout. In gusts, most of a distance is the response to the gusts."
    )
    if stated.modes:
        yield (
            f"The modes of each stage are compared with those of {_reference(stated)}, the derivatives of the flown aircraft. Of "
            "damping ratio and time to half amplitude (of a divergence: to double) one is enough."
        )


def _rows(stated: Tolerances, cells: Sequence[Excursions | None]) -> Iterator[Row]:
    first = next(e for e in cells if e is not None)
    for name in first.distances:
        heading, unit = ("az [g]", G0) if name == _IN_G else (shown(name)[0], DEG)
        own = OF_CHANNEL.get(name, Tolerance(stated.limits.get(name, math.nan)))
        yield heading, _limit(own, unit), *_row(cells, partial(_distance, name, unit))
    yield "samples inside [%]", 100, *_row(cells, lambda e: Number(100.0 * e.share_inside, decimals=0))
    yield "records within", first.records, *_row(cells, lambda e: e.records_within)


def _limit(own: Tolerance, unit: float) -> Cell:
    """An absolute tolerance as a number in a unit; with a share of the measured value, both."""
    absolute = Number(own.absolute / unit, digits=2)
    if own.relative == 0.0:
        return absolute
    share = f"{100.0 * own.relative:.0f} %"
    return f"{absolute} or {share}" if own.absolute else share


def _modes(stated: Tolerances, names: Sequence[str]) -> Iterator[Row]:
    proofs = {name: _proof(stated.modes[name]) for name in names if name in stated.modes}
    for field, (heading, unit) in _MODES.items():
        values = (getattr(proofs[name], field) / unit if name in proofs else math.nan for name in names)
        yield heading, _limit(TOLERANCES[field], unit), *(Number(v, digits=3) for v in values)
    reference = proofs[_reference(stated)]
    counts = (sum(proofs[name].within(reference).values()) if name in proofs else MISSING for name in names)
    yield "quantities within", len(TOLERANCES), *counts


def _reference(stated: Tolerances) -> str:
    """The stage whose derivatives are those of the flown aircraft."""
    return "after" if "after" in stated.modes else "before"


def _proof(values: dict[str, float | None]) -> LateralProof:
    return LateralProof(**{name: math.nan if (x := values.get(name)) is None else x for name in TOLERANCES})


def _distance(name: str, unit: float, e: Excursions) -> Cell:
    return Number(e.distances[name] / unit, digits=3)


def _row(cells: Sequence[Excursions | None], cell: Callable[[Excursions], Cell]) -> Row:
    return tuple(MISSING if e is None else cell(e) for e in cells)


__all__ = ["tolerance_table"]
