"""The part of a page that shows every record against the models, and the tables of these records."""

from __future__ import annotations

import base64
import html
import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import shown
from airtruth.charts import colours_of
from airtruth.charts.model import MODELS
from airtruth.logs.histories import Histories, History
from airtruth.physics.motion import LONGITUDINAL, MOTIONS
from airtruth.physics.proof_of_match import (
    NORMAL_M_S2,
    OF_CHANNEL,
    PITCH_RAD,
    PROOFS,
    RATE_RAD_S,
    pitch_change,
)
from airtruth.reporting.pages.agreement import agreement_of_records, agreement_table
from airtruth.reporting.pages.page import Section, as_json, data_table, notes_html
from airtruth.table import MISSING, Number, Row, Table, flat
from airtruth.units import DEG, G0

Array = NDArray[np.float64]

BUDGET: Final = 900_000
"""Size of the records on a page [byte]; judgement: with uPlot, charts and tables a page stays below 1.5 MB."""
MOST: Final = 24
"""Most records on a page [-]; judgement: as many as a reader looks through."""
_LEAST: Final = 200
"""Least samples of a record on a page [-]; judgement: a doublet remains visible."""
_BYTES: Final = 16.0 / 3.0
"""Size of a number as base64 of float32 [byte]."""
_DASHES: Final = ((), (7, 3), (2, 3))
"""Dashes of the first six models, of the next six, and of the rest [px]."""
_QUANTITIES: Final = (
    ("airspeed_m_s", "true airspeed [m/s]", 1.0, 2),
    ("density_kg_m3", "density [kg/m3]", 1.0, 4),
    ("altitude_m", "altitude [m]", 1.0, 0),
    ("trim_alpha_rad", "trim alpha [deg]", DEG, 2),
    *((f"trim_{c.channel}", f"trim {c.name} [deg]", DEG, 2) for m in MOTIONS.values() for c in m.controls),
    ("mass_kg", "mass [kg]", 1.0, 3),
    *((f"inertia_{axes}_kg_m2", f"I{axes} [kg m2]", 1.0, 3) for axes in ("yy", "xx", "zz", "xz")),
    ("duration_s", "duration [s]", 1.0, 2),
    ("sample_rate_hz", "sample rate [Hz]", 1.0, 1),
)
"""Conditions of a record: key, heading with the display unit, that unit in SI, decimals."""
_Q: Final = "q_rad_s"
"""Channel whose integral is the pitch angle."""


@dataclass(frozen=True)
class Extract:
    """The records that fit on a page.

    Attributes
    ----------
    records : the chosen ones, that which is shown first among them.
    step : every how many samples one is kept.
    notes : sentences that say what was left out.
    """

    records: tuple[History, ...]
    step: int
    notes: tuple[str, ...]


def extract(histories: Histories) -> Extract:
    """Choose records and samples so that a page keeps to its size."""
    own = list(histories.records)
    kept = {round(k) for k in np.linspace(0, len(own) - 1, min(MOST, len(own)))}
    kept |= {own.index(histories.first)}
    records = tuple(own[k] for k in sorted(kept))
    series = max(
        1
        + len(r.controls_rad)
        + len(r.measured) * (1 + len(r.models) + len(r.innovations))
        + (_Q in r.measured) * (1 + len(r.models))
        for r in records
    )
    samples = max(len(r.t_s) for r in records)
    allowed = max(_LEAST, int(BUDGET / (_BYTES * series * len(records))))
    step = max(1, math.ceil(samples / allowed))
    notes = []
    if len(records) < histories.of_records:
        notes.append(f"{len(records)} of {histories.of_records} records are shown, evenly spaced.")
    if step > 1:
        notes.append(
            f"The plots show one sample in {step}, so that the page stays small; the errors count every sample."
        )
    return Extract(records, step, tuple(notes))


