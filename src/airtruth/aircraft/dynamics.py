"""The dynamics that an aircraft.toml declares, and those that a change adds to them."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from airtruth.aircraft.file import Dynamics
from airtruth.physics.motion import MOTIONS
from airtruth.physics.terms import AeroTerm, Change, drivers_of

RATES: Final = frozenset(drivers_of(motion)[-1] for motion in MOTIONS.values())
"""Signals that are zero in a steady state without being a state: the rate of the implicit state of each motion."""
_DECLARED: Final = "declared "
"""Prefix of the names of an aircraft's own states, which an effect's states may share."""


def with_change(declared: Dynamics | None, change: Change) -> Dynamics | None:
    """Return the declared dynamics followed by those of a change; None if there are none.

    A state takes another name where the aircraft has one of its name. Increments without dynamics are left out: the
    JSBSim model holds them.

    Parameters
    ----------
    declared : dynamics of an aircraft.toml.
    change : what an effect adds.
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
    dynamic = [t for t in change.aero if t.signal in RATES or t.signal in names]
    result = Dynamics(
        surface=(*own.surface, *change.surface),
        states=(*own.states, *(replace(s, name=names[s.name]) for s in change.states)),
        aero=(*own.aero, *(replace(t, signal=names.get(t.signal, t.signal)) for t in dynamic)),
        readings=(
            *own.readings,
            *(
                replace(t, signal=names.get(t.signal, t.signal), behind=names.get(t.behind, t.behind))
                for t in change.readings
            ),
        ),
    )
    return None if result == Dynamics() else result


def declared_dynamics(dynamics: Dynamics | None, prefix: str = _DECLARED) -> Change:
    """Return an aircraft's dynamics as a change of its steady forces.

    In steady flight a state equals its input, and the tables of steady forces hold its increment at that value:
    the increment of the input itself is subtracted.

    Parameters
    ----------
    dynamics : of an aircraft.toml; None for none.
    prefix : before the name of each state; by default one that no effect uses.
    """
    if dynamics is None:
        return Change()
    inputs = {state.name: state.signal for state in dynamics.states}
    aero: list[AeroTerm] = []
    for term in dynamics.aero:
        source = inputs.get(term.signal)
        if source is None:
            aero.append(term)
            continue
        aero.append(replace(term, signal=prefix + term.signal))
        if source not in RATES:
            aero.append(replace(term, signal=source, amplitude=-term.amplitude))
    return Change(
        surface=dynamics.surface,
        states=tuple(replace(state, name=prefix + state.name) for state in dynamics.states),
        aero=tuple(aero),
        readings=tuple(
            replace(
                t,
                signal=prefix + t.signal if t.signal in inputs else t.signal,
                behind=prefix + t.behind if t.behind else "",
            )
            for t in dynamics.readings
        ),
    )


__all__ = ["RATES", "declared_dynamics", "with_change"]
