"""Increments of CL and Cm, and their states, as functions of a JSBSim model's <aerodynamics>.

Signals are taken inside <aerodynamics>, where the state is that of the present step; what a state needs of
the step before is copied by a control channel at the start of the next one, before anything has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.effects.change import AeroTerm, StateTerm
from airtruth.effects.functions import STEP, TIME, component, from_start, function, lag, op, prop, step
from airtruth.effects.surface_xml import Components, Names
from airtruth.errors import AircraftError, ConfigurationError, choices

_ALPHA_DOT: Final = "aero/alphadot-rad_sec"
_UP: Final = {"Z": -1.0, "NORMAL": 1.0}
"""Axis that carries a force along -z of the body, and its sign."""


def write(
    aerodynamics: Element,
    terms: Sequence[AeroTerm],
    states: Sequence[StateTerm],
    named: Names,
    surface_rad: float,
    rotary_gust: str | None,
    where: str,
) -> Components:
    """Add the terms to the axes; what has to run in a control channel is returned.

    Parameters
    ----------
    aerodynamics : the model's element, changed.
    terms, states : see `airtruth.effects.change`.
    named : names of what is written.
    surface_rad : radians per unit of the surface's property.
    rotary_gust : property that holds the rotation of the air [rad/s], or None.
    where : named in errors.

    Raises
    ------
    ConfigurationError
        If a term's signal is unknown, or two states have one name.
    AircraftError
        If the model's axes are none that JSBSim documents.
    """
    root = f"aero/{named.label}/"
    twice = {s.name for s in states if sum(o.name == s.name for o in states) > 1}
    if twice:
        raise ConfigurationError(
            f"two states are named {twice.pop()!r}; an effect with a state can be written once"
        )
    made: dict[str, str] = {}
    functions: list[Element] = []
    memory = Components()
    for name in dict.fromkeys([s.signal for s in states] + [t.signal for t in terms]):
        if name in (s.name for s in states):
            continue
        made[name] = f"{root}{name.replace('_', '-')}"
        extra, more = _signal(name, made[name], named.effective, surface_rad, rotary_gust)
        functions += extra
        memory += more
    for state in states:
        made[state.name] = f"{root}state-{state.name}"
        functions.append(_state(state, made[state.name], made[state.signal]))
        memory += _memory(state, made[state.name], made[state.signal])
    by_coefficient: dict[str, list[str]] = {"CL": [], "Cm": []}
    for number, term in enumerate(terms, start=1):
        output = f"{root}{term.coefficient}-{number}"
        functions.append(
            function(
                output,
                _said(term),
                op("product", term.amplitude, _shape(term, op("sum", made[term.signal], -term.at))),
            )
        )
        by_coefficient[term.coefficient].append(output)
    first = next((i for i, e in enumerate(aerodynamics) if e.tag == "axis"), len(aerodynamics))
    for offset, element in enumerate(functions):
        aerodynamics.insert(first + offset, element)
    _to_axes(aerodynamics, by_coefficient, root, where)
    return memory


def _said(term: AeroTerm) -> str:
    formula = {
        "linear": "(s - at)",
        "quadratic": "(s - at)^2",
        "above": "max(0, s - at)",
        "below": "min(0, s - at)",
    }[term.shape]
    return f"{term.coefficient} += {term.amplitude!r} {formula}, s = {term.signal}, at = {term.at!r}"


def _shape(term: AeroTerm, deviation: Element) -> Element:
    if term.shape == "linear":
        return deviation
    if term.shape == "quadratic":
        return op("pow", deviation, 2.0)
    return op("max" if term.shape == "above" else "min", 0.0, deviation)


def _signal(
    name: str, output: str, surface: str, surface_rad: float, rotary_gust: str | None
) -> tuple[list[Element], Components]:
    if name == "alpha":
        return [
            function(output, "Angle of attack of the air at the CG [rad]", prop("aero/alpha-rad"))
        ], Components()
    if name == "elevator":
        formula = op("product", surface_rad, surface)
        return [
            function(output, "Surface as the air sees it, trailing edge down [rad]", formula)
        ], Components()
    if name == "qhat":
        rate = (
            op("difference", "velocities/q-rad_sec", rotary_gust)
            if rotary_gust
            else prop("velocities/q-rad_sec")
        )
        formula = op("product", rate, "aero/ci2vel")
        return [function(output, "q c/(2V) of the air [-]", formula)], Components()
    if name == "alpha_dot_hat":
        # JSBSim's value is one step old; the line through it and the one before reaches the present. A
        # settled state is taken as steady: JSBSim's value there may be that of the state it was in before
        before = f"{output}-before"
        now = from_start(0.0, op("difference", op("product", 2.0, _ALPHA_DOT), before))
        formula = op("product", now, "aero/ci2vel")
        memory = Components((component(before, "", prop(_ALPHA_DOT)),), (before,))
        return [function(output, "alpha_dot c/(2V), inertial [-]", formula)], memory
    raise ConfigurationError(
        f"signal {name!r}: {choices(name, ('alpha', 'elevator', 'qhat', 'alpha_dot_hat'))}, or a state of the change"
    )


def _state(state: StateTerm, output: str, source: str) -> Element:
    if state.kind == "lag":
        later = lag(state.time_s, source, f"{output}-input-before", f"{output}-before")
        return function(output, f"Lag of {state.signal}, tau = {state.time_s!r} s", from_start(source, later))
    return function(
        output,
        f"Mode driven by {state.signal}, wn = {1.0 / state.time_s!r} rad/s, zeta = {state.damping!r}",
        from_start(source, _mode(state, output, source)),
    )


def _mode(state: StateTerm, output: str, source: str) -> Element:
    """Bilinear transform, exact at the natural frequency: s -> (wn/tan(wn dt/2)) (z - 1)/(z + 1).

    Over wn^2, with k = 1/tan(wn dt/2): (k^2 + 2 zeta k + 1) y = x + 2 x[-1] + x[-2] - (2 - 2 k^2) y[-1]
    - (k^2 - 2 zeta k + 1) y[-2].
    """
    wn = 1.0 / state.time_s
    k = op("quotient", 1.0, op("tan", op("product", 0.5 * wn, step())))
    k2 = op("pow", k, 2.0)
    damping = op("product", 2.0 * state.damping, k)
    drive = op("sum", source, op("product", 2.0, f"{output}-input-before"), f"{output}-input-before-2")
    old = op("product", op("difference", op("product", 2.0, k2), 2.0), f"{output}-before")
    older = op("product", op("sum", k2, op("product", -1.0, damping), 1.0), f"{output}-before-2")
    return op("quotient", op("difference", op("sum", drive, old), older), op("sum", k2, damping, 1.0))


def _memory(state: StateTerm, output: str, source: str) -> Components:
    held = [(f"{output}-input-before", source), (f"{output}-before", output)]
    parts: list[Element] = []
    if state.kind == "mode":
        # at the first step what was two steps ago is the settled state, which the functions still hold
        later = op("gt", TIME, op("product", 1.5, STEP))
        parts = [component(f"{to}-2", "", op("ifthen", later, to, now)) for to, now in held]
    parts += [component(to, "", prop(now)) for to, now in held]
    names = tuple(to for to, _ in held)
    return Components(tuple(parts), names + tuple(f"{to}-2" for to in names if state.kind == "mode"))


def _to_axes(aerodynamics: Element, by_coefficient: dict[str, list[str]], root: str, where: str) -> None:
    if by_coefficient["CL"]:
        force = op("product", "aero/qbar-psf", "metrics/Sw-sqft", op("sum", *by_coefficient["CL"], 0.0))
        total = function(
            f"{root}force-lbs", "Sum of the increments of CL: force along -z of the body [lbf]", force
        )
        first = next((i for i, e in enumerate(aerodynamics) if e.tag == "axis"), len(aerodynamics))
        aerodynamics.insert(first, total)
        _force(aerodynamics, root, where)
    moments: list[Element | float | str] = []
    if by_coefficient["Cm"]:
        moments.append(
            op(
                "product",
                "aero/qbar-psf",
                "metrics/Sw-sqft",
                "metrics/cbarw-ft",
                op("sum", *by_coefficient["Cm"], 0.0),
            )
        )
    if by_coefficient["CL"]:
        # JSBSim applies forces at its reference point; this takes them back to the CG
        ahead = op("quotient", op("difference", "inertia/cg-x-in", "metrics/aero-rp-x-in"), 12.0)
        moments.append(op("product", -1.0, ahead, f"{root}force-lbs"))
    if moments:
        _axis(aerodynamics, "PITCH").append(
            function(
                f"{root}moment-lbsft", "Increments of Cm about the CG [lbf ft]", op("sum", *moments, 0.0)
            )
        )


def _axis(aerodynamics: Element, name: str) -> Element:
    found = next((a for a in aerodynamics.findall("axis") if a.get("name", "").upper() == name), None)
    return SubElement(aerodynamics, "axis", {"name": name}) if found is None else found


def _force(aerodynamics: Element, root: str, where: str) -> None:
    names = {a.get("name", "").upper() for a in aerodynamics.findall("axis")}
    for name, sign in _UP.items():
        if name in names or (name == "Z" and "X" in names):
            formula = op("product", sign, f"{root}force-lbs")
            _axis(aerodynamics, name).append(function(f"{root}{name}-lbs", "Increments of CL [lbf]", formula))
            return
    if not names & {"LIFT", "DRAG"}:
        raise AircraftError(
            f"{where}: its <aerodynamics> have none of the axes LIFT, Z and NORMAL to add lift to"
        )
    for name, component_of in (("LIFT", "cos"), ("DRAG", "sin")):
        formula = op("product", f"{root}force-lbs", op(component_of, "aero/alpha-rad"))
        _axis(aerodynamics, name).append(function(f"{root}{name}-lbs", "Increments of CL [lbf]", formula))
