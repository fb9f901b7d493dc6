"""HDF5 files: datasets and fields of tables by their paths, with the units and column names that they state."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.source import Source

_UNITS: Final = ("units", "unit", "Units", "Unit", "UNITS", "UNIT")
"""Attributes that state a unit, the first that a dataset has."""
_LABELS: Final = ("columns", "column_names", "labels", "names", "channels")
"""Attributes that name the columns of a matrix, the first of the right length."""


def read_hdf5(path: Path) -> Source:
    """Datasets of numbers as "group.dataset", fields of a table as "group.dataset.field".

    Links out of the file, and datasets whose values are in other files, are not read.

    Raises
    ------
    ConfigurationError
        If h5py is not installed.
    StoreError
        If the file is no HDF5 file, is damaged, or holds no numbers.
    """
    try:
        import h5py
    except ImportError:
        raise ConfigurationError(
            f"{path}: HDF5 files need h5py; run: pip install airtruth[measured]"
        ) from None
    arrays: dict[str, NDArray[Any]] = {}
    labels: dict[str, tuple[str, ...]] = {}
    units: dict[str, str] = {}

    def visit(name: str, item: Any) -> None:
        if not isinstance(item, h5py.Dataset) or item.external or item.is_virtual or not item.size:
            return
        key = name.replace("/", ".")
        fields = item.dtype.names
        for field in fields or ("",):
            kind = (item.dtype[field] if fields else item.dtype).kind
            shape = item.dtype[field].shape if fields else ()
            if kind not in "biuf" or shape or item.ndim not in (1, 2):
                continue
            values = np.asarray(item.fields(field)[()] if fields else item[()])
            full = f"{key}.{field}" if fields else key
            arrays[full] = values.ravel() if values.ndim == 2 and 1 in values.shape else values
            unit = next((_text(item.attrs[a]) for a in _UNITS if a in item.attrs), "")
            if unit and not fields:
                units[full] = unit
            if arrays[full].ndim == 2:
                for attribute in _LABELS:
                    names = np.atleast_1d(item.attrs.get(attribute, ()))
                    if len(names) == arrays[full].shape[1]:
                        labels[full] = tuple(_text(n) for n in names)
                        break

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except MemoryError:
        raise
    except Exception as error:  # h5py has no class of its own for a damaged file
        raise StoreError(
            f"{path}: is not an HDF5 file, or is truncated or damaged ({reason(error)}); save it again"
        ) from None
    if not arrays:
        raise StoreError(f"{path}: holds no dataset of numbers in one or two dimensions; save it again")
    return Source(path, arrays, labels=labels, units=units, ordered=False)


def _text(value: Any) -> str:
    """Text of an attribute; bytes are UTF-8."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.ravel()[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


__all__ = ["read_hdf5"]
