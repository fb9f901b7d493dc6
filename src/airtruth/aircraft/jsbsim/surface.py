"""Elements between the measured surface and the surface that causes the forces, as a control channel in JSBSim.

Components are functions with a memory of their own. Unlike JSBSim's actuator they also act while trim status is set
(during the replay of a measured surface), are valid for any simulation step and start in equilibrium.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

from airtruth.aircraft.jsbsim.functions import component, declaration, from_start, lag, op, prop, step
from airtruth.errors import AircraftError
from airtruth.physics.terms import SurfaceTerm

_CHANNEL: Final = "Effects"
"""Name of the channels that hold effects; by it a second change recognises the first."""


@dataclass(frozen=True)
class Names:
    """Names of the properties of a change, distinct from those of earlier changes to the same model.

    Attributes
    ----------
    label : part of every property's name.
    surface : the surface's own property.
    earlier : effective surface of each earlier change, oldest first.
    """

    label: str
    surface: str
    earlier: tuple[str, ...] = ()

    @property
    def effective(self) -> str:
        """Property of the surface that causes the forces, effectiveness included [units of ``surface``]."""
        return f"fcs/{self.label}/elevator"

    @property
    def source(self) -> str:
        """Property that the first element of the chain reads."""
        return self.earlier[-1] if self.earlier else self.surface


def names(control: Element | None, surface: str) -> Names:
    """Return names that no earlier change uses."""
    channels = [] if control is None else [c for c in control.findall("channel") if c.get("name") == _CHANNEL]
    outputs = [(o.text or "").strip() for c in channels for o in c.iter("output")]
    labels = [f"effects-{k}" if k > 1 else "effects" for k in range(1, len(channels) + 2)]
    earlier = [f"fcs/{label}/elevator" for label in labels if f"fcs/{label}/elevator" in outputs]
    return Names(labels[-1], surface, tuple(earlier))


@dataclass(frozen=True)
class Components:
    """Parts of a control channel, in the order in which they run, and the properties that they write."""

    parts: tuple[Element, ...] = ()
    declared: tuple[str, ...] = ()

    def __add__(self, other: Components) -> Components:
        return Components(self.parts + other.parts, self.declared + other.declared)


def chain(
    named: Names, surface_rad: float, terms: Sequence[SurfaceTerm], factor: float, highest_hz: float
) -> Components:
    """Return the chain of elements from the measured surface to the one that causes the forces.

    Parameters
    ----------
    named : names of the properties.
    surface_rad : radians per unit of the surface's property.
    terms : in sequence.
    factor : effectiveness of the surface [-].
    highest_hz : highest simulation rate for which a delay is valid [Hz]; it sets the number of samples kept.
    """
    result = Components()
    last = named.source
    unit = abs(surface_rad)
    for number, term in enumerate(terms, start=1):
        output = f"{named.effective}-{number}"
        if term.kind == "delay":
            result += _delay(last, output, term.value, highest_hz)
        elif term.kind == "lag":
            result += _lag(last, output, term.value)
        elif term.kind == "rate_limit":
            result += _rate_limit(last, output, term.value, unit)
        else:
            result += _backlash(last, output, term.value, unit)
        last = output
    formula = op("product", factor, last)
    return result + _component(
        named.effective, f"Surface as the air sees it; effectiveness {factor!r}", formula
    )


def _component(output: str, description: str, formula: Element) -> Components:
    return Components((component(output, description, formula),), (output,))


def _delay(source: str, output: str, delay_s: float, highest_hz: float) -> Components:
    """A shift register read between two of its samples: exact for whole steps, linear between them."""
    length = max(1, math.ceil(round(delay_s * highest_hz, 9)))
    taps = [f"{output}-before-{k}" for k in range(1, length + 1)]
    points: list[Element | float | str] = [op("quotient", delay_s, step()), 0.0, source]
    for number, tap in enumerate(taps, start=1):
        points += [float(number), tap]
    result = _component(
        output,
        f"Delay of {delay_s!r} s, at simulation rates up to {highest_hz:g} Hz",
        from_start(source, op("interpolate1d", *points)),
    )
    for tap, previous in zip(reversed(taps), [*reversed(taps[:-1]), source], strict=True):
        result += _component(tap, "", from_start(source, previous))
    return result


def _lag(source: str, output: str, time_s: float) -> Components:
    before = f"{output}-input-before"
    formula = from_start(source, lag(time_s, source, before, output))
    memory = _component(before, "", prop(source))
    return _component(output, f"First-order lag, time constant {time_s!r} s", formula) + memory


def _rate_limit(source: str, output: str, rate_rad_s: float, unit: float) -> Components:
    reach = op("product", rate_rad_s / unit, step())
    back = op("product", -rate_rad_s / unit, step())
    move = op("max", back, op("min", reach, op("difference", source, output)))
    return _component(output, f"Rate limit {rate_rad_s!r} rad/s", from_start(source, op("sum", output, move)))


def _backlash(source: str, output: str, width_rad: float, unit: float) -> Components:
    half = 0.5 * width_rad / unit
    pushed = op("max", op("difference", source, half), op("min", op("sum", source, half), output))
    return _component(
        output,
        f"Backlash {width_rad!r} rad in all, the surface starts in its middle",
        from_start(source, pushed),
    )


def redirect(aerodynamics: Element, named: Names, where: str) -> Components:
    """Make the aerodynamics read the effective surface wherever they read the surface.

    Returns
    -------
    Components
        Its copies in other units.

    Raises
    ------
    AircraftError
        If the aerodynamics do not read the surface.
    """
    new = named.effective
    aliases = {
        "deg": op("product", new, 180.0 / math.pi),
        "magnitude": op("abs", new),
    }
    surfaces = dict.fromkeys((named.surface, *named.earlier), new)
    others = {f"{old}-{alias}": f"{new}-{alias}" for old in named.earlier for alias in aliases}
    if named.surface == "fcs/elevator-pos-rad":
        others |= {"fcs/elevator-pos-deg": f"{new}-deg", "fcs/mag-elevator-pos-rad": f"{new}-magnitude"}
    read = {_text(element).removeprefix("-") for element in aerodynamics.iter()}
    if not read & set(surfaces):
        raise AircraftError(
            f"{where}: its <aerodynamics> do not read {named.surface!r}, so nothing can be put between the surface and "
            "the air; state the property that they read as jsbsim.elevator.surface, or choose an effect elsewhere"
        )
    targets = surfaces | others
    for element in aerodynamics.iter():
        text = _text(element)
        if text.removeprefix("-") in targets:
            element.text = ("-" if text.startswith("-") else "") + targets[text.removeprefix("-")]
    used = {others[old] for old in read & set(others)}
    result = Components()
    for alias, formula in aliases.items():
        if f"{new}-{alias}" in used:
            result += _component(f"{new}-{alias}", "", formula)
    return result


def _text(element: Element) -> str:
    return (element.text or "").strip() if isinstance(element.tag, str) else ""


def channel(components: Components) -> list[Element]:
    """Return declarations and a channel, to be appended to <flight_control>."""
    element = Element("channel", {"name": _CHANNEL})
    element.extend(components.parts)
    return [*(declaration(p) for p in components.declared), element]
