"""JSBSim's function language as nested elements: small builders, so that formulas read as formulas."""

from __future__ import annotations

from typing import Final
from xml.etree.ElementTree import Element

TIME: Final = "simulation/sim-time-sec"
STEP: Final = "simulation/dt"
_SMALLEST_STEP_S: Final = 1e-6  # the step is zero while the initial state settles


def value(number: float) -> Element:
    """A constant, all its digits."""
    found = Element("value")
    found.text = repr(float(number))
    return found


def prop(name: str) -> Element:
    """The value of a property."""
    found = Element("property")
    found.text = name
    return found


def op(name: str, *arguments: Element | float | str) -> Element:
    """An operation; a number is a constant, a string a property."""
    found = Element(name)
    found.extend(
        value(a) if isinstance(a, int | float) else prop(a) if isinstance(a, str) else a for a in arguments
    )
    return found


def step() -> Element:
    """The simulation's step [s], never zero."""
    return op("max", STEP, _SMALLEST_STEP_S)


def from_start(start: Element | float | str, later: Element | float | str) -> Element:
    """``start`` while the initial state settles, at time zero; then ``later``."""
    return op("ifthen", op("gt", TIME, 0.0), later, start)


def function(name: str, description: str, formula: Element) -> Element:
    """A named function of an <aerodynamics> section."""
    found = Element("function", {"name": name})
    _describe(found, description)
    found.append(formula)
    return found


def component(output: str, description: str, formula: Element) -> Element:
    """A component of a control channel that writes a property declared by `declaration`."""
    found = Element("fcs_function", {"name": f"{output}-update"})
    if description:
        _describe(found, description)
    body = Element("function")
    body.append(formula)
    found.append(body)
    target = Element("output")
    target.text = output
    found.append(target)
    return found


def declaration(name: str) -> Element:
    """A property that a component writes."""
    found = Element("property", {"value": "0"})
    found.text = name
    return found


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
