"""A JSBSim model that flies six derivatives about a trim.

Pitch plane only. About a trim (t), in body axes x forward, z down, with qhat = q c/(2V):

    lift = CLalpha (alpha - alpha_t) + CLq qhat + CLde (de - de_t)
    X = q_bar S (-CA + lift sin alpha_t) + T,   Z = -q_bar S (CN_t + lift cos alpha_t)
    M = q_bar S c (Cmalpha (alpha - alpha_t) + Cmq qhat + Cmde (de - de_t))

The increments of lift are normal to the flight path of the trim, so that in level flight alpha_dot has the six
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

from airtruth.aircraft.file import Actuator, Aircraft
from airtruth.aircraft.probe import Constants
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
    values : the six derivatives [1/rad].
    at : trim about which they hold.
    """
    c = aircraft.constants
    force = 0.5 * at.density_kg_m3 * at.airspeed_m_s**2 * c.wing_area_m2
    normal = -c.mass_kg * at.az_m_s2 / force
    thrust = force * AXIAL * normal + c.mass_kg * G0 * abs(float(np.sin(at.alpha_rad)))
    return f"""<?xml version="1.0"?>
<fdm_config name="{name}" version="2.0" release="BETA">
  <fileheader>
    <author>airtruth</author>
    <description>{escape(heading)}</description>
    <limitation>Pitch plane, linear about one trim; axial force and thrust are placeholders.</limitation>
  </fileheader>
{_metrics(c)}
{_mass_balance(c)}
  <ground_reactions/>
{_thrust(_THRUST_MARGIN * thrust)}
{_controls(aircraft.file.elevator_actuator)}
{_aerodynamics(values, at, normal)}
</fdm_config>
"""


def _metrics(c: Constants) -> str:
    return f"""  <metrics>
    <wingarea unit="FT2"> {_n(c.wing_area_m2 / FT**2)} </wingarea>
    <wingspan unit="FT"> {_n(c.span_m / FT)} </wingspan>
    <chord unit="FT"> {_n(c.chord_m / FT)} </chord>
    <location name="AERORP" unit="IN"> {_ORIGIN} </location>
    <location name="EYEPOINT" unit="IN"> {_ORIGIN} </location>
    <location name="VRP" unit="IN"> {_ORIGIN} </location>
  </metrics>"""


def _mass_balance(c: Constants) -> str:
    unit = SLUG * FT**2  # JSBSim's factors for SI have six digits
    inertia = c.inertia_yy_kg_m2 / unit
    return f"""  <mass_balance negated_crossproduct_inertia="false">
    <ixx unit="SLUG*FT2"> {_n(c.inertia_xx_kg_m2 / unit or inertia)} </ixx>
    <iyy unit="SLUG*FT2"> {_n(inertia)} </iyy>
    <izz unit="SLUG*FT2"> {_n(c.inertia_zz_kg_m2 / unit or inertia)} </izz>
    <ixz unit="SLUG*FT2"> {_n(c.inertia_xz_kg_m2 / unit)} </ixz>
    <emptywt unit="LBS"> {_n(c.mass_kg / LB)} </emptywt>
    <location name="CG" unit="IN"> {_ORIGIN} </location>
  </mass_balance>"""


def _thrust(largest_n: float) -> str:
    """Thrust along body x through the CG, in proportion to the throttle [N]."""
    return f"""  <external_reactions>
    <force name="thrust" frame="BODY">
      <function>
        <product>
          <property>fcs/throttle-cmd-norm</property>
          <value>{_n(largest_n / LBF)}</value>
        </product>
      </function>
      <location unit="IN"> {_ORIGIN} </location>
      <direction> <x> 1.0 </x> <y> 0.0 </y> <z> 0.0 </z> </direction>
    </force>
  </external_reactions>"""


def _controls(actuator: Actuator | None) -> str:
    return f"""  <flight_control name="Elevator and throttle">
    <property value="0">fcs/elevator-cmd-rad</property>
    <property value="0">fcs/throttle-cmd-norm</property>
    <channel name="Elevator">
{_servo(actuator)}
    </channel>
  </flight_control>"""


def _aerodynamics(values: Mapping[str, float], at: TrimPoint, normal: float) -> str:
    """Forces and moment; ``normal`` is the normal-force coefficient of the trim [-]."""
    lift, moment = (_linear(values, coefficient) for coefficient in ("CL", "Cm"))
    sine, cosine = float(np.sin(at.alpha_rad)), float(np.cos(at.alpha_rad))
    return f"""  <aerodynamics>
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
          {_sum(f"<value>{_n(-AXIAL * normal)}</value>", _product(sine, "aero/function/d-lift"))}
        </product>
      </function>
    </axis>
    <axis name="Z">
      <function name="aero/coefficient/CZ">
        <product>
          <property>aero/qbar-psf</property> <property>metrics/Sw-sqft</property>
          {_sum(f"<value>{_n(-normal)}</value>", _product(-cosine, "aero/function/d-lift"))}
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
  </aerodynamics>"""


def _linear(values: Mapping[str, float], coefficient: str) -> str:
    """Increment of a coefficient by alpha, q and elevator."""
    signals = {"alpha": "d-alpha", "q": "qhat", "de": "d-elevator"}
    return _sum(
        *(_product(values[coefficient + by], f"aero/function/{signal}") for by, signal in signals.items())
    )


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
