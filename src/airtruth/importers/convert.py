"""From foreign files and their mappings to a flight log that holds the contract."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from airtruth.channels import SIGNALS
from airtruth.checks.fault import Fault
from airtruth.checks.gate import admit
from airtruth.checks.stated import KEY as STATED
from airtruth.errors import ConfigurationError
from airtruth.importers.align import Alignment, aligned
from airtruth.importers.clock import with_increasing_times
from airtruth.importers.constants import constants_of
from airtruth.importers.derived import with_air_data, with_alpha
from airtruth.importers.manoeuvre_result import ManoeuvreResult
from airtruth.importers.manoeuvres import find, read_table
from airtruth.importers.mapping import MappingFile, Resample, read_mapping
from airtruth.importers.runs import require_rows, run_of_file, runs_of
from airtruth.importers.series import Series, read_series
from airtruth.importers.sources import Source, open_source
from airtruth.importers.uniform import beyond, shortened, slower, uniform
from airtruth.logs.flight_log import RECORD_CONSTANTS, RESAMPLED, FlightLog
from airtruth.units import DEG

Array = NDArray[np.float64]


_SHORTENED: Final = "shortened"
"""Key of the metadata that lists what records have lost at their ends."""
_READ: Final = "reading"
"""Key of the metadata that lists what was assumed or left out when the files were read."""


@dataclass(frozen=True)
class Imported:
    """An imported log and the faults that did not stop the import.

    Attributes
    ----------
    log : keeps the log contract; its metadata list the faults that ``force`` overruled under "forced".
    faults : uncertain faults of `airtruth.checks.gate`; with ``force`` the certain ones too.
    notes : sentences on what the import decided by itself: offsets of clocks, a reconstructed channel.
    """

    log: FlightLog
    faults: tuple[Fault, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Piece:
    """A foreign file with its mapping and the alignment of its clock."""

    source: Source
    mapping: MappingFile
    alignment: Alignment | None = None

    def constants(self, part: tuple[float, float, NDArray[np.bool_] | None]) -> dict[str, float]:
        """`airtruth.importers.constants.constants_of` on the clock of the first file."""
        moved = self.alignment.applied if self.alignment is not None else np.asarray
        return constants_of(self.source, self.mapping, part, moved)


@dataclass(frozen=True)
class Merged:
    """Channels of one or several files on the clock of the first one, before they are cut and resampled.

    Attributes
    ----------
    pieces : the files; the first one's mapping states runs and resampling.
    series : channel -> samples.
    resample : common rate; None if all channels share their times.
    notes : sentences on the alignment.
    reading : sentences on what was assumed or left out of the files.
    """

    pieces: tuple[Piece, ...]
    series: Mapping[str, Series]
    resample: Resample | None
    notes: tuple[str, ...] = field(default=())
    reading: tuple[str, ...] = field(default=())


def import_log(
    path: Path | str | Sequence[Path | str],
    mapping: MappingFile | Path | str | Sequence[MappingFile | Path | str],
    *,
    manoeuvres: Path | str | None = None,
    force: bool = False,
) -> Imported:
    """Read foreign files through mappings, and test the result against physics.

    Parameters
    ----------
    path : a file, or several. With one mapping for several files each file is a record of its own; with as many mappings
        as files they are recorders of one flight, which are merged on the clock of the first.
    mapping : mapping or its file, or one for each file.
    manoeuvres : table of start and stop times (`airtruth.importers.manoeuvres.read_table`), which replaces [[manoeuvre]].
    force : keep a log that contradicts physics; a breach of the log contract is refused nevertheless.

    Raises
    ------
    StoreError
        If a file cannot be read.
    ConfigurationError
        If a mapping or table cannot be used as written, or there are neither one nor as many mappings as files.
    LogError
        If a column is missing or not numeric, times do not increase, clocks cannot be aligned, the mapping contradicts
        physics, or the result breaks the contract; the message says which and what to do.
    """
    paths, mappings = _given(path, mapping)
    if manoeuvres is not None:
        if len(mappings) < len(paths):
            raise ConfigurationError(
                f"{manoeuvres}: a table of manoeuvres has the times of one flight; import its files one by one"
            )
        mappings[0] = _with_manoeuvres(mappings[0], manoeuvres)
    notes: tuple[str, ...] = ()
    if len(mappings) == 1:
        logs = [_recorded(one, mappings[0], single=len(paths) == 1) for one in paths]
        log = logs[0] if len(logs) == 1 else FlightLog.concat(logs)
        notes = tuple(sentence for one in logs for sentence in _lost(one))
    else:
        parts = _opened(paths, mappings)
        log = built(parts)
        notes = (*parts.notes, *_lost(log))
    admitted = admit(log, source=", ".join(map(str, paths)), force=force)
    recorded = {"forced": list(admitted.forced), "left_out": list(admitted.left_out)}
    metadata = {**log.metadata, **{key: value for key, value in recorded.items() if value}}
    return Imported(replace(admitted.log, metadata=metadata), admitted.faults, (*notes, *admitted.left_out))


def _lost(log: FlightLog) -> Sequence[str]:
    """What was assumed or left out, and what records have lost at their ends, in words."""
    stated = [log.metadata.get(key, ()) for key in (_READ, _SHORTENED)]
    return [str(sentence) for one in stated if isinstance(one, Sequence) for sentence in one]


def find_manoeuvres(
    path: Path | str | Sequence[Path | str],
    mapping: MappingFile | Path | str | Sequence[MappingFile | Path | str],
) -> ManoeuvreResult:
    """Manoeuvres of one flight, for a person to accept or edit.

    Parameters
    ----------
    path, mapping : as in `import_log`; several files need a mapping each.

    Raises
    ------
    StoreError, ConfigurationError, LogError
        As `import_log`, and if elevator or q is not mapped.
    """
    paths, mappings = _given(path, mapping)
    if len(mappings) < len(paths):
        raise ConfigurationError(
            "--find-manoeuvres: searches one flight; state one file, or a mapping for each"
        )
    if mappings[0].time.run is not None:
        raise ConfigurationError(
            "--find-manoeuvres: [time] run divides the file into runs already; leave it out"
        )
    merged = _opened(paths, mappings)
    rate_hz = merged.resample.rate_hz if merged.resample else None
    return find(str(paths[0]), merged.series, rate_hz)


def _given(
    path: Path | str | Sequence[Path | str],
    mapping: MappingFile | Path | str | Sequence[MappingFile | Path | str],
) -> tuple[list[Path | str], list[MappingFile]]:
    """Files and mappings as lists, of fitting length."""
    paths = [path] if isinstance(path, Path | str) else list(path)
    stated = [mapping] if isinstance(mapping, MappingFile | Path | str) else list(mapping)
    mappings = [one if isinstance(one, MappingFile) else read_mapping(one) for one in stated]
    if len(mappings) not in (1, len(paths)) or not paths:
        raise ConfigurationError(
            f"import: {len(paths)} files and {len(mappings)} mappings; state one mapping for records of one layout, or "
            "one for each recorder of a flight"
        )
    return paths, mappings


def _with_manoeuvres(mapping: MappingFile, table: Path | str) -> MappingFile:
    if mapping.time.run is not None:
        raise ConfigurationError(
            f"{table}: [time] run of the mapping divides the file into runs already; leave one of the two out"
        )
    return mapping.model_copy(update={"manoeuvre": read_table(table)})


def _opened(paths: Sequence[Path | str], mappings: Sequence[MappingFile]) -> Merged:
    return merge([(open_source(one, m.source), m) for one, m in zip(paths, mappings, strict=True)])


def _recorded(path: Path | str, mapping: MappingFile, *, single: bool) -> FlightLog:
    """The runs of one of several records of a layout; each needs names of its own."""
    source = open_source(path, mapping.source)
    if single:
        return convert(source, mapping)
    if not mapping.manoeuvre and mapping.time.run is None:
        return convert(source, mapping.model_copy(update={"run_id": run_of_file(source)}))
    named, stem = convert(source, mapping), run_of_file(source)
    return replace(
        named,
        run_ids=tuple(f"{stem}:{run}" for run in named.run_ids),
        metadata={**named.metadata, **_renamed(named, stem)},
    )


def _renamed(log: FlightLog, stem: str) -> dict[str, object]:
    facts = log.metadata.get(RECORD_CONSTANTS)
    if not isinstance(facts, Mapping):
        return {}
    return {RECORD_CONSTANTS: {f"{stem}:{run}": values for run, values in facts.items()}}


def convert(source: Source, mapping: MappingFile) -> FlightLog:
    """Channels in SI and float64, runs, uniform times; nothing is judged by physics here.

    Raises
    ------
    LogError, ConfigurationError
        As `import_log`.
    """
    return built(merge([(source, mapping)]))


def merge(parts: Sequence[tuple[Source, MappingFile]]) -> Merged:
    """Channels of one or several files on the clock of the first one.

    A channel that several files hold is that of the first one of them. Without [resample] several files get the rate of
    the first file's fastest channel.

    Raises
    ------
    LogError, ConfigurationError
        As `import_log`.
    """
    source, mapping = parts[0]
    series, read_notes = _read(source, mapping)
    reading = [*read_notes]
    pieces, notes, reference = [Piece(source, mapping)], [], dict(series)
    for other, own in parts[1:]:
        read, read_notes = _read(other, own)
        reading += read_notes
        name = str(other.path)
        if own.time.run is not None or mapping.time.run is not None:
            raise ConfigurationError(
                f"{name}: files whose rows name their runs cannot be merged; leave [time] run out"
            )
        stated = own.align
        if stated is not None and stated.offset_s is not None:
            alignment = Alignment(stated.offset_s, stated.std_s)
        else:
            alignment = aligned(name, reference, read, stated.channel if stated else None)
        pieces.append(Piece(other, own, alignment))
        notes.append(alignment.sentence(other.path.name))
        for channel, one in read.items():
            if channel not in series:
                series[channel] = one if one.constant else replace(one, t_s=alignment.applied(one.t_s))
    resample = next((m.resample for _, m in parts if m.resample), None)
    if resample is None and len(parts) > 1:
        rates = [1.0 / float(np.median(np.diff(s.t_s))) for s in reference.values() if not s.constant]
        resample = Resample(rate_hz=float(f"{max(rates):.4g}"), method="cubic")
        notes.append(f"channels are resampled to {resample.rate_hz:g} Hz, the rate of {source.path.name}")
    return Merged(tuple(pieces), series, resample, tuple(notes), tuple(reading))


def _read(source: Source, mapping: MappingFile) -> tuple[dict[str, Series], list[str]]:
    """Channels on times that increase, and what was assumed or left out; rows that name their runs stay as they are."""
    series = read_series(source, mapping)
    if mapping.time.run is not None:
        return series, list(source.notes)
    series, notes = with_increasing_times(series)
    return series, [*source.notes, *(f"{source.path.name}: {note}" for note in notes)]


def built(merged: Merged) -> FlightLog:
    """The runs of merged files as a log.

    Raises
    ------
    LogError, ConfigurationError
        As `import_log`.
    """
    source, mapping = merged.pieces[0].source, merged.pieces[0].mapping
    ids, times, blocks, facts, drifts, lost, slow = [], [], [], {}, [], [], []
    for run_id, start, end, rows in runs_of(source, mapping, merged.series):
        where = f"{source.path}, run {run_id!r}"
        if rows is not None:
            require_rows(where, merged.series, len(rows))
        cut = {name: one.between(start, end, rows) for name, one in merged.series.items()}
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
        metadata[RESAMPLED] = _resampled(merged.resample, slow)
    if merged.reading:
        metadata[_READ] = list(merged.reading)
    if lost:
        metadata[_SHORTENED] = lost
    if drifts:
        metadata["reconstructed"] = {"alpha_rad": {"drift_std_deg": float(np.median(drifts)) / DEG}}
    return FlightLog(
        metadata=metadata,
        run_ids=tuple(ids),
        offsets=np.cumsum([0, *(len(t) for t in times)]).astype(np.int64),
        t_s=np.concatenate(times),
        channels={name: np.concatenate([b[name] for b in blocks]) for name in blocks[0]},
    )


def _resampled(resample: Resample, slow: Sequence[Mapping[str, float]]) -> dict[str, object]:
    """The common rate, the method, and the least rate of each channel that has fewer samples of its own."""
    own_hz: dict[str, float] = {}
    for one in slow:
        own_hz |= {name: min(hz, own_hz.get(name, hz)) for name, hz in one.items()}
    stated: dict[str, object] = {"rate_hz": resample.rate_hz, "method": resample.method}
    return stated | ({"from_hz": own_hz} if own_hz else {})


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


__all__ = [
    "Imported",
    "Merged",
    "Piece",
    "built",
    "convert",
    "find_manoeuvres",
    "import_log",
    "merge",
]
