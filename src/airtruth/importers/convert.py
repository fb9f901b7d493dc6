"""From foreign files and their mappings to a flight log that holds the contract."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from airtruth.checks.fault import Fault
from airtruth.checks.gate import admit
from airtruth.errors import ConfigurationError
from airtruth.importers.build import built, joined, sentences
from airtruth.importers.manoeuvre_result import ManoeuvreResult
from airtruth.importers.manoeuvres import find, read_table
from airtruth.importers.mapping import MappingFile, read_mapping
from airtruth.importers.merge import Merged, merge
from airtruth.importers.runs import run_of_file
from airtruth.importers.sources import Source, open_source, records
from airtruth.logs.flight_log import RECORD_CONSTANTS, FlightLog


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
        log = joined(logs)
        notes = tuple(dict.fromkeys(sentence for one in logs for sentence in sentences(one)))
    else:
        parts = _opened(paths, mappings)
        log = built(parts)
        notes = (*parts.notes, *sentences(log))
    admitted = admit(log, source=", ".join(map(str, paths)), force=force)
    recorded = {"forced": list(admitted.forced), "left_out": list(admitted.left_out)}
    metadata = {**log.metadata, **{key: value for key, value in recorded.items() if value}}
    return Imported(replace(admitted.log, metadata=metadata), admitted.faults, (*notes, *admitted.left_out))


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
    parts = []
    for path, mapping in zip(paths, mappings, strict=True):
        listed = records(open_source(path, mapping.source), mapping.source)
        if len(listed) > 1:
            raise ConfigurationError(
                f"{path}: [source] structs names {len(listed)} records, and one record is searched or merged; name one of them"
            )
        parts.append((listed[0][1], mapping))
    return merge(parts)


def _recorded(path: Path | str, mapping: MappingFile, *, single: bool) -> FlightLog:
    """The runs of one of several records of a layout; each needs names of its own."""
    source = open_source(path, mapping.source)
    if single:
        return convert(source, mapping)
    if not (mapping.manoeuvre or mapping.time.run is not None or mapping.source.structs):
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
    listed = records(source, mapping.source)
    named = [(one, mapping.model_copy(update={"run_id": name}) if name else mapping) for name, one in listed]
    return joined([built(merge([part])) for part in named])


__all__ = ["Imported", "convert", "find_manoeuvres", "import_log"]
