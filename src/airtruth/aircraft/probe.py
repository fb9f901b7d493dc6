"""Load a JSBSim model in a child process, where an abort inside JSBSim cannot take the caller down.

JSBSim aborts the process (SIGABRT) on some malformed models, segfaults on others, and creates a misspelt property
instead of refusing it. A child process therefore loads the model first, looks up its properties and answers as JSON.
"""

from __future__ import annotations

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from airtruth.aircraft.jsbsim.confine import controls_simulation, model_files
from airtruth.errors import AircraftError
from airtruth.isolation.client import call
from airtruth.isolation.limits import ProcessLimits
from airtruth.isolation.protocol import IsolatedError, Task
from airtruth.logs.temporary import private_folder, remove
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.quantity import Strict
from airtruth.units import FT, SLUG

_LIMITS: Final = ProcessLimits(seconds=60.0, memory_bytes=3_000_000_000)
"""Limits of JSBSim while it loads a model (judgement: far above those of any shipped model, and a user still waits for the
message)."""
_MODULES: Final = ("airtruth.aircraft.probe_child", "jsbsim")
"""Modules of the process that loads a model."""
_WRITTEN: Final = ("six_axes", "rotary_gust", "roll_gust", "yaw_gust")
"""Entries of the [jsbsim] table with a property that flights write."""
_OUTPUT_LINES: Final = 6
"""Lines of JSBSim's output that an error quotes [-] (judgement: its own message and what precedes it)."""


class Constants(Strict):
    """Geometry and mass of a model as loaded: S [m2], c and span [m], mass [kg], inertias about the CG [kg m2].

    inertia_xx_kg_m2, inertia_zz_kg_m2, inertia_xz_kg_m2 are 0 where neither the model nor aircraft.toml states them; Ixz is the
    integral of x z dm.

    cg_fraction is the position of the CG behind the leading edge of the MAC, as a fraction of it; 0.25 for a model
    that does not state it.
    """

    wing_area_m2: float
    chord_m: float
    span_m: float
    mass_kg: float
    inertia_yy_kg_m2: float
    cg_fraction: float = 0.25
    inertia_xx_kg_m2: float = 0.0
    inertia_zz_kg_m2: float = 0.0
    inertia_xz_kg_m2: float = 0.0


def probe(folder: Path, jsbsim_json: str) -> Constants:
    """Load the model that aircraft.toml names and return its constants.

    Parameters
    ----------
    folder : folder of aircraft.toml.
    jsbsim_json : its [jsbsim] table as JSON.

    Raises
    ------
    AircraftError
        If the model is missing or may not be loaded (`airtruth.aircraft.jsbsim.confine`), JSBSim refuses it or dies
        on it, or a named property does not exist.
    """
    table = json.loads(jsbsim_json)
    _refuse_control(folder, table)
    xml = model_file(folder, table["root"], table["model"])
    if xml.is_file():
        model_files(xml, wheel_root())
    try:
        str(folder.resolve()).encode()
    except UnicodeEncodeError:
        raise AircraftError(
            f"{folder}: JSBSim cannot open a folder whose name is not UTF-8; rename it, or use a UTF-8 locale"
        ) from None
    scratch = private_folder()
    try:
        output = scratch / "output"
        arguments = {key: table[key] for key in ("root", "model", "declare")}
        arguments |= {"folder": str(folder.absolute()), "properties": _named(table), "output": str(output)}
        task = Task("airtruth.aircraft.probe_child:load", arguments, _LIMITS, _MODULES)
        try:
            answer: dict[str, Any] = dict(call(task).facts)
        except IsolatedError as error:
            raise AircraftError(f"{folder}: {_explain(error, output)}") from None
    finally:
        remove(scratch)
    if "error" in answer:
        raise AircraftError(f"{folder}: {answer['error']}")
    return Constants.model_validate(answer["constants"])


