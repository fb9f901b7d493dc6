"""The JSBSim model of six derivatives about a trim.

Pitch plane only. About a trim (t), in body axes x forward, z down, with qhat = q c/(2V):

    lift = CLalpha (alpha - alpha_t) + CLq qhat + CLde (de - de_t)
    X = q_bar S (-CA + lift sin alpha_t) + T,   Z = -q_bar S (CN_t + lift cos alpha_t)
    M = q_bar S c (Cmalpha (alpha - alpha_t) + Cmq qhat + Cmde (de - de_t))

The increments of lift stand normal to the trim's flight path, so that in level flight alpha_dot has the six
derivatives of eq. (2) of M. Brunot, "An Instrumental Variable Approach for Aircraft Identification",
exactly; az has them times cos alpha_t. Thrust goes through the CG along body x.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final
from xml.sax.saxutils import escape

import numpy as np

from airtruth.aircraft import Actuator, Aircraft
from airtruth.units import FT, G0, LB, LBF, SLUG

AXIAL: Final = 0.1
"""Axial over normal force at the trim (judgement): it sets the thrust that the trim asks for, nothing else here."""
_THRUST_MARGIN: Final = 2.5


@dataclass(frozen=True)
class TrimPoint:
    """About what the derivatives count.

    Attributes
    ----------
    airspeed_m_s, density_kg_m3 : true airspeed and air density.
    alpha_rad, elevator_rad : angle of attack and surface, where the pitching moment is nil.
    az_m_s2 : specific force along body z there.
    """

    airspeed_m_s: float
    density_kg_m3: float
    alpha_rad: float
    elevator_rad: float
    az_m_s2: float = -G0


def model_xml(name: str, heading: str, aircraft: Aircraft, values: Mapping[str, float], at: TrimPoint) -> str:
    """The model's XML.

    Parameters
    ----------
    name, heading : of the model; said in its head.
    aircraft : constants and servo.
    values : the six derivatives [1/rad]; at : the trim about which they count.
    """
    c = aircraft.constants
    pressure = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2
    normal = -c.mass_kg * at.az_m_s2 / (pressure * c.wing_area_m2)
    thrust = pressure * c.wing_area_m2 * AXIAL * normal + c.mass_kg * G0 * abs(float(np.sin(at.alpha_rad)))
    inertia = c.inertia_yy_kg_m2 / (SLUG * FT**2)  # JSBSim's factors for SI have six digits
    lift = _sum(
        _product(values["CLalpha"], "aero/function/d-alpha"),
        _product(values["CLq"], "aero/function/qhat"),
        _product(values["CLde"], "aero/function/d-elevator"),
    )
    moment = _sum(
        _product(values["Cmalpha"], "aero/function/d-alpha"),
        _product(values["Cmq"], "aero/function/qhat"),
        _product(values["Cmde"], "aero/function/d-elevator"),
    )
    place = "<x> 0.0 </x> <y> 0.0 </y> <z> 0.0 </z>"
    return f"""<?xml version="1.0"?>
