"""Files of a linear model: .mat for MATLAB, .json, and .py for python-control."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from airtruth.errors import ConfigurationError
from airtruth.exporting.model import LinearModel
from airtruth.logs.atomic import atomic_file, write_text


def write(model: LinearModel, path: Path) -> None:
    """Write a model in the format that the suffix of the file states: one of `SUFFIXES`.

    Raises
    ------
    ConfigurationError
        If the suffix is another.
    StoreError
        If the file cannot be written.
    """
    require_suffix(path)
    SUFFIXES[path.suffix](model, path)


def require_suffix(path: Path) -> None:
    """Refuse a file in whose format no model can be written.

    Raises
    ------
    ConfigurationError
        Naming the formats.
    """
    if path.suffix not in SUFFIXES:
        raise ConfigurationError(f"{path}: the suffix states the format; write one of {', '.join(SUFFIXES)}")


def _json(model: LinearModel, path: Path) -> None:
    write_text(path, json.dumps(model.to_dict(), indent=1, allow_nan=False) + "\n")


def _mat(model: LinearModel, path: Path) -> None:
    from scipy.io import savemat

    stated = model.to_dict()
    parts: dict[str, Any] = {
        "motion": model.motion.name,
        "source": model.source,
        "notes": _cells(model.notes),
        **model.matrices,
        "operating_point": model.point.to_dict(),
        "derivatives": {
            "names": _cells(model.motion.parameters),
            "units": _cells(stated["derivatives"]["units"]),
            "values": model.derivatives[:, None],
            "covariance": model.derivative_covariance,
        },
        "entries": {"names": _cells(model.entries), "covariance": model.covariance},
    }
    for kind in ("state", "input", "output"):
        listed = stated[f"{kind}s"]
        parts[f"{kind}_names"] = _cells([one["name"] for one in listed])
        parts[f"{kind}_units"] = _cells([one["unit"] for one in listed])
    with atomic_file(path) as file:
        savemat(file, parts, oned_as="column")


def _cells(texts: Sequence[str]) -> Any:
    """Texts as a row of cells."""
    cells = np.empty((1, len(texts)), dtype=object)
    cells[0, :] = list(texts)
    return cells


def _python(model: LinearModel, path: Path) -> None:
    names = {"states": model.states, "inputs": model.inputs, "outputs": model.outputs}
    matrices = [
        f"{name} = np.array(\n    {json.dumps(matrix.tolist())}\n)" for name, matrix in model.matrices.items()
    ]
    point = "\n".join(f"#   {name} = {value!r}" for name, value in model.point.to_dict().items())
    arguments = ",\n    ".join(f"{kind}={list(value)!r}" for kind, value in names.items())
    notes = "".join(f"# {line}\n" for note in model.notes for line in note.splitlines())
    write_text(
        path,
        f"# {model.motion.heading}: {' '.join(model.source.split())}\n{notes}"
        f"# Deviations from the operating point [SI]:\n{point}\n"
        "import control\nimport numpy as np\n\n" + "\n".join(matrices) + "\n"
        f"model = control.ss(\n    A,\n    B,\n    C,\n    D,\n    {arguments},\n)\n",
    )


SUFFIXES: Final[Mapping[str, Callable[[LinearModel, Path], None]]] = MappingProxyType(
    {".mat": _mat, ".json": _json, ".py": _python}
)
"""Suffix of a file -> its writer."""

__all__ = ["SUFFIXES", "require_suffix", "write"]