def records_section(histories: Histories | None, reason: str = "", note: str = "") -> Section:
    """Return the section of the plots.

    Parameters
    ----------
    histories : the records; None where there are none.
    reason : sentence that says why there are none.
    note : sentence that says how the models were simulated.
    """
    heading, anchor = "Measured against model", "records"
    if histories is None:
        return Section(heading, anchor, notes_html([reason]) if reason else "")
    chosen = extract(histories)
    options = "".join(
        f"<option>{html.escape(r.run_id)}{f' ({html.escape(r.group)})' if r.group else ''}</option>"
        for r in chosen.records
    )
    below = '<option value="residual">residual</option>'
    if all(r.innovations for r in chosen.records):
        below += '<option value="innovation">innovation</option>'
    if all(_Q in r.measured for r in chosen.records):
        below += '<option value="pitch">pitch</option>'
    controls = (
        f'<div class="controls"><label>Record <select id="record">{options}</select></label>'
        '<button type="button" id="record-previous" title="previous record">&lsaquo;</button>'
        '<button type="button" id="record-next" title="next record">&rsaquo;</button>'
        f'<label>Below <select id="below">{below}</select></label>'
        '<label>From <input id="from" type="number" step="0.1"></label>'
        '<label>to <input id="to" type="number" step="0.1"> s</label>'
        '<button type="button" id="whole">whole record</button></div>'
    )
    data = as_json(_data(histories, chosen))
    return Section(
        heading,
        anchor,
        f'{controls}<div class="controls toggles" id="toggles"></div><p class="note" id="condition"></p>'
        f'<div id="plots"></div><script type="application/json" id="records-data">{data}</script>\n'
        + data_table(agreement_table(histories), "agreement")
        + notes_html(
            [
                "Drag over a plot to zoom all of them; a double click shows the whole record.",
                _tolerance_words(chosen.records[0]),
                *([note] if note else []),
                *chosen.notes,
            ]
        ),
    )


def _tolerance_words(record: History) -> str:
    """The tolerances of the motion of a record, as a sentence."""
    proof = next(
        (p for p in PROOFS.values() if set(p.tolerances) & set(record.measured)), PROOFS[LONGITUDINAL.name]
    )
    if proof.pitch is None:
        rates = " and ".join(shown(c)[0].split(" ")[0] for c in proof.tolerances)
        own = next(iter(proof.tolerances.values()))
        return (
            f"Tolerance of a training simulator ({proof.source}), dashed in a residual: {rates} within "
            f"{own.absolute / DEG:g} deg/s, or {100.0 * own.relative:g} % of the measured value."
        )
    return (
        f"Tolerance of a training simulator ({proof.source}), dashed in a residual: "
        f"q within {RATE_RAD_S / DEG:g} deg/s, or pitch within {PITCH_RAD / DEG:g} deg "
        f"(select it below), and az within {NORMAL_M_S2 / G0:.2f} g of the measurement."
    )


def _keys(chosen: Extract) -> list[tuple[str, str]]:
    """Words and style of what the plots show beside the models."""
    keys = [("measured", "measured"), ("tolerance of a simulator", "tolerance")]
    return keys + ([("2 \u03c3 of gusts and noise", "band")] if _floors(chosen) else [])


def _floors(chosen: Extract) -> bool:
    return any(r.floor for r in chosen.records)


