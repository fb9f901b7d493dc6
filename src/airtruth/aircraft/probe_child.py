"""Task of `airtruth.aircraft.probe` for a disposable process: load a JSBSim model and return its constants, or its fault."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from airtruth.aircraft.probe import constants_of, load_model, model_file, model_root
from airtruth.errors import choices
from airtruth.isolation.protocol import Reply


def load(
    folder: str, root: str, model: str, declare: Mapping[str, float], properties: Sequence[str], output: str
) -> Reply:
    """Load a model and return "constants", or "error", why it cannot be used.

    Parameters
    ----------
    folder : folder of aircraft.toml.
    root, model, declare : entries of its [jsbsim] table.
    properties : properties that the model has to have.
    output : file that receives what JSBSim prints.
    """
    import jsbsim

    descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    for standard in (1, 2):
        os.dup2(descriptor, standard)
    jsbsim.set_logger(jsbsim.DefaultLogger())  # another task may have silenced it
    return Reply(_load(Path(folder), root, model, declare, properties))


def _load(
    folder: Path, root: str, model: str, declare: Mapping[str, float], properties: Sequence[str]
) -> dict[str, Any]:
    import jsbsim

    base, aircraft, *_ = model_root(folder, root)
    xml = model_file(folder, root, model)
    if not xml.is_file():
        known = {p.name for p in aircraft.iterdir() if (p / f"{p.name}.xml").is_file()}
        return {"error": f"jsbsim.model: no {model}.xml below {aircraft}; {choices(model, known)}"}
    try:
        fdm = jsbsim.FGFDMExec(str(base))
        fdm.set_debug_level(0)
        for name, value in declare.items():
            fdm[name] = value
        if not load_model(fdm, folder, root, model):
            return {"error": f"JSBSim refused {xml} for the reason above"}
        fdm.disable_output()
        manager = fdm.get_property_manager()
        missing = [p for p in properties if not manager.hasNode(p)]
        if missing:
            return {"error": _explain_missing(fdm, missing)}
        fdm["ic/h-sl-ft"] = 3000.0
        fdm["ic/vt-fps"] = 300.0
        fdm.run_ic()
    except (jsbsim.BaseError, RuntimeError, KeyError) as error:
        return {"error": f"JSBSim refused {xml}: {error}"}
    return {"constants": constants_of(fdm).model_dump()}


def _explain_missing(fdm: Any, missing: list[str]) -> str:
    catalogue = [line.split(" ")[0] for line in fdm.get_property_catalog()]
    sentences = []
    for name in missing:
        same_end = [p for p in catalogue if p.split("/")[0] == name.split("/")[0]]
        hint = choices(name, same_end or catalogue)
        sentences.append(f"property {name!r} does not exist in the model; {hint[:400]}")
    return "; ".join(sentences)


__all__ = ["load"]
