"""A JSBSim model that flies six derivatives about a trim, and with fifteen lateral ones in six axes.

About a trim (t), in body axes x forward, z down, with qhat = q c/(2V):

    lift = CLalpha (alpha - alpha_t) + CLq qhat + CLde (de - de_t)
    X = q_bar S (-CA + lift sin alpha_t) + T,   Z = -q_bar S (CN_t + lift cos alpha_t)
    M = q_bar S c (Cmalpha (alpha - alpha_t) + Cmq qhat + Cmde (de - de_t))

The increments of lift are normal to the flight path of the trim, so that in level flight alpha_dot has the six
derivatives of eq. (2) of M. Brunot, "An Instrumental Variable Approach for Aircraft Identification",
exactly; az has them times cos alpha_t. Thrust goes through the CG along body x. The lateral forces are those of
`airtruth.aircraft.jsbsim.lateral_axes`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from xml.sax.saxutils import escape

import numpy as np

from airtruth.aircraft.file import Aircraft
from airtruth.aircraft.jsbsim.lateral_axes import lateral_axes, lateral_channels
from airtruth.aircraft.jsbsim.linear_parts import axis, from_trim, number, product, rate, servo, total
from airtruth.aircraft.probe import Constants
from airtruth.physics.motion import LATERAL, LONGITUDINAL
from airtruth.units import FT, G0, LB, LBF, SLUG

AXIAL: Final = 0.1
"""Axial over normal force at the trim [-] (judgement): it sets the thrust of the trim and nothing else."""
_THRUST_MARGIN: Final = 2.5
"""Largest thrust over that of the trim [-] (judgement): the trim has the throttle at 0.4, away from its ends."""
_ORIGIN: Final = "<x> 0.0 </x> <y> 0.0 </y> <z> 0.0 </z>"
"""The CG, at which every location of the model lies."""


@dataclass(frozen=True)
class TrimPoint:
    """The trim about which derivatives hold.

    Attributes
    ----------
    airspeed_m_s, density_kg_m3 : true airspeed [m/s] and air density [kg/m3].
    alpha_rad, elevator_rad : angle of attack and elevator at which the pitching moment vanishes [rad].
    az_m_s2 : specific force along body z [m/s2].
    """

    airspeed_m_s: float
    density_kg_m3: float
    alpha_rad: float
    elevator_rad: float
    az_m_s2: float = -G0


def model_xml(name: str, heading: str, aircraft: Aircraft, values: Mapping[str, float], at: TrimPoint) -> str:
    """Return the model's XML.

    Parameters
    ----------
    name : name of the model.
    heading : its description.
    aircraft : source of constants and servo.
    values : the six derivatives, and the fifteen lateral ones for a model in six axes [1/rad, -].
    at : trim about which they hold.
    """
    c = aircraft.constants
    is_lateral = set(LATERAL.parameters) <= set(values)
    plane = "Linear about one trim" if is_lateral else "Pitch plane, linear about one trim"
    force = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2 * c.wing_area_m2
    normal = -c.mass_kg * at.az_m_s2 / force
    thrust = force * AXIAL * normal + c.mass_kg * G0 * abs(float(np.sin(at.alpha_rad)))
    return f"""<?xml version="1.0"?>
