"""The survey as one function for a disposable process: JSBSim dies on some models."""

from __future__ import annotations

import re
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import jsbsim

from airtruth.aircraft import JsbsimModel
from airtruth.aircraft.jsbsim.confine import model_files
from airtruth.aircraft.model import ElevatorProperties, ThrottleProperties
from airtruth.aircraft.probe import model_file, wheel_root
from airtruth.errors import AircraftError, AirtruthError
from airtruth.isolation.protocol import Reply
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.physics.terms import ELEVATOR
from airtruth.simulation.survey import bench as benches
from airtruth.simulation.survey import controls, engines, envelope
from airtruth.simulation.survey.bench import ModelBench
from airtruth.simulation.survey.lateral_flight import flown_laterally
from airtruth.simulation.survey.names import ModelNames, names_of

_ABSENT: Final = re.compile(r"property (\S+) does not exist")
"""JSBSim's message on a property that nothing has created."""
_MOST_ABSENT: Final = 40
"""Number of absent properties that are supplied [-] (judgement: models of FlightGear need up to ten)."""
_kept: Final[list[BaseException]] = []
"""Exceptions of failed executives, kept because the destructor of such an executive aborts the process."""


def survey(folder: str, model: str, root: str) -> Reply:
    """Examine a model: controls, engines, augmentation, envelope.

    Parameters
    ----------
    folder : folder of the aircraft; model : name of its XML file; root : "." or "wheel", see `JsbsimModel`.

    Returns
    -------
    Facts: "jsbsim" (the [jsbsim] table), "constants", "notes", "decisions", "envelope", "condition", "flight",
    "lateral_flight" and "cause". If a fly-by-wire integrates, only "jsbsim" and "integrating", the surfaces that it moves.

    Raises
    ------
    AircraftError
        If JSBSim refuses the model, or it has no elevator.
    """
    place = Path(folder)
    names = names_of(model_files(model_file(place, root, model), wheel_root()))
    try:
        return Reply(_examined(place, JsbsimModel.model_validate(_first(model, root)), names))
    except AirtruthError:
        raise
    except (jsbsim.BaseError, RuntimeError, KeyError) as error:
        _kept.append(error)
        raise AircraftError(f"{model}: JSBSim stops with: {error}") from None


def _first(model: str, root: str) -> dict[str, Any]:
    pitch = ElevatorProperties(command=controls.SURVEYED[ELEVATOR].standard)
    none = ThrottleProperties(command=())
    return {"model": model, "root": root, ELEVATOR: pitch, "throttle": none}


def _examined(folder: Path, model: JsbsimModel, names: ModelNames) -> dict[str, Any]:
    bench, notes, decisions = _loaded(folder, model)
    bench = _retracted(bench)
    powered = engines.engines_of(bench, names)
    notes += powered.notes
    decisions += powered.decisions
    bench, more, to_decide = controls.with_controls(powered.bench, names, LONGITUDINAL)
    notes += more
    decisions += to_decide
    integrating = controls.integrated(bench, names) if bench.surface.feedback else []
    if bench.surface.surface in integrating:
        return {"integrating": integrating, "jsbsim": bench.model.model_dump()}
    bench, more, to_decide = controls.with_controls(bench, names, LATERAL)
    notes += more
    decisions += to_decide
    lateral, more = controls.lateral_of(bench)
    notes += more
    bench = bench.known(lateral=lateral)
    if names.sensors:
        notes.append(f"sensors of the model's own systems, not used for logs: {', '.join(names.sensors[:8])}")
    points = envelope.envelope_of(bench)
    at = envelope.first_condition(bench.aircraft, points)
    if at is None and bench.model.throttle.command:
        reason = envelope.cause(points, bench.surface.feedback)
        bench = bench.known(throttle=ThrottleProperties(command=()), engine_start_s=0.0)
        points = envelope.envelope_of(bench)
        at = envelope.first_condition(bench.aircraft, points)
        notes.append(f"no level flight: {reason} The engines stay off and the aircraft glides.")
    facts: dict[str, Any] = {
        "jsbsim": bench.model.model_dump(),
        "constants": bench.constants.model_dump(),
        "notes": notes,
        "decisions": decisions,
        "envelope": [asdict(row) for row in envelope.summary_rows(points)],
        "condition": None,
        "flight": None,
        "lateral_flight": None,
        "cause": "" if at else envelope.cause(points, bench.surface.feedback),
    }
    if at is not None:
        c = at.condition
        facts["condition"] = {"eas_m_s": c.eas_m_s, "altitude_m": c.altitude_m, "gamma_rad": c.gamma_rad}
        facts["flight"] = asdict(envelope.flown(bench.aircraft, at))
        if bench.model.surfaces(LATERAL):
            facts["lateral_flight"] = asdict(flown_laterally(bench.aircraft, at))
    return facts


def _loaded(folder: Path, model: JsbsimModel) -> tuple[ModelBench, list[str], list[str]]:
    """The model on the bench, with the properties that a simulator around it would have created."""
    declared: dict[str, float] = {}
    while True:
        try:
            made = benches.bench(folder, model.model_copy(update={"declare": dict(declared)}))
            break
        except jsbsim.BaseError as error:
            _kept.append(error)
            absent = _ABSENT.search(str(error))
            name = absent.group(1) if absent else ""
            if not name or name in declared or len(declared) >= _MOST_ABSENT:
                raise AircraftError(f"{model.model}: JSBSim refuses the model: {error}") from None
            declared[name] = 0.0
    if not declared:
        return made, [], []
    notes = [f"properties of a simulator around the model, declared as constants: {', '.join(declared)}"]
    decisions = [f"jsbsim.declare: {name} is taken as 0" for name in declared if "throttle" not in name]
    return made, notes, decisions


def _retracted(bench: ModelBench) -> ModelBench:
    """The gear up where it can be retracted, and the fuel kept."""
    manager = bench.at().fdm.get_property_manager()
    fixed = {"gear/gear-cmd-norm": 0.0, "propulsion/fuel_freeze": 1.0}
    known = {name: value for name, value in fixed.items() if manager.hasNode(name)}
    return bench.known(set={**bench.model.set, **known})


__all__ = ["survey"]
