"""Aircraft by name or by path: found, read, and checked against their JSBSim model."""

from __future__ import annotations

from pathlib import Path
from typing import Final, get_args

from pydantic import ValidationError

from airtruth import quantity as qt
from airtruth.aircraft.file import FILE, Aircraft, AircraftFile
from airtruth.aircraft.probe import Constants, probe
from airtruth.documents import read_toml
from airtruth.errors import AircraftError, choices
from airtruth.physics.motion_parts import Reference

_INERTIAS: Final = tuple(f"inertia_{axes}_kg_m2" for axes in ("xx", "yy", "zz", "xz"))
"""Moments and product of inertia."""
_AGREE: Final = ("wing_area_m2", f"{get_args(Reference)[0]}_m", "mass_kg", *_INERTIAS)
"""Constants in which aircraft.toml and the JSBSim model have to agree."""


def find(name: str | Path, near: Path | None = None) -> Path:
    """Folder of an aircraft given by path or by name.

    Looked for, in this order: the path itself (a folder or an aircraft.toml), then the folder
    ``aircraft/NAME`` beside ``near``, in the working folder, and among those shipped.

    Raises
    ------
    AircraftError
        If there is none; the message lists the names that exist.
    """
    try:
        return _find(Path(name), near)
    except OSError as error:  # a name that the file system does not take
        raise AircraftError(
            f"aircraft {str(name)[:80]!r} cannot be looked up ({error.strerror}); give a folder that holds {FILE}"
        ) from None


def _find(path: Path, near: Path | None) -> Path:
    for candidate in (path, (near / path) if near else path):
        if candidate.is_file() and candidate.name == FILE:
            return candidate.parent
        if (candidate / FILE).is_file():
            return candidate
    roots = [*([near / "aircraft", near] if near else []), Path("aircraft"), *shipped_roots()]
    for root in roots:
        if (root / path / FILE).is_file():
            return root / path
    known = {p.parent.name for root in roots if root.is_dir() for p in root.glob(f"*/{FILE}")}
    if path.is_dir():
        raise AircraftError(f"{path}: no {FILE} in this folder; see docs/aircraft.md for a minimal one")
    raise AircraftError(
        f"aircraft {str(path)!r} not found; {choices(path.name, known)}; or give a folder that holds {FILE}"
    )


def shipped_roots() -> list[Path]:
    """Folders of the aircraft that come with airtruth, in a wheel or in a checkout."""
    here = Path(__file__).resolve().parents[1]
    return [p for p in (here / "shipped_aircraft", here.parents[1] / "aircraft") if p.is_dir()]


def read_file(folder: Path) -> AircraftFile:
    """Read and validate aircraft.toml.

    Raises
    ------
    AircraftError
        With every problem of the file, not only the first.
    """
    path = folder / FILE
    raw = read_toml(path, AircraftError, "correct it, or see docs/aircraft.md for a minimal one")
    try:
        return AircraftFile.model_validate(raw)
    except ValidationError as error:
        problems = "\n  ".join(qt.explain(error, AircraftFile))
        raise AircraftError(f"{path}:\n  {problems}") from None


def load(name: str | Path, near: Path | None = None) -> Aircraft:
    """Find, read and check an aircraft; its JSBSim model is first loaded in a child process.

    An aircraft.toml that was copied without the files of its JSBSim model is an aircraft without one.

    Raises
    ------
    AircraftError
        If a file is missing or malformed, JSBSim refuses the model, or a property does not exist.
    """
    folder = find(name, near)
    file = read_file(folder)
    if file.jsbsim and file.jsbsim.root == "." and not any(folder.rglob("*.xml")):
        file = file.model_copy(update={"jsbsim": None})
    model_constants = probe(folder, file.jsbsim.model_dump_json()) if file.jsbsim else None
    if model_constants is None and (file.geometry is None or file.mass is None):
        raise AircraftError(
            f"{folder / FILE}: without a JSBSim model it needs [geometry] and [mass]; state them, or copy the model there"
        )
    return Aircraft(folder=folder, file=file, constants=_constants(file, model_constants))


def _constants(file: AircraftFile, model: Constants | None) -> Constants:
    base = model.model_dump() if model else {"cg_fraction": 0.25}
    if file.geometry:
        lengths = {f"{name}_m": getattr(file.geometry, name).value for name in get_args(Reference)}
        base |= {"wing_area_m2": file.geometry.wing_area.value, **lengths}
    if file.mass:
        base |= {
            "mass_kg": file.mass.mass.value,
            "cg_fraction": file.mass.cg.value,
        }
        inertias = {name: getattr(file.mass, name.removesuffix("_kg_m2")) for name in _INERTIAS}
        base |= {name: stated.value for name, stated in inertias.items() if stated is not None}
    constants = Constants.model_validate(base)
    if model and (file.geometry or file.mass):
        for field in _AGREE:
            stated, flown = getattr(constants, field), getattr(model, field)
            if abs(stated - flown) > 1e-3 * abs(flown):
                raise AircraftError(
                    f"{file.name}: {field} is {stated:.6g} in {FILE} but {flown:.6g} in the JSBSim model; "
                    "make them agree, or leave the value out of aircraft.toml to use the model's"
                )
    return constants


__all__ = ["find", "load", "read_file", "shipped_roots"]
