"""Elements between the measured surface and the surface that causes the forces, as a control channel in JSBSim.

Components are functions with a memory of their own. Unlike JSBSim's actuator they also act while trim status is set
(during the replay of a measured surface), are valid for any simulation step and start in equilibrium.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element

from airtruth.aircraft.jsbsim.functions import component, declaration, from_start, lag, op, prop, step
from airtruth.aircraft.origin import Origin
from airtruth.errors import AircraftError
from airtruth.physics.terms import ELEVATOR, SurfaceTerm

_CHANNEL: Final = "Effects"
"""Name of the channels that hold effects."""
_PROPERTY: Final = re.compile(r"(?:aero|fcs)/(effects(?:-\d+)?)/")
"""Names of properties of a change; by them a second change recognises the first."""


@dataclass(frozen=True)
class Names:
    """Names of the properties of a change, distinct from those of earlier changes to the same model.

    Attributes
    ----------
    label : part of every property's name.
    surface : the surface's own property.
    earlier : effective surface of each earlier change, oldest first.
    control : name of the control.
    """

    label: str
    surface: str
    earlier: tuple[str, ...] = ()
    control: str = ELEVATOR

    @property
    def effective(self) -> str:
        """Property of the surface that causes the forces, effectiveness included [units of ``surface``]."""
        return f"fcs/{self.label}/{self.control}"

    @property
    def source(self) -> str:
        """Property that the first element of the chain reads."""
        return self.earlier[-1] if self.earlier else self.surface


def names(root: Element, surface: str, control: str = ELEVATOR) -> Names:
    """Return names that no earlier change uses.

    Parameters
    ----------
    root : root element of the model; surface : the surface's own property; control : name of the control.
    """
    words = [w for e in root.iter() if isinstance(e.tag, str) for w in (e.text or "", e.get("name", ""))]
    taken = {label for word in words for label in _PROPERTY.findall(word)}
    outputs = {(o.text or "").strip() for o in root.iter("output")}
    labels = [f"effects-{k}" if k > 1 else "effects" for k in range(1, len(taken) + 2)]
    effective = [f"fcs/{label}/{control}" for label in labels]
    earlier = tuple(name for name in effective if name in outputs)
    return Names(next(label for label in labels if label not in taken), surface, earlier, control)


@dataclass(frozen=True)
class Surface:
    """The surface that causes the forces.

    Attributes
    ----------
    names : names of the properties of the change.
    unit_rad : radians per unit of the surface's property.
    moved : whether the change puts something between the measured surface and the air.
    """

    names: Names
    unit_rad: float
    moved: bool

    @property
    def source(self) -> str:
        """Its property [units of the measured surface]."""
        return self.names.effective if self.moved else self.names.source

    @property
    def direct(self) -> str | None:
        """Its property where that is in radians, trailing edge down."""
        return self.source if self.unit_rad == 1.0 else None


@dataclass(frozen=True)
class Components:
    """Parts of a control channel, in the order in which they run, and the properties that they write."""

    parts: tuple[Element, ...] = ()
    declared: tuple[str, ...] = ()

    def __add__(self, other: Components) -> Components:
        return Components(self.parts + other.parts, self.declared + other.declared)


def chain(
    surface: Surface, terms: Sequence[SurfaceTerm], effectiveness: float, highest_hz: float, origin: Origin
) -> Components:
    """Return the chain of elements from the measured surface to the one that causes the forces.

    Parameters
    ----------
    surface : names of the properties, and the unit of the surface.
    terms : in sequence.
    effectiveness : factor on the surface [-].
    highest_hz : highest simulation rate for which a delay is valid [Hz]; it sets the number of samples kept.
    origin : standard deviations and source, for the descriptions.
    """
    result = Components()
    named, unit = surface.names, abs(surface.unit_rad)
    last = named.source
    for number, term in enumerate(terms, start=1):
        output, words = f"{named.effective}-{number}", origin.words(term)
        if term.kind == "delay":
            result += _delay(last, output, term.value, highest_hz, words)
        elif term.kind == "lag":
            result += _lag(last, output, term.value, words)
        elif term.kind == "rate_limit":
            result += _rate_limit(last, output, term.value, unit, words)
        else:
            result += _backlash(last, output, term.value, unit, words)
        last = output
    formula = op("product", effectiveness, last)
    words = f"Surface as the air sees it; effectiveness {effectiveness!r}"
    return result + _component(named.effective, words + origin.of_declared(named.control), formula)


def _component(output: str, description: str, formula: Element) -> Components:
    return Components((component(output, description, formula),), (output,))


def _delay(source: str, output: str, delay_s: float, highest_hz: float, origin: str) -> Components:
    """A shift register read between two of its samples: exact for whole steps, linear between them."""
    length = max(1, math.ceil(round(delay_s * highest_hz, 9)))
    taps = [f"{output}-before-{k}" for k in range(1, length + 1)]
    points: list[Element | float | str] = [op("quotient", delay_s, step()), 0.0, source]
    for number, tap in enumerate(taps, start=1):
        points += [float(number), tap]
    result = _component(
        output,
        f"Delay of {delay_s!r} s, at simulation rates up to {highest_hz:g} Hz{origin}",
        from_start(source, op("interpolate1d", *points)),
    )
    for tap, previous in zip(reversed(taps), [*reversed(taps[:-1]), source], strict=True):
        result += _component(tap, "", from_start(source, previous))
    return result


def _lag(source: str, output: str, time_s: float, origin: str) -> Components:
    before = f"{output}-input-before"
    formula = from_start(source, lag(time_s, source, before, output))
    memory = _component(before, "", prop(source))
    return _component(output, f"First-order lag, time constant {time_s!r} s{origin}", formula) + memory


def _rate_limit(source: str, output: str, rate_rad_s: float, unit: float, origin: str) -> Components:
    reach = op("product", rate_rad_s / unit, step())
    back = op("product", -rate_rad_s / unit, step())
    move = op("max", back, op("min", reach, op("difference", source, output)))
    words = f"Rate limit {rate_rad_s!r} rad/s{origin}"
    return _component(output, words, from_start(source, op("sum", output, move)))


def _backlash(source: str, output: str, width_rad: float, unit: float, origin: str) -> Components:
    half = 0.5 * width_rad / unit
    pushed = op("max", op("difference", source, half), op("min", op("sum", source, half), output))
    return _component(
        output,
        f"Backlash {width_rad!r} rad in all, the surface starts in its middle{origin}",
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
    if named.surface.startswith("fcs/") and named.surface.endswith("-pos-rad"):
        own = named.surface.removeprefix("fcs/").removesuffix("-pos-rad")
        others |= {f"fcs/{own}-pos-deg": f"{new}-deg", f"fcs/mag-{own}-pos-rad": f"{new}-magnitude"}
    read = {_text(element).removeprefix("-") for element in aerodynamics.iter()}
    if not read & set(surfaces):
        raise AircraftError(
            f"{where}: its <aerodynamics> do not read {named.surface!r}, so nothing can be put between the surface and "
            f"the air; state the property that they read as jsbsim.{named.control}.surface, or choose an effect elsewhere"
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