def _data(histories: Histories, chosen: Extract) -> dict[str, object]:
    first = chosen.records[0]
    colours = colours_of(histories.models)
    ranks = {name: k // len(MODELS) for k, name in enumerate(reversed(histories.models))}
    return {
        "first": [r.run_id for r in chosen.records].index(histories.first.run_id),
        "controls": [shown(c)[0].split(" ")[0] for c in first.controls_rad],
        "channels": [shown(c)[0] for c in first.measured],
        "tolerances": [
            (OF_CHANNEL[c].absolute if c in OF_CHANNEL else 0.0) * shown(c)[1] for c in first.measured
        ],
        "pitch": {"channel": shown(_Q)[0], "tolerance": PITCH_RAD / DEG},
        "keys": _keys(chosen),
        "models": [
            {"name": m, "colour": colours[m], "dash": list(_DASHES[min(ranks[m], 2)])}
            for m in histories.models
        ],
        "records": [_record(r, histories.models, chosen.step) for r in chosen.records],
    }


def _record(record: History, models: tuple[str, ...], step: int) -> dict[str, object]:
    channels = list(record.measured)
    factors = [shown(c)[1] for c in channels]

    def encoded(values: Array, factor: float = 1.0) -> str:
        with np.errstate(over="ignore", invalid="ignore"):
            single = np.ascontiguousarray(values[::step] * factor, dtype="<f4")
        return base64.b64encode(single.tobytes()).decode("ascii")

    runs = [record.measured, *(record.models[m] for m in models)]
    floor = [record.floor.get(c, 0.0) * f for c, f in zip(channels, factors, strict=True)]
    return {
        "name": record.run_id,
        "words": _words(record),
        "t": encoded(record.t_s),
        "controls": [encoded(x, 1.0 / DEG) for x in record.controls_rad.values()],
        "measured": [encoded(record.measured[c], f) for c, f in zip(channels, factors, strict=True)],
        "models": [
            [encoded(record.models[m][c], f) for c, f in zip(channels, factors, strict=True)] for m in models
        ],
        "innovations": [[encoded(record.innovations[m][c]) for c in channels] for m in models]
        if record.innovations
        else [],
        "pitch": [encoded(pitch_change(own[_Q], record.t_s), 1.0 / DEG) for own in runs if _Q in own],
        "floor": [x if math.isfinite(x) else 0.0 for x in floor],
    }


def _words(record: History) -> str:
    parts = [record.group] if record.group else []
    for key, heading, unit, decimals in _QUANTITIES:
        if key in record.conditions:
            name, _, symbol = heading.partition(" [")
            parts.append(
                f"{name} {Number(record.conditions[key] / unit, decimals=decimals)} {symbol.rstrip(']')}"
            )
    return ", ".join(parts)


def record_errors(histories: Histories) -> Table:
    """Root mean square of the free run's error, per record, channel and model."""
    floors = any(r.floor for r in histories.records)
    rows: list[Row] = []
    for record in histories.records:
        for channel in record.measured:
            name, factor = shown(channel)
            cells = [Number(record.rms(m, channel) * factor, digits=3) for m in histories.models]
            if floors:
                cells.append(Number(record.floor.get(channel, math.nan) * factor, digits=3))
            rows.append((record.run_id, *_group(histories, record), name, *cells))
    keys = ("record", *_group_column(histories), "channel")
    columns = (*keys, *histories.models, *(("floor (shaded)",) if floors else ()))
    return replace(
        flat("Root mean square of measured less simulated, per record", columns, rows), keys=len(keys)
    )


def _group_column(histories: Histories) -> tuple[str, ...]:
    """Heading of the groups; none where no record has one."""
    return ("group",) if any(record.group for record in histories.records) else ()


def _group(histories: Histories, record: History) -> tuple[str, ...]:
    return (record.group or MISSING,) if _group_column(histories) else ()


def conditions_table(histories: Histories) -> Table:
    """Flight condition, mass properties and sampling of every record."""
    known = [q for q in _QUANTITIES if any(q[0] in r.conditions for r in histories.records)]
    rows: list[Row] = [
        (
            record.run_id,
            *_group(histories, record),
            *(
                Number(record.conditions.get(key, math.nan) / unit, decimals=decimals)
                for key, _, unit, decimals in known
            ),
        )
        for record in histories.records
    ]
    return flat(
        "Conditions of the records", ("record", *_group_column(histories), *(q[1] for q in known)), rows
    )


def records_tables(histories: Histories) -> str:
    """Return the tables of the errors of each record as HTML."""
    return data_table(record_errors(histories), "record-errors") + data_table(
        agreement_of_records(histories), "record-agreement"
    )


__all__ = [
    "BUDGET",
    "MOST",
    "conditions_table",
    "extract",
    "record_errors",
    "records_section",
    "records_tables",
]
