"""The frequency responses of the records beside those of the models, with their coherence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import shown
from airtruth.charts import Area, Chart, Colour, Line, Panel, Rule, Stroke, colours_of
from airtruth.charts import as_html as chart_html
from airtruth.logs.histories import Histories, History
from airtruth.numerics.frequency_response import LEAST_COHERENCE, FrequencyResponse, frequency_response
from airtruth.physics.sensor_errors import INSTRUMENTS
from airtruth.reporting.pages.page import Section, notes_html

Array = NDArray[np.float64]

HIGHEST_HZ: Final = 5.0
"""End of the scale of frequency [Hz] (judgement: beyond the short period of a small aircraft)."""
ALONE: Final = 0.9
"""Share of the variance of all controls from which one counts as the input of a record [-] (judgement: the response to the others
is then small)."""
MOST_MODELS: Final = 4
"""Most models in the figure [-] (judgement: lines that a reader can follow)."""
_STROKES: Final[tuple[Stroke, ...]] = ("solid", "dashed", "dotted", "solid")
"""Strokes beside the colours."""
_Z: Final = 1.959963984540054
"""Normal quantile of a two-sided interval of 95 % [-]."""


def frequency_section(histories: Histories | None) -> Section:
    """Return the section of the frequency responses; empty without records, one sentence without coherence."""
    heading, anchor = "Frequency response", "frequency"
    if histories is None:
        return Section(heading, anchor, "")
    chart = response_chart(histories)
    if chart is None:
        words = (
            f"No frequency response is shown: the coherence of these records is nowhere at least {LEAST_COHERENCE:g} and "
            "significant. Longer records, more of them, or a larger manoeuvre raise it."
        )
        return Section(heading, anchor, notes_html([words]))
    return Section(heading, anchor, chart_html(chart))


def frequency_charts(histories: Histories | None) -> tuple[Chart, ...]:
    """Return the chart of the frequency responses; none where there is none to show."""
    chart = None if histories is None else response_chart(histories)
    return () if chart is None else (chart,)


def response_chart(histories: Histories) -> Chart | None:
    """Magnitude, phase and coherence of rates and az over the controls; None where the coherence permits none.

    Of several controls each has the records in which it alone moves.
    """
    alike = _alike(histories)
    models = list(reversed(histories.models))[:MOST_MODELS]
    if not alike:
        return None
    dt = _step(alike[0])
    columns = []
    permitted, used = False, 0
    for channel, control in _pairs(histories.first):
        records = [r for r in alike if _moves_alone(r, control)]
        if not records:
            continue
        used = max(used, len(records))
        measured = _response(records, control, [r.measured[channel] for r in records], dt)
        permitted |= bool(measured.permitted.any())
        simulated = {
            m: _response(records, control, [r.models[m][channel] for r in records], dt)
            for m in models
            if all(_usable(r.models[m][channel]) for r in records)
        }
        label = f"{_short(channel)}/{_short(control)} [dB]"
        columns.append(_panels(label, measured, simulated, colours_of(histories.models)))
    if not permitted:
        return None
    left = len(histories.models) - len(models)
    return Chart(
        name="frequency",
        title="Frequency response of the records and of the models",
        panels=tuple(panel for row in zip(*columns, strict=True) for panel in row),
        columns=len(columns),
        caption=f"Spectra averaged over {used} records and over neighbouring lines; the models pass through the same "
        f"estimate. Shown where the coherence is at least {LEAST_COHERENCE:g} and significant at 5 %; shaded: 95 % interval. "
        "A closed loop would bias the estimate." + (f" {left} further models are left out." if left else ""),
    )


def _pairs(record: History) -> Iterator[tuple[str, str]]:
    """Outputs and the control over which each is shown: rates and az over one control, of several each over its own rate."""
    controls = list(record.controls_rad)
    rates = [c for c in record.measured if INSTRUMENTS[c] == "gyro"]
    late = [c for c in record.measured if INSTRUMENTS[c] == "accelerometer"]
    if len(controls) > 1:
        yield from zip(rates, controls, strict=False)
    else:
        yield from ((channel, controls[0]) for channel in (*rates, *late))


def _moves_alone(record: History, control: str) -> bool:
    """Whether a control has nearly all of the variance of the controls."""
    variances = {c: float(np.var(x)) for c, x in record.controls_rad.items()}
    return len(variances) == 1 or variances[control] >= ALONE * sum(variances.values()) > 0.0


def _short(channel: str) -> str:
    return shown(channel)[0].split(" ")[0]


_LEAST_SAMPLES: Final = 64
"""Shortest record [samples] (judgement: some lines of a spectrum within the band)."""


def _alike(histories: Histories) -> list[History]:
    """Complete records with the sample period of the first of them; the spectra need one."""
    own = [
        r
        for r in histories.records
        if len(r.t_s) >= _LEAST_SAMPLES
        and _step(r) > 0.0
        and all(_usable(values) for values in (*r.controls_rad.values(), *r.measured.values()))
    ]
    return [r for r in own if abs(_step(r) - _step(own[0])) < 1e-3 * _step(own[0])]


def _usable(values: Array) -> bool:
    """Whether a spectrum can be made of a signal."""
    return bool(np.isfinite(values).all()) and float(np.abs(values).max()) < _LARGEST


_LARGEST: Final = 1e9
"""Size from which a value is no signal [SI] (judgement: beyond any aircraft, and its fourth power does not overflow)."""


def _step(record: History) -> float:
    return float(record.t_s[-1] - record.t_s[0]) / max(len(record.t_s) - 1, 1)


def _response(records: list[History], control: str, outputs: list[Array], dt_s: float) -> FrequencyResponse:
    highest = min(HIGHEST_HZ, 0.4 / dt_s)
    return frequency_response([r.controls_rad[control] for r in records], outputs, dt_s, highest)


def _panels(
    label: str,
    measured: FrequencyResponse,
    models: Mapping[str, FrequencyResponse],
    colours: Mapping[str, Colour],
) -> list[Panel]:
    """Magnitude, phase and coherence."""
    at = np.log10(measured.frequency_hz)
    permitted = measured.permitted
    db, phase = _polar(measured, permitted)
    spread = _Z * measured.error
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = 20.0 * np.log10(np.maximum(1.0 - spread, 1e-3)), 20.0 * np.log10(1.0 + spread)
    lines_db = [_line(at, db, "measured", "ink", "points")]
    lines_phase = [_line(at, phase, "measured", "ink", "points")]
    for k, (name, own) in enumerate(models.items()):
        own_db, own_phase = _polar(own, permitted)
        # the turn that lies next to the measurement
        turn = np.round(np.nan_to_num(np.nanmedian(phase - own_phase) if permitted.any() else 0.0) / 360.0)
        lines_db.append(_line(at, own_db, name, colours[name], _STROKES[k]))
        lines_phase.append(_line(at, own_phase + 360.0 * turn, name, colours[name], _STROKES[k]))
    wide = np.degrees(spread)
    ends = (float(at[0]), float(np.log10(HIGHEST_HZ)))
    base = Panel(x_limits=ends, x_log=True)
    words = "" if permitted.any() else "coherence too low"
    return [
        replace(
            base,
            y_label=label,
            lines=tuple(lines_db),
            areas=(_area(at, db + low, db + high),),
            words=words,
        ),
        replace(
            base,
            y_label="phase [deg]",
            lines=tuple(lines_phase),
            areas=(_area(at, phase - wide, phase + wide),),
            words=words,
        ),
        replace(
            base,
            x_label="frequency [Hz]",
            y_label="coherence [-]",
            lines=(_line(at, measured.coherence, "", "ink", "solid"),),
            rules=(Rule(LEAST_COHERENCE, axis="y", label="least coherence"),),
            y_limits=(0.0, 1.05),
        ),
    ]


def _polar(own: FrequencyResponse, shown: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Magnitude [dB] and continuous phase [deg] where they are shown, NaN elsewhere."""
    db, phase = np.full((2, len(shown)), np.nan)
    with np.errstate(divide="ignore"):
        db[shown] = 20.0 * np.log10(np.abs(own.response[shown]))
    phase[shown] = np.degrees(np.unwrap(np.angle(own.response[shown])))
    return db, phase


def _line(x: Array, y: Array, label: str, colour: Colour, stroke: Stroke) -> Line:
    return Line(tuple(x.tolist()), tuple(y.tolist()), label, colour, stroke)


def _area(x: Array, low: Array, high: Array) -> Area:
    return Area(
        tuple(x.tolist()), tuple(low.tolist()), tuple(high.tolist()), "95 % interval, measured", "grey"
    )


__all__ = ["frequency_charts", "frequency_section", "response_chart"]
