"""PX4 logs: every topic has a clock of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason

Array = NDArray[np.float64]


def read_ulog(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Array]]:
    """Fields as "topic.field" (of further instances "topic#1.field"), and their times [s].

    Raises
    ------
    ConfigurationError
        If pyulog is not installed.
    StoreError
        If the file is no ULog, or holds no data.
    """
    try:
        from pyulog import ULog
    except ImportError:
        raise ConfigurationError(f"{path}: PX4 logs need pyulog; run: pip install airtruth[ulog]") from None
    try:
        with path.open("rb") as file:
            log = ULog(file)
    except MemoryError:
        raise
    except Exception as error:  # pyulog raises TypeError, struct.error, IndexError and plain Exception
        raise StoreError(
            f"{path}: is not a PX4 log, or is damaged ({reason(error)}); download it again"
        ) from None
    arrays: dict[str, NDArray[Any]] = {}
    clocks: dict[str, Array] = {}
    for topic in log.data_list:
        if "timestamp" not in topic.data:  # ULog requires one; without it the samples have no times
            continue
        prefix = topic.name if topic.multi_id == 0 else f"{topic.name}#{topic.multi_id}"
        times = topic.data["timestamp"].astype(np.float64) * 1e-6
        for name, values in topic.data.items():
            arrays[f"{prefix}.{name}"] = values
            clocks[f"{prefix}.{name}"] = times
    if not arrays:
        raise StoreError(f"{path}: the log holds no topic; record it again")
    return arrays, clocks


__all__ = ["read_ulog"]
