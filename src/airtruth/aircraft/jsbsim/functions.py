"""Builders of JSBSim's function language, in which formulas read as formulas; <p> and <v> are its short names."""

from __future__ import annotations

from typing import Final
from xml.etree.ElementTree import Element

TIME: Final = "simulation/sim-time-sec"
"""Property of the time since the start [s]."""
STEP: Final = "simulation/dt"
"""Property of the simulation's step [s]."""
_SMALLEST_STEP_S: Final = 1e-6
"""Least step in a formula [s]: JSBSim's step is zero while the initial state settles."""


def value(number: float) -> Element:
    """A constant with all its digits."""
    element = Element("v")
    element.text = repr(float(number))
    return element


def prop(name: str) -> Element:
    """The value of a property."""
    element = Element("p")
    element.text = name
    return element


def op(name: str, *arguments: Element | float | str) -> Element:
    """An operation; a number is a constant, a string a property."""
    element = Element(name)
    element.extend(
        value(a) if isinstance(a, int | float) else prop(a) if isinstance(a, str) else a for a in arguments
    )
    return element


def step() -> Element:
    """The simulation's step [s], never zero."""
    return op("max", STEP, _SMALLEST_STEP_S)


def from_start(start: Element | float | str, later: Element | float | str) -> Element:
    """``start`` while the initial state settles, at time zero; then ``later``."""
    return op("ifthen", op("gt", TIME, 0.0), later, start)


def function(name: str, description: str, formula: Element) -> Element:
    """A named function of an <aerodynamics> section."""
    element = Element("function", {"name": name})
    _describe(element, description)
    element.append(formula)
    return element


def component(output: str, description: str, formula: Element) -> Element:
    """A component of a control channel that writes a property declared by `declaration`."""
    element = Element("fcs_function", {"name": f"{output}-update"})
    if description:
        _describe(element, description)
    body = Element("function")
    body.append(formula)
    element.append(body)
    target = Element("output")
    target.text = output
    element.append(target)
    return element


def declaration(name: str) -> Element:
    """A property that a component writes."""
    element = Element("property", {"value": "0"})
    element.text = name
    return element


def _describe(element: Element, text: str) -> None:
    description = Element("description")
    description.text = text
    element.append(description)


def lag(time_s: float, now: str, now_before: str, before: str) -> Element:
    """One step of tau y' = x - y for an x that is linear between steps; as `airtruth.physics.sensors.lag`.

    With r = dt/tau and m = (1 - exp(-r))/r: y = (1 - r m) y[-1] + (m - 1 + r m) x[-1] + (1 - m) x.

    Parameters
    ----------
    time_s : tau [s].
    now, now_before, before : properties that hold x, x one step before and y one step before.
    """
    r = op("quotient", step(), time_s)
    decay = op("exp", op("product", -1.0, r))
    mean = op("quotient", op("difference", 1.0, decay), r)
    return op(
        "sum",
        op("product", decay, before),
        op("product", op("difference", mean, decay), now_before),
        op("product", op("difference", 1.0, mean), now),
    )