<fdm_config name="{name}" version="2.0" release="BETA">
  <fileheader>
    <author>airtruth</author>
    <description>{escape(heading)}</description>
    <limitation>Pitch plane, linear about one trim; axial force and thrust are placeholders.</limitation>
  </fileheader>
  <metrics>
    <wingarea unit="FT2"> {_n(c.wing_area_m2 / FT**2)} </wingarea>
    <wingspan unit="FT"> {_n(c.span_m / FT)} </wingspan>
    <chord unit="FT"> {_n(c.chord_m / FT)} </chord>
    <location name="AERORP" unit="IN"> {place} </location>
    <location name="EYEPOINT" unit="IN"> {place} </location>
    <location name="VRP" unit="IN"> {place} </location>
  </metrics>
  <mass_balance>
    <ixx unit="SLUG*FT2"> {_n(inertia)} </ixx>
    <iyy unit="SLUG*FT2"> {_n(inertia)} </iyy>
    <izz unit="SLUG*FT2"> {_n(inertia)} </izz>
    <emptywt unit="LBS"> {_n(c.mass_kg / LB)} </emptywt>
    <location name="CG" unit="IN"> {place} </location>
  </mass_balance>
  <ground_reactions/>
  <external_reactions>
    <force name="thrust" frame="BODY">
      <function>
        <product>
          <property>fcs/throttle-cmd-norm</property>
          <value>{_n(_THRUST_MARGIN * thrust / LBF)}</value>
        </product>
      </function>
      <location unit="IN"> {place} </location>
      <direction> <x> 1.0 </x> <y> 0.0 </y> <z> 0.0 </z> </direction>
    </force>
  </external_reactions>
  <flight_control name="Elevator and throttle">
    <property value="0">fcs/elevator-cmd-rad</property>
    <property value="0">fcs/throttle-cmd-norm</property>
    <channel name="Elevator">
{_servo(aircraft.file.elevator_actuator)}
    </channel>
  </flight_control>
  <aerodynamics>
    <property value="0">aero/gust/q-rad_sec</property>
    <function name="aero/function/d-alpha">
      <difference> <property>aero/alpha-rad</property> <value>{_n(at.alpha_rad)}</value> </difference>
    </function>
    <function name="aero/function/d-elevator">
      <difference> <property>fcs/elevator-pos-rad</property> <value>{_n(at.elevator_rad)}</value> </difference>
    </function>
    <function name="aero/function/qhat">
      <product>
        <difference> <property>velocities/q-rad_sec</property> <property>aero/gust/q-rad_sec</property> </difference>
        <property>aero/ci2vel</property>
      </product>
    </function>
    <function name="aero/function/d-lift">
      {lift}
    </function>
    <axis name="X">
      <function name="aero/coefficient/CX">
        <product>
          <property>aero/qbar-psf</property> <property>metrics/Sw-sqft</property>
          {_sum(f"<value>{_n(-AXIAL * normal)}</value>", _product(float(np.sin(at.alpha_rad)), "aero/function/d-lift"))}
        </product>
      </function>
    </axis>
    <axis name="Z">
      <function name="aero/coefficient/CZ">
        <product>
          <property>aero/qbar-psf</property> <property>metrics/Sw-sqft</property>
          {_sum(f"<value>{_n(-normal)}</value>", _product(-float(np.cos(at.alpha_rad)), "aero/function/d-lift"))}
        </product>
      </function>
    </axis>
    <axis name="PITCH">
      <function name="aero/coefficient/Cm">
        <product>
          <property>aero/qbar-psf</property> <property>metrics/Sw-sqft</property> <property>metrics/cbarw-ft</property>
          {moment}
        </product>
      </function>
    </axis>
  </aerodynamics>
</fdm_config>
"""


def _n(value: float) -> str:
    return repr(float(value))


def _product(value: float, name: str) -> str:
    return f"<product> <value>{_n(value)}</value> <property>{name}</property> </product>"


def _sum(*terms: str) -> str:
    return f"<sum> {' '.join(terms)} </sum>"


def _servo(actuator: Actuator | None) -> str:
    """The declared servo; without one the surface is the command."""
    if actuator is None:
        return (
            '      <pure_gain name="fcs/elevator-surface"> <input>fcs/elevator-cmd-rad</input> <gain> 1.0 </gain> '
            "<output>fcs/elevator-pos-rad</output> </pure_gain>"
        )
    late = actuator.delay.value
    delay = f'<delay type="time"> {_n(late)} </delay> ' if late > 0.0 else ""
    return (
        '      <actuator name="fcs/elevator-servo"> <input>fcs/elevator-cmd-rad</input> '
        f"<lag> {_n(2.0 * math.pi * actuator.bandwidth.value)} </lag> "
        f"<rate_limit> {_n(actuator.rate_limit.value)} </rate_limit> {delay}"
        f"<clipto> <min> {_n(actuator.minimum.value)} </min> <max> {_n(actuator.maximum.value)} </max> </clipto> "
        "<output>fcs/elevator-pos-rad</output> </actuator>"
    )


__all__ = ["AXIAL", "TrimPoint", "model_xml"]