<fdm_config name="{name}" version="2.0" release="BETA">
  <fileheader>
    <author>airtruth</author>
    <description>{escape(heading)}</description>
    <limitation>{plane}; axial force and thrust are placeholders.</limitation>
  </fileheader>
{_metrics(c)}
{_mass_balance(c)}
  <ground_reactions/>
{_thrust(_THRUST_MARGIN * thrust)}
{_controls(aircraft, is_lateral)}
{_aerodynamics(values, at, normal, lateral_axes(values) if is_lateral else "")}
</fdm_config>
"""


def _metrics(c: Constants) -> str:
    return f"""  <metrics>
    <wingarea unit="FT2"> {number(c.wing_area_m2 / FT**2)} </wingarea>
    <wingspan unit="FT"> {number(c.span_m / FT)} </wingspan>
    <chord unit="FT"> {number(c.chord_m / FT)} </chord>
    <location name="AERORP" unit="IN"> {_ORIGIN} </location>
    <location name="EYEPOINT" unit="IN"> {_ORIGIN} </location>
    <location name="VRP" unit="IN"> {_ORIGIN} </location>
  </metrics>"""


def _mass_balance(c: Constants) -> str:
    unit = SLUG * FT**2  # JSBSim's factors for SI have six digits
    inertia = c.inertia_yy_kg_m2 / unit
    return f"""  <mass_balance negated_crossproduct_inertia="false">
    <ixx unit="SLUG*FT2"> {number(c.inertia_xx_kg_m2 / unit or inertia)} </ixx>
    <iyy unit="SLUG*FT2"> {number(inertia)} </iyy>
    <izz unit="SLUG*FT2"> {number(c.inertia_zz_kg_m2 / unit or inertia)} </izz>
    <ixz unit="SLUG*FT2"> {number(c.inertia_xz_kg_m2 / unit)} </ixz>
    <emptywt unit="LBS"> {number(c.mass_kg / LB)} </emptywt>
    <location name="CG" unit="IN"> {_ORIGIN} </location>
  </mass_balance>"""


def _thrust(largest_n: float) -> str:
    """Thrust along body x through the CG, in proportion to the throttle [N]."""
    return f"""  <external_reactions>
    <force name="thrust" frame="BODY">
      <function>
        <product>
          <property>fcs/throttle-cmd-norm</property>
          <value>{number(largest_n / LBF)}</value>
        </product>
      </function>
      <location unit="IN"> {_ORIGIN} </location>
      <direction> <x> 1.0 </x> <y> 0.0 </y> <z> 0.0 </z> </direction>
    </force>
  </external_reactions>"""


def _controls(aircraft: Aircraft, is_lateral: bool) -> str:
    file = aircraft.file
    more = lateral_channels(file) if is_lateral else ""
    return f"""  <flight_control name="Elevator and throttle">
    <property value="0">fcs/elevator-cmd-rad</property>
    <property value="0">fcs/throttle-cmd-norm</property>
    <channel name="Elevator">
{servo("elevator", file.elevator_actuator)}
    </channel>{more}
  </flight_control>"""


def _aerodynamics(values: Mapping[str, float], at: TrimPoint, normal: float, lateral: str) -> str:
    """Forces and moment; ``normal`` is the normal-force coefficient of the trim [-], ``lateral`` the lateral forces."""
    force, turn = LONGITUDINAL.coefficients
    sine, cosine = float(np.sin(at.alpha_rad)), float(np.cos(at.alpha_rad))
    along = total(f"<value>{number(-AXIAL * normal)}</value>", product(sine, "aero/function/d-lift"))
    down = total(f"<value>{number(-normal)}</value>", product(-cosine, "aero/function/d-lift"))
    axes = (
        axis("X", "CX", along),
        axis("Z", "CZ", down),
        axis("PITCH", turn.name, _linear(values, turn.name), turn.length),
    )
    return f"""  <aerodynamics>
    <property value="0">aero/gust/q-rad_sec</property>
    {from_trim("alpha", "aero/alpha-rad", at.alpha_rad)}
    {from_trim("elevator", "fcs/elevator-pos-rad", at.elevator_rad)}
    {rate("qhat", "q", "ci2vel")}
    <function name="aero/function/d-lift">
      {_linear(values, force.name)}
    </function>{"".join(axes)}{lateral}
  </aerodynamics>"""


def _linear(values: Mapping[str, float], coefficient: str) -> str:
    """Increment of a coefficient by the signals of the pitch plane."""
    signals = {s.symbol: s.name if s.length is not None else f"d-{s.name}" for s in LONGITUDINAL.signals}
    return total(
        *(product(values[coefficient + by], f"aero/function/{signal}") for by, signal in signals.items())
    )


__all__ = ["AXIAL", "TrimPoint", "model_xml"]
