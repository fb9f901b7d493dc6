"""Increments of coefficients, and their states, as functions of a JSBSim model's <aerodynamics>.

Signals are read inside <aerodynamics>, where the state is that of the present step. A control channel copies the
values that a state needs of the previous step, at the start of the next one, before anything has changed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from airtruth.aircraft.jsbsim.axes import CARRIED, to_axes
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
from airtruth.physics.motion import MOTIONS
from airtruth.physics.terms import FORMULAS, QBAR, AeroTerm, StateTerm, shape_of, signals_of
from airtruth.units import PSF

_PROPERTIES: Final = {"alpha": "aero/alpha-rad", "beta": "aero/beta-rad"}
"""Signal -> property of JSBSim that holds it in SI."""
_ANGLES: Final = {
    "alpha": "Angle of attack of the air at the CG [rad]",
    "beta": "Sideslip of the air at the CG [rad]",
}
"""Signal -> description."""
_RATES: Final = {
    "qhat": ("velocities/q-rad_sec", "aero/ci2vel", "q c/(2V) of the air [-]"),
    "phat": ("velocities/p-rad_sec", "aero/bi2vel", "p b/(2V) of the air [-]"),
    "rhat": ("velocities/r-rad_sec", "aero/bi2vel", "r b/(2V) of the air [-]"),
}
"""Signal -> rate of the body [rad/s], half the reference length over the airspeed [s], and description."""
_CHANGES: Final = {
    "alpha_dot_hat": ("aero/alphadot-rad_sec", "aero/ci2vel", "alpha_dot c/(2V), inertial [-]"),
    "beta_dot_hat": ("aero/betadot-rad_sec", "aero/bi2vel", "beta_dot b/(2V), inertial [-]"),
}
"""Signal -> rate over ground, one step old [rad/s], half the reference length over the airspeed [s], and description."""
_LEAST_BENDS: Final = 3
"""Least number of bends that are written as a table [-]; a single break is a formula (convention)."""
_ROUNDING: Final = 1e-9
"""Sum of slopes beyond the last bend, over the largest, that counts as zero [-] (judgement: above rounding)."""
_SENSES: Final = {"rudder": "trailing edge left", "aileron": "(right - left)/2, trailing edge down"}
"""Control -> its positive sense, where that is not the trailing edge down."""


def write(
    aerodynamics: Element,
    terms: Sequence[AeroTerm],
    states: Sequence[StateTerm],
    surfaces: Mapping[str, Surface],
    gusts: Mapping[str, str | None],
    origin: Origin,
    where: str,
) -> Components:
    """Add the terms to the axes, and return the components that have to run in a control channel.

    Parameters
    ----------
    aerodynamics : the model's element, changed.
    terms, states : see `airtruth.physics.terms`.
    surfaces : control -> names of the new properties, and the surface that causes the forces.
    gusts : signal of a rate -> property that holds the rotation of the air [rad/s], or None.
    origin : standard deviations and source, for the descriptions.
    where : subject of error messages.

    Raises
    ------
    ConfigurationError
        If a term's signal is unknown, or two states have one name.
    AircraftError
        If the model lacks the control of a term, or has no axis that can carry a force.
    """
    root = f"aero/{next(iter(surfaces.values())).names.label}/"
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
        direct = surfaces[name].direct if name in surfaces else _PROPERTIES.get(name)
        if direct is not None and name not in held:
            made[name] = direct
            continue
        made[name] = f"{root}{name.replace('_', '-')}"
        extra, more = _signal(name, made[name], surfaces, gusts, where)
        functions += extra
        memory += more
    for state in states:
        made[state.name] = f"{root}state-{state.name}"
        functions.append(_state(state, made[state.name], made[state.signal], origin.words(state)))
        memory += _memory(state, made[state.name], made[state.signal])
    by_coefficient: dict[str, list[str]] = {name: [] for name in CARRIED}
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
    to_axes(aerodynamics, by_coefficient, root, where)
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
    name: str, output: str, surfaces: Mapping[str, Surface], gusts: Mapping[str, str | None], where: str
) -> tuple[list[Element], Components]:
    if name in _ANGLES:
        return [function(output, _ANGLES[name], prop(_PROPERTIES[name]))], Components()
    if name in surfaces:
        formula = op("product", surfaces[name].unit_rad, surfaces[name].source)
        words = f"Surface as the air sees it, {_SENSES.get(name, 'trailing edge down')} [rad]"
        return [function(output, words, formula)], Components()
    if name in _RATES:
        rate, time, words = _RATES[name]
        gust = gusts.get(name)
        of_air = op("difference", rate, gust) if gust else prop(rate)
        return [function(output, words, op("product", of_air, time))], Components()
    if name in _CHANGES:
        # JSBSim's value is one step old; the line through it and the one before reaches the present. A
        # settled state is taken as steady: JSBSim's value there may be that of the state it was in before
        change, time, words = _CHANGES[name]
        before = f"{output}-before"
        now = from_start(0.0, op("difference", op("product", 2.0, change), before))
        memory = Components((component(before, "", prop(change)),), (before,))
        return [function(output, words, op("product", now, time))], memory
    if name == QBAR:
        formula = op("product", PSF, "aero/qbar-psf")
        return [function(output, "Dynamic pressure [Pa]", formula)], Components()
    signals = [s for m in MOTIONS.values() for s in signals_of(m)]
    if name in signals:
        raise AircraftError(
            f"{where}: the model has no control {name}, which the effect reads; state jsbsim.{name}"
        )
    raise ConfigurationError(f"signal {name!r}: {choices(name, signals)}, or a state of the change")


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


__all__ = ["write"]
