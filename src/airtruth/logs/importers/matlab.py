"""MATLAB files: v5 to v7 by scipy, v7.3 (HDF5) by h5py; structs become paths."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError

_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_AT: Final = (0, 512)  # MATLAB puts a text header of 512 bytes before HDF5

Arrays = dict[str, NDArray[Any]]
Labels = dict[str, tuple[str, ...]]


def read_mat(path: Path) -> tuple[Arrays, Labels]:
    """Numeric variables by name, struct fields as "a.b", and labels of matrix columns.

    A string array with as many entries as a matrix has columns is taken for their names, where it is the
    only one.

    Raises
    ------
    StoreError
        If the file is truncated, damaged or no .mat file.
    ConfigurationError
        If it is of version 7.3 and h5py is not installed.
    """
    with path.open("rb") as file:
        head = file.read(520)
    modern = any(head[at : at + 8] == _HDF5 for at in _AT)
    raw = _hdf5(path) if modern else _classic(path)
    numeric = {name: _column(values) for name, values in raw.items() if values.dtype.kind in "biuf"}
    arrays = {name: values for name, values in numeric.items() if values.ndim in (1, 2) and values.size}
    if not arrays:
        raise StoreError(f"{path}: holds no numeric array (variables: {', '.join(raw) or 'none'})")
    return arrays, _labels(arrays, raw)


def _labels(arrays: Arrays, raw: Arrays) -> Labels:
    texts = [
        tuple(str(cell).strip() for cell in values.ravel())
        for values in raw.values()
        if values.dtype.kind in "UO" and all(isinstance(cell, str) for cell in values.ravel())
    ]
    labels = {}
    for name, values in arrays.items():
        fitting = [t for t in texts if values.ndim == 2 and len(t) == values.shape[1]]
        if len(fitting) == 1:
            labels[name] = fitting[0]
    return labels


def _column(values: NDArray[Any]) -> NDArray[Any]:
    return values.ravel() if values.ndim == 2 and 1 in values.shape else values


def _classic(path: Path) -> Arrays:
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    try:
        content = loadmat(path, struct_as_record=False, chars_as_strings=True)
    except (
        MatReadError,
        ValueError,
        TypeError,
        OSError,
        EOFError,
        KeyError,
        IndexError,
        zlib.error,
    ) as error:
        raise StoreError(
            f"{path}: is not a MATLAB file, or is truncated or damaged ({str(error).splitlines()[0]}); save it again"
        ) from None
    arrays: Arrays = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, arrays)
    return arrays


def _flatten(name: str, value: Any, arrays: Arrays) -> None:
    """Structs of one element become paths; cells of strings become string arrays."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        if value.size == 1:
            _flatten(name, value.item(), arrays)
        else:
            cells = [c.item() if isinstance(c, np.ndarray) and c.size == 1 else c for c in value.ravel()]
            arrays[name] = (
                np.array(cells, dtype=object) if all(isinstance(c, str) for c in cells) else value.ravel()
            )
    elif hasattr(value, "_fieldnames"):
        for key in value._fieldnames:
            _flatten(f"{name}.{key}", getattr(value, key), arrays)
    elif isinstance(value, np.ndarray):
        arrays[name] = value


def _hdf5(path: Path) -> Arrays:
    try:
        import h5py
    except ImportError:
        raise ConfigurationError(
            f"{path}: MATLAB files of version 7.3 need h5py; install airtruth[measured], or save it with -v7"
        ) from None
    arrays: Arrays = {}

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#") and item.dtype.kind in "biuf":
            kind = item.attrs.get("MATLAB_class", b"double")
            if kind != b"char" and "MATLAB_empty" not in item.attrs:
                arrays[name.replace("/", ".")] = np.asarray(item[()]).T  # HDF5 holds them transposed

    try:
        with h5py.File(path, "r") as file:
            file.visititems(visit)
    except (OSError, KeyError, RuntimeError) as error:
        raise StoreError(
            f"{path}: is not a MATLAB 7.3 file, or is truncated or damaged ({str(error).splitlines()[0]}); save it again"
        ) from None
    return arrays


__all__ = ["read_mat"]
