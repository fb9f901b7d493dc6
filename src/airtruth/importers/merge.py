"""Channels of one or several files on one clock, before they are cut into runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, LogError
from airtruth.importers.align import Alignment, aligned
from airtruth.importers.clock import ONE, Parts, with_increasing_times
from airtruth.importers.constants import constants_of
from airtruth.importers.mapping import MappingFile, Resample
from airtruth.importers.series import Series, read_series
from airtruth.importers.sources import Source

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MergedPiece:
    """A foreign file with its mapping, the alignment of its clock, and the parts of a clock that starts again."""

    source: Source
    mapping: MappingFile
    alignment: Alignment | None = None
    parts: Parts = ONE

    def constants(self, part: tuple[float, float, NDArray[np.bool_] | None]) -> dict[str, float]:
        """`airtruth.importers.constants.constants_of` on the clock of the first file."""
        moved = self.alignment.applied if self.alignment is not None else self.parts.continued
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

    pieces: tuple[MergedPiece, ...]
    series: Mapping[str, Series]
    resample: Resample | None
    notes: tuple[str, ...] = field(default=())
    reading: tuple[str, ...] = field(default=())


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
    series, read_notes, restarts = _read(source, mapping)
    reading = [*read_notes]
    pieces, notes, reference = [MergedPiece(source, mapping, parts=restarts)], [], dict(series)
    for other, own in parts[1:]:
        read, read_notes, others = _read(other, own)
        reading += read_notes
        name = str(other.path)
        if restarts.several or others.several:
            raise LogError(
                f"{name if others.several else source.path}: its clock starts again, and the clocks of several files are "
                "aligned as wholes; export each part as a file, and import it with those of the same time"
            )
        if own.time.run is not None or mapping.time.run is not None:
            raise ConfigurationError(
                f"{name}: files whose rows name their runs cannot be merged; leave [time] run out"
            )
        stated = own.align
        if stated is not None and stated.offset_s is not None:
            alignment = Alignment(stated.offset_s, stated.std_s)
        else:
            alignment = aligned(name, reference, read, stated.channel if stated else None)
        pieces.append(MergedPiece(other, own, alignment))
        notes.append(alignment.sentence(other.path.name))
        for channel, one in read.items():
            if channel not in series:
                series[channel] = one if one.constant else replace(one, t_s=alignment.applied(one.t_s))
    resample = next((m.resample for _, m in parts if m.resample), None)
    if resample is None and len(parts) > 1:
        rates = [1.0 / float(np.median(np.diff(s.t_s))) for s in reference.values() if not s.constant]
        resample = Resample(rate_hz=float(f"{max(rates):.4g}"), method="cubic")
        notes.append(
            f"channels are resampled by cubic splines to {resample.rate_hz:g} Hz, the rate of {source.path.name}"
        )
    return Merged(tuple(pieces), series, resample, tuple(notes), tuple(reading))


def _read(source: Source, mapping: MappingFile) -> tuple[dict[str, Series], list[str], Parts]:
    """Channels on times that increase, what was assumed or left out, and the parts of the record.

    Rows that name their runs stay as they are.
    """
    series = read_series(source, mapping)
    if mapping.time.run is not None:
        return series, list(source.notes), ONE
    series, notes, parts = with_increasing_times(series)
    return series, [*source.notes, *(f"{source.path.name}: {note}" for note in notes)], parts


__all__ = ["Merged", "MergedPiece", "merge"]
