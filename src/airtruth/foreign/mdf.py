"""ASAM measurement files (MDF3 and MDF4): every channel group has times of its own."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.source import Source

Array = NDArray[np.float64]


def read_mdf(path: Path) -> Source:
    """Channels in physical values by name, with their times [s] and units.

    A name that several groups have is "group.channel", where the group is its acquisition name, or "group3".

    Raises
    ------
    ConfigurationError
        If asammdf is not installed.
    StoreError
        If the file is no MDF, or holds no channel of numbers.
    """
    try:
        from asammdf import MDF
    except ImportError:
        raise ConfigurationError(f"{path}: MDF files need asammdf; run: pip install airtruth[mdf]") from None
    try:
        with path.open("rb") as file, MDF(file) as mdf:
            groups = _groups(mdf)
    except MemoryError:
        raise
    except Exception as error:  # asammdf raises MdfException, struct.error, KeyError and others
        raise StoreError(
            f"{path}: is not an MDF file, or is damaged ({reason(error)}); export it again"
        ) from None
    counts = Counter(signal.name for _, signals in groups for signal in signals)
    arrays: dict[str, NDArray[Any]] = {}
    clocks: dict[str, Array] = {}
    units: dict[str, str] = {}
    times: dict[str, Array] = {}
    for group, signals in groups:
        for signal in signals:
            name = signal.name if counts[signal.name] == 1 else f"{group}.{signal.name}"
            arrays[name] = _valid(signal)
            clocks[name] = times.setdefault(group, np.asarray(signal.timestamps, dtype=np.float64))
            if signal.unit:
                units[name] = signal.unit
    if not arrays:
        raise StoreError(f"{path}: holds no channel of numbers; export it again")
    return Source(path, arrays, clocks, units=units, ordered=False)


def _valid(signal: Any) -> NDArray[Any]:
    """Samples of a channel, NaN where the recorder has flagged them as invalid."""
    flagged = signal.invalidation_bits
    if flagged is None or not np.any(flagged):
        return np.asarray(signal.samples)
    samples = np.array(signal.samples, dtype=np.float64)
    samples[np.asarray(flagged, dtype=bool)] = np.nan
    return samples


def _groups(mdf: Any) -> list[tuple[str, list[Any]]]:
    """Name and channels of numbers of each group that has samples and times."""
    taken: set[str] = set()
    result = []
    for number, group in enumerate(mdf.groups):
        master = mdf.masters_db.get(number)
        if master is None or not group.channel_group.cycles_nr:
            continue
        name = str(getattr(group.channel_group, "acq_name", "") or "") or f"group{number}"
        if name in taken:
            name = f"{name}#{number}"
        taken.add(name)
        wanted = [(None, number, i) for i in range(len(group.channels)) if i != master]
        signals = mdf.select(wanted) if wanted else []
        result.append((name, [s for s in signals if s.samples.ndim == 1 and s.samples.dtype.kind in "biuf"]))
    return result


__all__ = ["read_mdf"]
