"""Increments of CL and Cm, and their states, as functions of a JSBSim model's <aerodynamics>.

Signals are read inside <aerodynamics>, where the state is that of the present step. A control channel copies the
values that a state needs of the previous step, at the start of the next one, before anything has changed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.aircraft.jsbsim.functions import (
    STEP,
    TIME,
    component,
    from_start,
    function,
    lag,
    op,
    prop,
    step,
)
from airtruth.aircraft.jsbsim.surface import Components, Surface
from airtruth.aircraft.origin import Origin
from airtruth.errors import AircraftError, ConfigurationError, choices
from airtruth.physics.terms import FORMULAS, SIGNALS, AeroTerm, StateTerm, shape_of
from airtruth.units import PSF

_ALPHA_DOT: Final = "aero/alphadot-rad_sec"
"""Property of alpha_dot over ground, one step old [rad/s]."""
_PROPERTIES: Final = {"alpha": "aero/alpha-rad"}
"""Signal -> property of JSBSim that holds it in SI."""
_LEAST_BENDS: Final = 3
"""Least number of bends that are written as a table [-]; a single break is a formula (convention)."""
_ROUNDING: Final = 1e-9
"""Sum of slopes beyond the last bend, over the largest, that counts as zero [-] (judgement: above rounding)."""
_PARTNER: Final = {"Z": "X", "X": "Z", "NORMAL": "AXIAL", "AXIAL": "NORMAL"}
"""Axis beside which JSBSim accepts another."""


@dataclass(frozen=True)
class _Force:
    """How a force that a coefficient states reaches the axes of a model.

    Attributes
    ----------
    total : last part of the name of its sum.
    direction : along which axis of the body.
    body : body axis that carries it -> its sign; JSBSim counts AXIAL aft.
    wind : axis of lift and drag -> sign, and function of the angle of attack.
    across : coordinate whose distance from the CG gives it a moment.
    missing : what the model lacks where neither carries it.
    """

    total: str
    direction: str
    body: Mapping[str, float]
    wind: Mapping[str, tuple[float, str]]
    across: str
    missing: str


_FORCES: Final[Mapping[str, _Force]] = {
    "CL": _Force(
        "force",
        "-z",
        {"Z": -1.0, "NORMAL": 1.0},
        {"LIFT": (1.0, "cos"), "DRAG": (1.0, "sin")},
        "x",
        "LIFT, Z or NORMAL that could carry lift",
    ),
    "CX": _Force(
        "axial",
        "x",
        {"X": 1.0, "AXIAL": -1.0},
        {"LIFT": (1.0, "sin"), "DRAG": (-1.0, "cos")},
        "z",
        "DRAG, X or AXIAL that could carry an axial force",
    ),
}
"""Coefficient of a force -> how it reaches the axes."""


def write(
    aerodynamics: Element,
    terms: Sequence[AeroTerm],
    states: Sequence[StateTerm],
    surface: Surface,
    rotary_gust: str | None,
    origin: Origin,
    where: str,
) -> Components:
    """Add the terms to the axes, and return the components that have to run in a control channel.

    Parameters
    ----------
    aerodynamics : the model's element, changed.
    terms, states : see `airtruth.physics.terms`.
    surface : names of the new properties, and the surface that causes the forces.
    rotary_gust : property that holds the rotation of the air [rad/s], or None.
    origin : standard deviations and source, for the descriptions.
    where : subject of error messages.

    Raises
    ------
    ConfigurationError
        If a term's signal is unknown, or two states have one name.
    AircraftError
        If the model has no axis that can carry lift.
    """
    root = f"aero/{surface.names.label}/"
    twice = {s.name for s in states if sum(o.name == s.name for o in states) > 1}
    if twice:
        raise ConfigurationError(
            f"two states are named {twice.pop()!r}; an effect with a state can be written once"
        )
    made: dict[str, str] = {}
    functions: list[Element] = []
    memory = Components()
    held = {s.signal for s in states}  # a state reads the signal of the step before, which a function keeps
    factors = [t.factor for t in terms if t.factor]
    for name in dict.fromkeys([s.signal for s in states] + [t.signal for t in terms] + factors):
        if name in (s.name for s in states):
            continue
        direct = _PROPERTIES.get(name, surface.direct if name == "elevator" else None)
        if direct is not None and name not in held:
            made[name] = direct
            continue
        made[name] = f"{root}{name.replace('_', '-')}"
        extra, more = _signal(name, made[name], surface, rotary_gust)
        functions += extra
        memory += more
    for state in states:
        made[state.name] = f"{root}state-{state.name}"
        functions.append(_state(state, made[state.name], made[state.signal], origin.words(state)))
        memory += _memory(state, made[state.name], made[state.signal])
    by_coefficient: dict[str, list[str]] = {"CL": [], "Cm": [], "CX": []}
    learned, single = _grouped(terms)
    for number, group in enumerate(learned, start=1):
        output = f"{root}{group[0].coefficient}-table-{number}"
        functions += _table(output, group, made[group[0].signal], origin.source and f"; {origin.source}")
        if group[0].factor:
            slope, output = output, f"{output}-increment"
            words = f"{group[0].coefficient} by {group[0].factor}, at = {group[0].factor_at!r}"
            functions.append(function(output, words, op("product", slope, _factor(group[0], made))))
        by_coefficient[group[0].coefficient].append(output)
    for number, term in enumerate(single, start=1):
        output = f"{root}{term.coefficient}-{number}"
        formula = op("product", term.amplitude, _shape(term, _from(made[term.signal], term.at)))
        if term.factor:
            formula.append(_factor(term, made))
        functions.append(function(output, _description(term) + origin.words(term), formula))
        by_coefficient[term.coefficient].append(output)
    first = next((i for i, e in enumerate(aerodynamics) if e.tag == "axis"), len(aerodynamics))
    for offset, element in enumerate(functions):
        aerodynamics.insert(first + offset, element)
    _to_axes(aerodynamics, by_coefficient, root, where)
    return memory


def _grouped(terms: Sequence[AeroTerm]) -> tuple[list[list[AeroTerm]], list[AeroTerm]]:
    """Bends of one coefficient over one signal that are constant beyond their ends, and the other terms."""
    bends: dict[tuple[str, str, str, float], list[AeroTerm]] = {}
    for term in terms:
        if (curve := term.curve) is not None:
            bends.setdefault(curve, []).append(term)
    balanced = (_balanced(group) for group in bends.values())
    learned = [group for group in balanced if len(group) >= _LEAST_BENDS]
    taken = {id(term) for group in learned for term in group}
    return learned, [term for term in terms if id(term) not in taken and term.amplitude != 0.0]


def _balanced(group: list[AeroTerm]) -> list[AeroTerm]:
    """The group, without the one term that does not belong to its table: a break of its own; empty for no table."""
    without_one = ([t for t in group if t is not term] for term in group)
    return next((g for g in (group, *without_one) if _is_constant_beyond(g)), [])


def _is_constant_beyond(group: Sequence[AeroTerm]) -> bool:
    for shape in ("above", "below"):
        slopes = [term.amplitude for term in group if term.shape == shape]
        if abs(math.fsum(slopes)) > _ROUNDING * max(map(abs, slopes), default=0.0):
            return False
    return True


def _table(output: str, group: Sequence[AeroTerm], signal: str, source: str) -> list[Element]:
    """The bends as a table, which JSBSim holds constant outside, and a flag that is 1 there."""
    points = sorted({term.at for term in group})
    values = [math.fsum(t.amplitude * float(shape_of(t, point)) for t in group) for point in points]
    first = group[0]
    table = Element("table")
    SubElement(table, "independentVar", {"lookup": "row"}).text = signal
    rows = "\n".join(f"{x!r} {y!r}" for x, y in zip(points, values, strict=True))
    SubElement(table, "tableData").text = f"\n{rows}\n"
    words = f"{first.coefficient} over {first.signal}, learned from {points[0]!r} to {points[-1]!r}, constant outside"
    outside = op("ifthen", op("or", op("lt", signal, points[0]), op("gt", signal, points[-1])), 1.0, 0.0)
    return [
        function(output, words + source, table),
        function(f"{output}-outside", f"1 where {first.signal} is outside the table's range", outside),
    ]


def _description(term: AeroTerm) -> str:
    pair = f" ({term.factor} - {term.factor_at!r})" if term.factor else ""
    return f"{term.coefficient} += {term.amplitude!r} {FORMULAS[term.shape]}{pair}, s = {term.signal}, at = {term.at!r}"


def _factor(term: AeroTerm, made: Mapping[str, str]) -> Element:
    """The factor of a term, from its origin; ``made``: signal -> property."""
    return _from(made[term.factor], term.factor_at)


def _from(source: str, at: float) -> Element:
    """A property, counted from an origin."""
    return op("sum", source, -at) if at else prop(source)


def _shape(term: AeroTerm, deviation: Element) -> Element:
    if term.shape == "linear":
        return deviation
    if term.shape == "quadratic":
        return op("pow", deviation, 2.0)
    return op("max" if term.shape == "above" else "min", 0.0, deviation)


def _signal(
    name: str, output: str, surface: Surface, rotary_gust: str | None
) -> tuple[list[Element], Components]:
    if name == "alpha":
        words = "Angle of attack of the air at the CG [rad]"
        return [function(output, words, prop(_PROPERTIES[name]))], Components()
    if name == "elevator":
        formula = op("product", surface.unit_rad, surface.source)
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
    if name == "qbar":
        formula = op("product", PSF, "aero/qbar-psf")
        return [function(output, "Dynamic pressure [Pa]", formula)], Components()
    raise ConfigurationError(f"signal {name!r}: {choices(name, SIGNALS)}, or a state of the change")


def _state(state: StateTerm, output: str, source: str, origin: str) -> Element:
    if state.kind == "lag":
        later = lag(state.time_s, source, f"{output}-input-before", f"{output}-before")
        words = f"Lag of {state.signal}, tau = {state.time_s!r} s{origin}"
        return function(output, words, from_start(source, later))
    if state.kind == "play":
        half, words = state.half_width, f"Play of {state.signal}, half width {state.half_width!r}{origin}"
        low, high = op("difference", source, half), op("sum", source, half)
        return function(
            output, words, from_start(source, op("max", low, op("min", high, f"{output}-before")))
        )
    return function(
        output,
        f"Mode driven by {state.signal}, wn = {1.0 / state.time_s!r} rad/s, zeta = {state.damping!r}{origin}",
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
    held = [] if state.kind == "play" else [(f"{output}-input-before", source)]
    held.append((f"{output}-before", output))
    parts: list[Element] = []
    if state.kind == "mode":
        # at the first step what was two steps ago is the settled state, which the functions still hold
        later = op("gt", TIME, op("product", 1.5, STEP))
        parts = [component(f"{to}-2", "", op("ifthen", later, to, now)) for to, now in held]
    parts += [component(to, "", prop(now)) for to, now in held]
    names = tuple(to for to, _ in held)
    return Components(tuple(parts), names + tuple(f"{to}-2" for to in names if state.kind == "mode"))


def _to_axes(aerodynamics: Element, by_coefficient: dict[str, list[str]], root: str, where: str) -> None:
    pressure = "aero/qbar-psf", "metrics/Sw-sqft"
    if by_coefficient["Cm"]:
        formula = op("product", *pressure, "metrics/cbarw-ft", _sum(by_coefficient["Cm"]))
        words = "Increments of Cm about the CG [lbf ft]"
        _axis(aerodynamics, "PITCH").append(function(f"{root}moment-lbsft", words, formula))
    for coefficient, force in _FORCES.items():
        if not by_coefficient[coefficient]:
            continue
        total = f"{root}{force.total}-lbs"
        words = f"Sum of the increments of {coefficient}: force along {force.direction} of the body [lbf]"
        formula = op("product", *pressure, _sum(by_coefficient[coefficient]))
        first = next((i for i, e in enumerate(aerodynamics) if e.tag == "axis"), len(aerodynamics))
        aerodynamics.insert(first, function(total, words, formula))
        for name, share in _shares(aerodynamics, force, total, where).items():
            words = f"Increments of {coefficient} [lbf]"
            _axis(aerodynamics, name).append(function(f"{root}{force.total}-{name}-lbs", words, share))
        # JSBSim applies forces at its reference point; this takes them back to the CG
        shift = op("product", -1.0, _arm(aerodynamics, force.across), total)
        words = f"Increments of {coefficient} taken to the CG [lbf ft]"
        _axis(aerodynamics, "PITCH").append(function(f"{root}{force.total}-moment-lbsft", words, shift))


def _sum(properties: Sequence[str]) -> Element:
    return op("sum", *properties) if len(properties) > 1 else prop(properties[0])


def _arm(aerodynamics: Element, across: str) -> Element:
    """Distance along a structural axis from JSBSim's reference point of the forces to the CG [ft]."""
    ends = f"inertia/cg-{across}-in", f"metrics/aero-rp-{across}-in"
    arm = op("quotient", op("difference", *ends), 12.0)
    shift = aerodynamics.find("aero_ref_pt_shift_x/function")
    if across != "x" or shift is None:
        return arm
    chords = deepcopy(next(e for e in shift if e.tag not in ("description", "documentation")))
    for element in chords.iter():
        element.attrib.pop("name", None)  # a property is bound once
    return op("difference", arm, op("product", chords, "metrics/cbarw-ft"))


def _axis(aerodynamics: Element, name: str) -> Element:
    axis = next((a for a in aerodynamics.findall("axis") if a.get("name", "").upper() == name), None)
    return SubElement(aerodynamics, "axis", {"name": name}) if axis is None else axis


def _shares(aerodynamics: Element, force: _Force, total: str, where: str) -> dict[str, Element]:
    """Axis of the model -> what it carries of a force whose property is ``total``."""
    names = {a.get("name", "").upper() for a in aerodynamics.findall("axis")}
    for name, sign in force.body.items():
        if name in names or _PARTNER[name] in names:
            return {name: op("product", sign, total)}
    if not names & set(force.wind):
        raise AircraftError(
            f"{where}: its <aerodynamics> have no axis {force.missing}, to which the effect adds; add the axis to the model"
        )
    found = {}
    for name, (sign, component_of) in force.wind.items():
        share = op(component_of, "aero/alpha-rad")
        found[name] = op("product", total, share if sign > 0.0 else op("product", sign, share))
    return found
