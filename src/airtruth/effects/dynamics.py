"""What of a change the forces at rest do not show, as an aircraft.toml says it and as a change."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import Final

from airtruth.aircraft import AeroDynamics, Dynamics, StateDynamics, SurfaceDynamics
from airtruth.effects.change import AeroTerm, Change, StateTerm, SurfaceTerm

ALPHA_DOT: Final = "alpha_dot_hat"
"""The one signal that is zero at rest and has no state."""
_DECLARED: Final = "declared "
"""Before the names of an aircraft's own states: an effect's may be the same."""


def joined(declared: Dynamics | None, change: Change) -> Dynamics | None:
    """What is declared, and behind it what a change adds to it; None for nothing.

    A state takes another name where the aircraft has one of its name.
    """
    own = Dynamics() if declared is None else declared
    taken = {state.name for state in own.states}
    names: dict[str, str] = {}
    for state in change.states:
        name, count = state.name, 2
        while name in taken:
            name, count = f"{state.name}_{count}", count + 1
        names[state.name] = name
        taken.add(name)
    moving = [t for t in change.aero if t.signal == ALPHA_DOT or t.signal in names]
    found = Dynamics(
        surface=(*own.surface, *(SurfaceDynamics(**asdict(t)) for t in change.surface)),
        states=(*own.states, *(StateDynamics(**asdict(s) | {"name": names[s.name]}) for s in change.states)),
        aero=(
            *own.aero,
            *(AeroDynamics(**asdict(t) | {"signal": names.get(t.signal, t.signal)}) for t in moving),
        ),
    )
    return None if found == Dynamics() else found


def declared_dynamics(dynamics: Dynamics | None) -> Change:
    """An aircraft's dynamics as a change to its forces at rest.

    At rest a lag or mode is what drives it, and the forces at rest have it so: that part is taken off.
    """
    if dynamics is None:
        return Change()
    drives = {state.name: state.signal for state in dynamics.states}
    aero: list[AeroTerm] = []
    for row in dynamics.aero:
        term = AeroTerm(**dict(row))
        drive = drives.get(term.signal)
        if drive is None:
            aero.append(term)
            continue
        aero.append(replace(term, signal=_DECLARED + term.signal))
        if drive != ALPHA_DOT:
            aero.append(replace(term, signal=drive, amplitude=-term.amplitude))
    return Change(
        surface=tuple(SurfaceTerm(**dict(row)) for row in dynamics.surface),
        states=tuple(replace(StateTerm(**dict(row)), name=_DECLARED + row.name) for row in dynamics.states),
        aero=tuple(aero),
    )