def _explain(error: IsolatedError, output: Path) -> str:
    """A process that gave no answer, as a sentence, and the output of JSBSim before that."""
    if error.kind == "time":
        return f"JSBSim did not finish loading the model within {_LIMITS.seconds:.0f} s"
    if error.kind == "memory":
        return f"JSBSim needs more than {_LIMITS.memory_bytes / 1e9:.2g} GB of memory to load the model"
    if error.kind == "start":
        return f"no process starts to load the model ({error.detail}); raise the limits of memory and processes (ulimit -v, -u)"
    printed = output.read_text(encoding="utf-8", errors="replace") if output.is_file() else ""
    lines = printed.strip().splitlines()[-_OUTPUT_LINES:]
    return f"JSBSim died while loading the model ({error.detail}); its output:\n  " + "\n  ".join(lines)


def _named(table: dict[str, Any]) -> list[str]:
    """Properties of the [jsbsim] table, which the model has to have."""
    names = [name for one in _surfaces(table) for name in (one["command"], one["surface"])]
    names += [*table["throttle"]["command"], *table["throttle"]["trim"], *table["set"]]
    names += [*(table["augmentation"] or {}).values(), *(table["lateral"] or {}).values()]
    return names + [table[key] for key in _WRITTEN if table[key]]


def _surfaces(table: dict[str, Any]) -> list[dict[str, Any]]:
    """Tables of the control surfaces that the model has."""
    controls = (*LONGITUDINAL.controls, *LATERAL.controls)
    return [table[control.name] for control in controls if table[control.name]]


def _refuse_control(folder: Path, table: dict[str, Any]) -> None:
    names = [*table["set"], *table["declare"], *table["throttle"]["command"]]
    names += (table["lateral"] or {}).values()
    names += [surface["command"] for surface in _surfaces(table)]
    names += [table[name] for name in _WRITTEN if table[name]]
    for name in filter(controls_simulation, names):
        raise AircraftError(
            f"{folder}: [jsbsim] writes {name}: an aircraft must not stop, trim, rewind or re-time the simulation; "
            "remove this property"
        )


def wheel_root() -> Path:
    """Root folder of the installed JSBSim package, with its aircraft, engines and systems."""
    package = find_spec("jsbsim")
    if package is None or package.origin is None:
        raise AircraftError("the package jsbsim is not installed; run `pip install jsbsim`")
    return Path(package.origin).resolve().parent


def model_root(folder: Path, root: str) -> tuple[Path, Path, Path, Path]:
    """Root, aircraft, engine and systems folders that JSBSim searches for a model."""
    wheel = wheel_root()
    base = wheel if root == "wheel" else folder.resolve().parent
    return base, base / "aircraft" if root == "wheel" else base, wheel / "engine", wheel / "systems"


def model_file(folder: Path, root: str, model: str) -> Path:
    """XML of a model: in the folder of aircraft.toml, whatever its name, or else in one of the model's name."""
    own = folder.resolve() / f"{model}.xml"
    if root == "." and own.is_file():
        return own
    return model_root(folder, root)[1] / model / f"{model}.xml"


def constants_of(fdm: Any) -> Constants:
    """Constants of the model that an executive has loaded."""
    return Constants(
        wing_area_m2=fdm["metrics/Sw-sqft"] * FT**2,
        chord_m=fdm["metrics/cbarw-ft"] * FT,
        span_m=fdm["metrics/bw-ft"] * FT,
        mass_kg=fdm["inertia/mass-slugs"] * SLUG,
        inertia_yy_kg_m2=fdm["inertia/iyy-slugs_ft2"] * SLUG * FT**2,
        inertia_xx_kg_m2=fdm["inertia/ixx-slugs_ft2"] * SLUG * FT**2,
        inertia_zz_kg_m2=fdm["inertia/izz-slugs_ft2"] * SLUG * FT**2,
        inertia_xz_kg_m2=-fdm["inertia/ixz-slugs_ft2"] * SLUG * FT**2,  # JSBSim's ixz is -Ixz
    )


def load_model(fdm: Any, folder: Path, root: str, model: str) -> bool:
    """Load a model into an executive; False if JSBSim refuses it."""
    _, _, engine, systems = model_root(folder, root)
    fdm.set_aircraft_path(str(model_file(folder, root, model).parent))
    fdm.set_engine_path(str(engine))
    fdm.set_systems_path(str(systems))
    return bool(fdm.load_model(model, False))  # False: that folder itself, a copy may have another name
