"""Load a JSBSim model in a child process, where an abort inside JSBSim cannot take the caller down.

JSBSim aborts the process (SIGABRT) on some malformed models, segfaults on others, and creates a
property that is merely misspelt. So a model is loaded and its properties are looked up here first;
the answer comes back as JSON.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from airtruth.errors import AircraftError, choices
from airtruth.quantity import Strict
from airtruth.units import FT, SLUG

_TIMEOUT_S: Final = 60.0


class Constants(Strict):
    """Geometry and mass of a model as loaded: S [m2], c and span [m], mass [kg], Iyy [kg m2].

    cg_fraction is the CG behind the leading edge of the MAC as a fraction of it; 0.25 stands for a
    model that does not say.
    """

    wing_area_m2: float
    chord_m: float
    span_m: float
    mass_kg: float
    inertia_yy_kg_m2: float
    cg_fraction: float = 0.25


def probe(folder: Path, jsbsim_json: str) -> Constants:
    """Load the model that aircraft.toml names and return its constants.

    Parameters
    ----------
    folder : folder of aircraft.toml.
    jsbsim_json : its [jsbsim] table as JSON.

    Raises
    ------
    AircraftError
        If the model is missing, JSBSim refuses it or dies on it, or a named property does not exist.
    """
    command = [sys.executable, "-m", "airtruth.aircraft_probe", str(folder), jsbsim_json]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired:
        raise AircraftError(
            f"{folder}: JSBSim did not finish loading the model within {_TIMEOUT_S:.0f} s"
        ) from None
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    answer: dict[str, Any] = json.loads(lines[-1]) if lines else {}
    if "error" in answer:
        raise AircraftError(f"{folder}: {answer['error']}")
    if done.returncode != 0 or "constants" not in answer:
        said = "\n  ".join((done.stderr + done.stdout).strip().splitlines()[-6:])
        raise AircraftError(
            f"{folder}: JSBSim died while loading the model (exit {done.returncode}); it said:\n  {said}"
        )
    return Constants.model_validate(answer["constants"])


def model_root(folder: Path, root: str) -> tuple[Path, Path, Path, Path]:
    """Root, aircraft, engine and systems folders that JSBSim searches for a model."""
    import jsbsim

    if root == "wheel":
        base = Path(jsbsim.get_default_root_dir())
        return base, base / "aircraft", base / "engine", base / "systems"
    base = folder.resolve().parent
    return base, base, base / "engine", base / "systems"


def model_file(folder: Path, root: str, model: str) -> Path:
    """XML of a model: in the folder of aircraft.toml, whatever its name, or else in one of the model's name."""
    own = folder.resolve() / f"{model}.xml"
    if root == "." and own.is_file():
        return own
    return model_root(folder, root)[1] / model / f"{model}.xml"


def load_model(fdm: Any, folder: Path, root: str, model: str) -> bool:
    """Load a model into an executive; False if JSBSim refuses it."""
    _, _, engine, systems = model_root(folder, root)
    fdm.set_aircraft_path(str(model_file(folder, root, model).parent))
    fdm.set_engine_path(str(engine))
    fdm.set_systems_path(str(systems))
    return bool(fdm.load_model(model, False))  # False: that folder itself, a copy may have another name


def _load(folder: Path, table: dict[str, Any]) -> dict[str, Any]:
    import jsbsim

    root, aircraft, *_ = model_root(folder, table["root"])
    model = table["model"]
    xml = model_file(folder, table["root"], model)
    if not xml.is_file():
        known = {p.name for p in aircraft.iterdir() if (p / f"{p.name}.xml").is_file()}
        return {"error": f"jsbsim.model: no {model}.xml below {aircraft}; {choices(model, known)}"}
    try:
        fdm = jsbsim.FGFDMExec(str(root))
        fdm.set_debug_level(0)
        if not load_model(fdm, folder, table["root"], model):
            return {"error": f"JSBSim refused {xml}; it said the reason above"}
        fdm.disable_output()
        manager = fdm.get_property_manager()
        missing = [p for p in _named(table) if not manager.hasNode(p)]
        if missing:
            return {"error": _explain_missing(fdm, missing)}
        fdm["ic/h-sl-ft"] = 3000.0
        fdm["ic/vt-fps"] = 300.0
        fdm.run_ic()
    except (jsbsim.BaseError, RuntimeError, KeyError) as error:
        return {"error": f"JSBSim refused {xml}: {error}"}
    return {
        "constants": {
            "wing_area_m2": fdm["metrics/Sw-sqft"] * FT**2,
            "chord_m": fdm["metrics/cbarw-ft"] * FT,
            "span_m": fdm["metrics/bw-ft"] * FT,
            "mass_kg": fdm["inertia/mass-slugs"] * SLUG,
            "inertia_yy_kg_m2": fdm["inertia/iyy-slugs_ft2"] * SLUG * FT**2,
        }
    }


def _named(table: dict[str, Any]) -> list[str]:
    elevator, throttle = table["elevator"], table["throttle"]
    names = [elevator["command"], elevator["surface"], *throttle["command"], *throttle["trim"], *table["set"]]
    names += list((table["augmentation"] or {}).values())
    return names + ([table["rotary_gust"]] if table["rotary_gust"] else [])


def _explain_missing(fdm: Any, missing: list[str]) -> str:
    catalogue = [line.split(" ")[0] for line in fdm.get_property_catalog()]
    sentences = []
    for name in missing:
        same_end = [p for p in catalogue if p.split("/")[0] == name.split("/")[0]]
        hint = choices(name, same_end or catalogue)
        sentences.append(f"property {name!r} does not exist in the model; {hint[:400]}")
    return "; ".join(sentences)


if __name__ == "__main__":
    print(json.dumps(_load(Path(sys.argv[1]), json.loads(sys.argv[2]))), flush=True)
