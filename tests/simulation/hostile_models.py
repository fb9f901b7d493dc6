"""Copies of the GTM whose XML ends, blocks or fills the process of JSBSim in some states alone.

JSBSim evaluates a function at each reading of its property. A function that reads itself therefore recurses until the
stack ends, and sixty functions that each read the one before twice need 2^60 evaluations. Both wait for a state behind
`<ifthen>`, whose branches are evaluated only if they are taken.
"""

from __future__ import annotations

import shutil
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ALWAYS = (("ge", "simulation/sim-time-sec", 0.0), ("lt", "simulation/sim-time-sec", 1e9))
IN_TRIM = (("gt", "velocities/vt-fps", 50.0), ("lt", "velocities/vt-fps", 250.0))
"""Airspeeds of the campaigns; a model is loaded at 0 and 300 ft/s."""
IN_FLIGHT = (("gt", "simulation/sim-time-sec", 1.0), ("lt", "simulation/sim-time-sec", 1e9))
"""A trim stays at time zero."""


def _function(name: str, body: str) -> str:
    return f'<fcs_function name="hostile/{name}-out"><function name="hostile/{name}">{body}</function></fcs_function>'


def _when(state: tuple[tuple[str, str, float], ...], body: str) -> str:
    tests = "".join(f"<{op}><property>{name}</property><value>{x}</value></{op}>" for op, name, x in state)
    return f"<ifthen><and>{tests}</and>{body}<value>0</value></ifthen>"


def recursion(state: tuple[tuple[str, str, float], ...]) -> str:
    """The stack ends: SIGSEGV."""
    itself = "<product><property>hostile/self</property><value>1</value></product>"
    return _function("self", _when(state, itself))


def endless(state: tuple[tuple[str, str, float], ...]) -> str:
    """2^60 evaluations."""
    levels = [_function("level0", "<property>simulation/sim-time-sec</property>")]
    for k in range(60):
        twice = f"<property>hostile/level{k}</property>" * 2
        levels.append(_function(f"level{k + 1}", _when(state, f"<sum>{twice}</sum>")))
    return "".join(levels)


def delay(seconds: float) -> str:
    """A buffer with one number for each step of the simulation in a time, filled when the model is loaded."""
    source = '<pure_gain name="hostile/zero"><input>velocities/q-rad_sec</input><gain>0</gain></pure_gain>'
    return (
        source
        + f'<actuator name="hostile/late"><input>hostile/zero</input><delay>{seconds}</delay></actuator>'
    )


def ending(at_s: float) -> str:
    """The simulation is told to end at a time."""
    test = f'<test value="1">simulation/sim-time-sec ge {at_s}</test>'
    output = "<output>simulation/terminate</output>"
    return f'<switch name="hostile/end"><default value="0"/>{test}{output}</switch>'


def copy(folder: Path) -> Path:
    """A sound copy named hostile."""
    shutil.copytree(ROOT / "aircraft" / "gtm", folder)
    toml = folder / "aircraft.toml"
    toml.write_text(toml.read_text().replace('name = "gtm"', 'name = "hostile"', 1))
    return folder


def spoil(folder: Path, components: str) -> Path:
    """Add components to a copy."""
    xml = folder / "gtm.xml"
    system = f'<system name="hostile"><channel name="hostile">{components}</channel></system>'
    xml.write_text(xml.read_text().replace("</fdm_config>", system + "</fdm_config>"))
    return folder
