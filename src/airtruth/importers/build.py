"""The runs of merged files as a flight log, with what the import decided in its metadata."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.checks.stated import KEY as STATED
from airtruth.importers.clock import with_increasing_times
from airtruth.importers.derived import with_air_data, with_alpha
from airtruth.importers.held import without_repeats
from airtruth.importers.mapping import Resample
from airtruth.importers.merge import Merged
from airtruth.importers.runs import require_rows, runs_of
from airtruth.importers.uniform import beyond, jitter_of, lost_of, shortened, slower, uniform
from airtruth.logs.flight_log import RECORD_CONSTANTS, RESAMPLED, FlightLog
from airtruth.logs.validate import JITTER
from airtruth.physics.motion import LONGITUDINAL
from airtruth.units import DEG

Array = NDArray[np.float64]

_SHORTENED: Final = "shortened"
"""Key of the metadata that lists what records have lost at their ends."""
_READ: Final = "reading"
"""Key of the metadata that lists what was assumed or left out when the files were read."""


def built(merged: Merged) -> FlightLog:
    """The runs of merged files as a log.

    Raises
    ------
    LogError, ConfigurationError
        As `import_log`.
    """
    source, mapping = merged.pieces[0].source, merged.pieces[0].mapping
    ids, times, blocks, facts, drifts, lost, slow, jitter = [], [], [], {}, [], [], [], 0.0
    missing, repeated = (0, 0.0), list[str]()
    held: dict[str, float] = {}
    for run_id, start, end, rows in runs_of(source, mapping, merged.series, merged.pieces[0].parts):
        where = f"{source.path}, run {run_id!r}"
        if rows is not None:
            require_rows(where, merged.series, len(rows))
        cut = {name: one.between(start, end, rows) for name, one in merged.series.items()}
        if rows is not None:
            increasing, notes, parts = with_increasing_times(cut)
            if not parts.several:  # a run whose clock starts again is refused
                cut, repeated = increasing, [*repeated, *(f"run {run_id!r}: {note}" for note in notes)]
        jitter = max([jitter, *(jitter_of(one) for one in cut.values())])
        if merged.resample is not None and merged.resample.method != "previous":
            number, longest = max(lost_of(one) for one in cut.values())
            missing = (missing[0] + number, max(missing[1], longest))
        cut, rates = without_repeats(cut, merged.resample)
        held |= {name: min(hz, held.get(name, hz)) for name, hz in rates.items()}
        t, values = uniform(where, cut, merged.resample)
        lost += [f"run {run_id!r}: {sentence}" for sentence in [*shortened(cut), *beyond(cut, start, end)]]
        if merged.resample is not None:
            slow.append(slower(cut, merged.resample.rate_hz))
        values = with_air_data(where, values)
        if mapping.reconstruct.alpha:
            values, drift = with_alpha(where, values, (t[-1] - t[0]) / (len(t) - 1), mapping.reconstruct)
            drifts.append(drift)
        ids.append(run_id)
        times.append(t)
        blocks.append(values)
        known = [piece.constants((start, end, rows)) for piece in reversed(merged.pieces)]
        stated = {name: value for one in known for name, value in one.items()}
        if stated:
            facts[run_id] = stated
    metadata = _metadata(merged, times)
    if facts:
        metadata[RECORD_CONSTANTS] = facts
    if merged.resample:
        metadata[RESAMPLED] = _resampled(merged.resample, slow, jitter, missing)
    elif held:
        own_hz = (len(times[0]) - 1) / float(times[0][-1] - times[0][0])
        metadata[RESAMPLED] = _resampled(Resample(rate_hz=float(f"{own_hz:.6g}"), method="linear"), [held])
    reading = [*merged.reading, *repeated, *(f"{name}: {_HELD.format(hz)}" for name, hz in held.items())]
    if reading:
        metadata[_READ] = reading
    if lost:
        metadata[_SHORTENED] = lost
    if drifts:
        metadata["reconstructed"] = {LONGITUDINAL.vane: {"drift_std_deg": float(np.median(drifts)) / DEG}}
    return FlightLog(
        metadata=metadata,
        run_ids=tuple(ids),
        offsets=np.cumsum([0, *(len(t) for t in times)]).astype(np.int64),
        t_s=np.concatenate(times),
        channels={name: np.concatenate([b[name] for b in blocks]) for name in blocks[0]},
    )


_HELD: Final = (
    "each sample is repeated until the next one, {:g} Hz of its own; only these samples are used, and values between are "
    "interpolated"
)
"""Note on a channel of a slower instrument."""


def _resampled(
    resample: Resample,
    slow: Sequence[Mapping[str, float]],
    jitter: float = 0.0,
    missing: tuple[int, float] = (0, 0.0),
) -> dict[str, object]:
    """The common rate, the method, the largest jitter, the samples that are missing with the longest time between two of them,
    and the least rate of each channel that has fewer samples of its own."""
    own_hz: dict[str, float] = {}
    for one in slow:
        own_hz |= {name: min(hz, own_hz.get(name, hz)) for name, hz in one.items()}
    stated: dict[str, object] = {"rate_hz": resample.rate_hz, "method": resample.method}
    stated |= {"jitter": float(f"{jitter:.2g}")} if jitter > JITTER else {}
    stated |= {"missing": missing[0], "longest_s": float(f"{missing[1]:.3g}")} if missing[0] else {}
    return stated | ({"from_hz": own_hz} if own_hz else {})


_METHODS: Final = {
    "linear": "linear interpolation",
    "cubic": "cubic splines",
    "previous": "holding the previous sample",
}
"""Method of [resample] -> its name in a sentence."""


def sentences(log: FlightLog) -> list[str]:
    """Assumed, left-out and resampled channels, and time that records have lost at their ends, in words."""
    stated = [log.metadata.get(key, ()) for key in (_READ, _SHORTENED)]
    listed = [str(text) for one in stated if isinstance(one, Sequence) for text in one]
    how = log.metadata.get(RESAMPLED)
    if isinstance(how, Mapping) and "jitter" in how:
        listed.append(
            f"the steps of the times differ by up to {100.0 * float(how['jitter']):.2g} %: channels are resampled to "
            f"{float(how['rate_hz']):g} Hz by {_METHODS[str(how['method'])]}"
        )
    if isinstance(how, Mapping) and "missing" in how:
        listed.append(
            f"{int(how['missing'])} samples are missing, and up to {float(how['longest_s']):g} s lie between two: they are "
            f"replaced by {_METHODS[str(how['method'])]}; cut a [[manoeuvre]] beside them if the surfaces move"
        )
    return listed


def joined(logs: Sequence[FlightLog]) -> FlightLog:
    """The runs of several records, with what the import stated of each of them.

    Raises
    ------
    LogError
        As `airtruth.logs.flight_log.FlightLog.concat`.
    """
    if len(logs) == 1:
        return logs[0]
    log = FlightLog.concat(logs)
    kept: dict[str, object] = {}
    for key in (_READ, _SHORTENED):
        texts = [str(text) for one in logs for text in _listed(one.metadata.get(key))]
        if texts:
            kept[key] = list(dict.fromkeys(texts))
    how = [one.metadata.get(RESAMPLED) for one in logs]
    same = [one for one in how if isinstance(one, Mapping)]
    if len(same) == len(logs) and len({(one["rate_hz"], one["method"]) for one in same}) == 1:
        jitter = max(float(one.get("jitter", 0.0)) for one in same)
        common = Resample(rate_hz=same[0]["rate_hz"], method=same[0]["method"])
        kept[RESAMPLED] = _resampled(common, [one.get("from_hz", {}) for one in same], jitter)
    return replace(log, metadata={**log.metadata, **kept})


def _listed(entry: object) -> Sequence[object]:
    return entry if isinstance(entry, list | tuple) else ()


def _metadata(merged: Merged, times: Sequence[Array]) -> dict[str, object]:
    mapping = merged.pieces[0].mapping
    metadata: dict[str, object] = {"source": ", ".join(p.source.path.name for p in merged.pieces)}
    if mapping.aircraft:
        metadata["aircraft"] = mapping.aircraft
    metadata[STATED] = {
        name: {"unit": one.unit, "sign": one.sign, "scale": one.scale, "offset": one.offset}
        for piece in reversed(merged.pieces)
        for name, one in piece.mapping.channels.items()
        if name in SIGNALS
    }
    moved = [
        {
            "file": p.source.path.name,
            "offset_s": p.alignment.offset_s,
            "std_s": p.alignment.std_s,
            "drift_ppm": 1e6 * p.alignment.drift,
            "channel": p.alignment.channel,
        }
        for p in merged.pieces
        if p.alignment is not None
    ]
    if moved:
        metadata["alignment"] = moved
    rates = {round((len(t) - 1) / (t[-1] - t[0]), 6) for t in times if len(t) > 1}
    if len(rates) == 1:
        metadata["sample_rate_hz"] = rates.pop()
    return metadata


__all__ = ["built", "joined", "sentences"]
