"""MATLAB files: v5 to v7 by scipy, v7.3 (HDF5) by h5py; structs become paths."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from airtruth.errors import ConfigurationError, StoreError, reason
from airtruth.foreign.unit_words import are_units

_HDF5: Final = b"\x89HDF\r\n\x1a\n"
"""First bytes of an HDF5 file (HDF5 file format specification, version 3, section II.A)."""
_AT: Final = (0, 512)
"""Offsets at which they are searched [byte]; MATLAB writes a text header of 512 bytes before HDF5."""

Arrays = dict[str, NDArray[Any]]
Labels = dict[str, tuple[str, ...]]


def read_mat(path: Path) -> tuple[Arrays, Labels]:
    """Numeric variables by name, struct fields as "a.b", and labels of matrix columns.

    A string array with as many entries as a matrix has columns, or more, is taken for their names, where it is the only
    one of its contents.

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
        raise StoreError(
            f"{path}: holds no numeric array (variables: {', '.join(raw) or 'none'}); save the channels as numeric variables"
        )
    return arrays, _labels(arrays, raw)


def _labels(arrays: Arrays, raw: Arrays) -> Labels:
    """Names of the columns of each matrix.

    String arrays that hold units, or repeat another one, do not count. An array longer than the matrix names its first
    columns, where no other fits: files are cut after their labels were written.
    """
    texts = {
        tuple(str(cell).strip() for cell in values.ravel())
        for values in raw.values()
        if values.dtype.kind in "UO" and all(isinstance(cell, str) for cell in values.ravel())
    }
    names = [t for t in texts if len(t) > 1 and not are_units(t)]
    labels = {}
    for name, values in arrays.items():
        if values.ndim != 2:
            continue
        exact = [t for t in names if len(t) == values.shape[1]]
        longer = [t for t in names if len(t) > values.shape[1]]
        fitting = exact or longer
        if len(fitting) == 1:
            labels[name] = fitting[0][: values.shape[1]]
    return labels


def _column(values: NDArray[Any]) -> NDArray[Any]:
    return values.ravel() if values.ndim == 2 and 1 in values.shape else values


def _classic(path: Path) -> Arrays:
    from scipy.io import loadmat

    try:
        content = loadmat(path, struct_as_record=False, chars_as_strings=True)
    except MemoryError:
        raise
    except Exception as error:  # a wrong byte leads scipy to UnboundLocalError, ZeroDivisionError and others
        raise _damaged(path, "MATLAB", error) from None
    arrays: Arrays = {}
    try:
        for name, value in content.items():
            if not name.startswith("__"):
                _flatten(name, value, arrays)
    except RecursionError:
        raise StoreError(
            f"{path}: its structs are nested too deeply; save the channels as plain variables"
        ) from None
    return arrays


def _flatten(name: str, value: Any, arrays: Arrays) -> None:
    """Structs become paths, those of an array with their number from 1; cells of strings become string arrays."""
    if isinstance(value, np.ndarray) and value.dtype == object:
        if value.size == 1:
            _flatten(name, value.item(), arrays)
            return
        inner = value.ravel(order="F")
        cells = [c.item() if isinstance(c, np.ndarray) and c.size == 1 else c for c in inner]
        if cells and all(hasattr(c, "_fieldnames") for c in cells):
            for number, one in enumerate(cells, 1):
                _flatten(f"{name}({number})", one, arrays)
        else:
            texts = all(isinstance(c, str) for c in cells)
            arrays[name] = np.array(cells, dtype=object) if texts else inner
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
            f"{path}: MATLAB files of version 7.3 need h5py; run: pip install airtruth[measured], or save it with -v7"
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
    except MemoryError:
        raise
    except Exception as error:  # h5py has no class of its own for a damaged file
        raise _damaged(path, "MATLAB 7.3", error) from None
    return arrays


def _damaged(path: Path, format_name: str, error: Exception) -> StoreError:
    return StoreError(
        f"{path}: is not a {format_name} file, or is truncated or damaged ({reason(error)}); save it again"
    )


__all__ = ["read_mat"]
