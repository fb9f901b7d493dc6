"""Parts of a generated JSBSim model in XML: numbers, sums and products, signals counted from a trim, a servo."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from airtruth.aircraft.file import Actuator
from airtruth.physics.motion_parts import Reference

_LENGTHS: Final[Mapping[Reference, str]] = {"chord": "metrics/cbarw-ft", "span": "metrics/bw-ft"}
"""Reference length -> its property [ft]."""


def number(value: float) -> str:
    """A number with all digits."""
    return repr(float(value))


def product(value: float, name: str) -> str:
    """A number times a property."""
    return f"<product> <value>{number(value)}</value> <property>{name}</property> </product>"


def total(*terms: str) -> str:
    """A sum of terms."""
    return f"<sum> {' '.join(terms)} </sum>"


def axis(name: str, coefficient: str, terms: str, length: Reference | None = None) -> str:
    """The axis of a coefficient: dynamic pressure, area, reference length and the sum of its terms."""
    by_length = f" <property>{_LENGTHS[length]}</property>" if length is not None else ""
    return f"""
    <axis name="{name}">
      <function name="aero/coefficient/{coefficient}">
        <product>
          <property>aero/qbar-psf</property> <property>metrics/Sw-sqft</property>{by_length}
          {terms}
        </product>
      </function>
    </axis>"""


def from_trim(signal: str, name: str, trim: float) -> str:
    """The function aero/function/d-SIGNAL: a property less its value at the trim."""
    return f"""<function name="aero/function/d-{signal}">
      <difference> <property>{name}</property> <value>{number(trim)}</value> </difference>
    </function>"""


def rate(signal: str, axis: str, length: str) -> str:
    """The function aero/function/SIGNAL: the rate about an axis in the air, times its reference length over twice the airspeed.

    Parameters
    ----------
    signal : "phat", "qhat" or "rhat"; axis : "p", "q" or "r"; length : "bi2vel" or "ci2vel".
    """
    return f"""<function name="aero/function/{signal}">
      <product>
        <difference> <property>velocities/{axis}-rad_sec</property> <property>aero/gust/{axis}-rad_sec</property> </difference>
        <property>aero/{length}</property>
      </product>
    </function>"""


def servo(control: str, actuator: Actuator | None) -> str:
    """The declared servo of a control; without one the surface is the command."""
    command, surface = f"fcs/{control}-cmd-rad", f"fcs/{control}-pos-rad"
    if actuator is None:
        return (
            f'      <pure_gain name="fcs/{control}-surface"> <input>{command}</input> <gain> 1.0 </gain> '
            f"<output>{surface}</output> </pure_gain>"
        )
    late = actuator.delay.value
    delay = f'<delay type="time"> {number(late)} </delay> ' if late > 0.0 else ""
    return (
        f'      <actuator name="fcs/{control}-servo"> <input>{command}</input> '
        f"<lag> {number(2.0 * math.pi * actuator.bandwidth.value)} </lag> "
        f"<rate_limit> {number(actuator.rate_limit.value)} </rate_limit> {delay}"
        f"<clipto> <min> {number(actuator.minimum.value)} </min> <max> {number(actuator.maximum.value)} </max> </clipto> "
        f"<output>{surface}</output> </actuator>"
    )


__all__ = ["axis", "from_trim", "number", "product", "rate", "servo", "total"]
