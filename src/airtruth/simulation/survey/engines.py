"""Engines of a model: the levers that change the thrust, mixture and magnetos, and why an engine gives none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from airtruth.aircraft.model import ThrottleProperties
from airtruth.simulation.survey.bench import ModelBench
from airtruth.simulation.survey.names import ModelNames
from airtruth.units import G0, LBF

START_S: Final = 60.0
"""Longest time for which engines run at a held state before a flight [s] (judgement: a heavy propeller needs 20)."""
_USEFUL: Final = 0.02
"""Least thrust over weight between two levers that lets an aircraft fly level [-] (judgement: below any drag)."""
_SOUND: Final = 3.0
"""Largest thrust over weight of a sound engine at flight speed [-] (judgement: fighters reach 1.5)."""
_CHATTER: Final = 1e-2
"""Change of the accelerations within a block that counts as steady engines [m/s2] (judgement: governors chatter by 1e-5
at full throttle; a propeller that the step of the simulation drives unstable changes by more than 1)."""
_MIXTURES: Final = (1.0, 0.87, 0.75, 0.6)
"""Mixtures tried for a piston engine [-] (judgement: full rich to lean)."""


@dataclass(frozen=True)
class SurveyedEngines:
    """Levers of a model.

    Attributes
    ----------
    bench : with throttle, mixture and start of the engines; without a throttle if they give no thrust.
    notes, decisions : what was found out, and what the user has to decide.
    """

    bench: ModelBench
    notes: tuple[str, ...]
    decisions: tuple[str, ...]


def engines_of(bench: ModelBench, names: ModelNames) -> SurveyedEngines:
    """Find the levers that change the thrust; an aircraft without useful thrust glides."""
    count = int(bench.at().fdm.get_propulsion().get_num_engines())
    if count == 0:
        return SurveyedEngines(bench, ("no engine: the aircraft glides",), ())
    outside = [n for n in bench.model.declare if "throttle" in n]
    standard = [f"fcs/throttle-cmd-norm{f'[{i}]' if i else ''}" for i in range(count)]
    fixed = {"propulsion/magneto_cmd": 3.0} if "piston_engine" in names.engines else {}
    for i in range(count):
        place = f"[{i}]" if i else ""
        fixed |= {f"fcs/advance-cmd-norm{place}": 1.0, f"fcs/mixture-cmd-norm{place}": 1.0}
    manager = bench.at().fdm.get_property_manager()
    fixed = {name: value for name, value in fixed.items() if manager.hasNode(name)}
    levers = tuple(n for n in outside or standard if manager.hasNode(n))
    started = bench.known(
        throttle=ThrottleProperties(command=levers), set={**bench.model.set, **fixed}, engine_start_s=START_S
    )
    if "piston_engine" in names.engines:
        started = _leaned(started)
    idle, full = (_thrust(started, lever) for lever in (0.2, 1.0))
    kinds = ", ".join(dict.fromkeys(n.replace("_engine", "") for n in names.engines))
    if full.steady and full.over_weight - idle.over_weight > _USEFUL and full.over_weight < _SOUND:
        how = f"full throttle gives {full.over_weight:.2f} of the weight"
        return SurveyedEngines(
            started, (f"engines: {count} ({kinds}), levers {', '.join(levers)}; {how}",), ()
        )
    reason = _reason(full, idle, levers)
    if names.has_propeller and "turbine_engine" in names.engines:
        reason += (
            ", because the file of a jet engine drives a propeller: JSBSim takes its thrust for shaft power"
        )
    off = bench.known(
        throttle=ThrottleProperties(command=()), set={**bench.model.set, **fixed}, engine_start_s=0.0
    )
    return SurveyedEngines(
        off,
        (
            f"engines: {count} ({kinds}) give no useful thrust: {reason}; they stay off and the aircraft glides",
        ),
        ("jsbsim.throttle: state the levers and properties that this engine needs, or fly the glide",),
    )


@dataclass(frozen=True)
class _Thrust:
    """Total thrust over weight [-], whether it is steady, and whether all engines run."""

    over_weight: float
    steady: bool
    running: bool


def _thrust(bench: ModelBench, lever: float) -> _Thrust:
    executive = bench.at(throttle=lever)
    fdm = executive.fdm
    each = range(fdm.get_propulsion().get_num_engines())
    total = sum(fdm[f"propulsion/engine[{i}]/thrust-lbs"] for i in each) * LBF
    running = all(fdm[f"propulsion/engine[{i}]/set-running"] for i in each)
    return _Thrust(total / (bench.constants.mass_kg * G0), executive.unsteadiness < _CHATTER, running)


def _leaned(bench: ModelBench) -> ModelBench:
    """The mixture with the most thrust at full throttle."""
    benches = []
    for mixture in _MIXTURES:
        changed = {n: mixture if "mixture" in n else v for n, v in bench.model.set.items()}
        benches.append(bench.known(set=changed))
    thrusts = [t.over_weight if (t := _thrust(b, 1.0)).running else -np.inf for b in benches]
    return benches[int(np.argmax(thrusts))]


def _reason(full: _Thrust, idle: _Thrust, levers: tuple[str, ...]) -> str:
    named = ", ".join(levers[:2]) or "no lever"
    if not full.running:
        return "an engine does not start with magnetos, mixture, fuel and starter on"
    if not full.steady:
        return f"the engines do not become steady within {START_S:.0f} s at this step of the simulation"
    if abs(full.over_weight) > _SOUND:
        return f"full throttle gives {full.over_weight:.3g} times the weight, which no aircraft has"
    if abs(full.over_weight - idle.over_weight) <= _USEFUL and full.over_weight > _USEFUL:
        return f"the thrust stays at {full.over_weight:.2g} of the weight whatever {named} is"
    return f"full throttle gives {full.over_weight:.2g} of the weight"


__all__ = ["START_S", "SurveyedEngines", "engines_of"]
