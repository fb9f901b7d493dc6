"""Aircraft of the JSBSim package, flown in calm air and identified against their own linearisation, with the
experiments that explain the differences. Prints the tables of docs/foreign_aircraft.md.

    python -m studies.foreign_aircraft
"""

from __future__ import annotations

import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import jsbsim
import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.identification import Options, identify_batch
from airtruth.logs import store
from airtruth.logs.flight_log import Batch, batches
from airtruth.physics.motion import LONGITUDINAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.linearise import Linearisation, linearise
from airtruth.simulation.probe import grid_about
from airtruth.simulation.simulator import Condition, Executive
from airtruth.simulation.trim import Trim, trim
from airtruth.units import DEG, INCH
from studies.longitudinal_motion import Longitudinal, model_of, simulate

Array = NDArray[np.float64]
Edit = Callable[[ET.Element], None]

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""

NAMES: Final = ("c172x", "f16", "T38")
"""Aircraft of the study."""

METHODS: Final = ("iv-f1", "ls")
"""Methods of the study."""

CMQ: Final = LONGITUDINAL.parameters.index("Cmq")
"""Index of Cmq among the derivatives."""

IN_FILE: Final = {"c172x": (-12.4, -5.2, 3.9, 1.7), "T38": (-18.0, -9.0, 0.0, 0.0)}
"""Cmq, Cm alpha-dot, CLq and CL alpha-dot, per c/(2V) [-], in the XML files of the JSBSim package."""

SECOND_THROTTLE: Final = ', "fcs/throttle-cmd-norm[1]"'
"""Text to remove from T38's aircraft.toml for the experiment with one of its two throttles."""


@dataclass(frozen=True)
class Flown:
    """One flight in calm air: aircraft, record, trim, and the model's own derivatives at the trim."""

    aircraft: Aircraft
    batch: Batch
    trim: Trim
    linear: Linearisation


def copy(name: str, target: Path, edit: Edit | None = None, settings: str = "", without: str = "") -> Path:
    """Copy an aircraft of this repository to a folder below ``target``; return that folder.

    Parameters
    ----------
    name : the aircraft.
    target : folder of the copy.
    edit : change of the model's XML; the model of the JSBSim package is then copied as well.
    settings : entries added to jsbsim.set, as TOML.
    without : text removed from aircraft.toml.
    """
    folder = target / "aircraft" / name
    shutil.copytree(ROOT / "aircraft" / name, folder)
    path = folder / "aircraft.toml"
    text = path.read_text().replace("set = { ", f"set = {{ {settings}{', ' if settings else ''}")
    if edit is not None:
        text = text.replace('root = "wheel"', 'root = "."')
        wheel = Path(jsbsim.get_default_root_dir())
        for part in ("engine", "systems"):
            shutil.copytree(wheel / part, target / "aircraft" / part, dirs_exist_ok=True)
        shutil.copytree(wheel / "aircraft" / name, folder, dirs_exist_ok=True)
        model = folder / f"{name}.xml"
        tree = ET.parse(model)
        edit(tree.getroot())
        tree.write(model)
    path.write_text(text.replace(without, ""))
    return folder


def without_functions(*names: str) -> Edit:
    """Return an edit that removes aerodynamic functions by name."""

    def edit(root: ET.Element) -> None:
        for axis in root.findall("./aerodynamics/axis"):
            for function in axis.findall("function"):
                if function.get("name") in names:
                    axis.remove(function)

    return edit


def without_hysteresis(root: ET.Element) -> None:
    """Remove hysteresis and bias from the actuator of the elevator."""
    for actuator in root.iter("actuator"):
        if actuator.get("name") == "fcs/elevator-actuator":
            for tag in ("hysteresis_width", "bias"):
                for element in actuator.findall(tag):
                    actuator.remove(element)


def fly(name: str, folder: Path, changes: dict[str, object] | None = None) -> Flown:
    """Fly data/campaigns/foreign-NAME.toml with the aircraft of a folder and new values of some keys of the file."""
    lines = (ROOT / "data" / "campaigns" / f"foreign-{name}.toml").read_text().splitlines()
    changed: dict[str, object] = {"aircraft": f'"{folder}"', **(changes or {})}
    text = "\n".join(
        f"{key} = {changed[key]}" if (key := line.split(" =")[0]) in changed else line for line in lines
    )
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "campaign.toml"
        path.write_text(text)
        planned = plan.make(path)
        failures = campaign.fly(planned, Path(scratch) / "out").failures
        if failures:
            raise RuntimeError(f"{name}: {failures[0].reason}")
        (batch,) = batches(store.read_log(Path(scratch) / "out" / "logs" / "00000.parquet"))
    at = trim(planned.aircraft, plan.planned_runs(planned.table.head(1))[0].condition)
    return Flown(planned.aircraft, batch, at, linearise(planned.aircraft, at))


def level_wings(aircraft: Aircraft, condition: Condition) -> str:
    """Return aileron and rudder, as entries of jsbsim.set, for a trim without rolling and yawing moment."""
    executive = Executive(aircraft, 1.0 / 200.0)
    at = trim(aircraft, condition)
    names = ("fcs/aileron-cmd-norm", "fcs/rudder-cmd-norm")

    def moments(x: Array) -> Array:
        for name, value in zip(names, x, strict=True):
            executive.node(name).set_double_value(float(value))
        executive.initialise(condition, at.controls)
        rates = executive.nodes(["accelerations/pdot-rad_sec2", "accelerations/rdot-rad_sec2"])
        return np.array([node.get_double_value() for node in rates])

    origin, step = moments(np.zeros(2)), 0.01
    slopes = np.column_stack([(moments(d) - origin) / step for d in step * np.eye(2)])
    x = np.linalg.solve(slopes, -origin)
    return ", ".join(f'"{name}" = {value:.9f}' for name, value in zip(names, x, strict=True))


def simulated(model: Longitudinal, flown: Flown) -> Batch:
    """Simulate the tabulated aircraft with the elevator of the flight; return the record."""
    channels = flown.batch.channels
    elevator = channels["elevator_rad"] - channels["elevator_rad"][:, :1] + model.elevator_rad
    motion = simulate(model, elevator, flown.batch.dt_s)
    made = {
        "airspeed_m_s": motion.airspeed_m_s,
        "alpha_rad": motion.alpha_rad,
        "q_rad_s": motion.q_rad_s,
        "az_m_s2": motion.az_m_s2,
        "elevator_rad": elevator,
        "density_kg_m3": np.full_like(elevator, flown.trim.density_kg_m3),
    }
    return Batch(flown.batch.run_ids, flown.batch.dt_s, flown.batch.t_s, made)


def estimate(flown: Flown, method: str, batch: Batch | None = None) -> Array:
    """Return the estimate, (6,), NaN where there is none."""
    options = Options(covariance="none")
    theta: Array = identify_batch(batch or flown.batch, flown.aircraft, method, options).theta[0]
    return theta


def expected_cmq(flown: Flown, cmq: float, cm_alpha_dot: float, cl_q: float, cl_alpha_dot: float) -> float:
    """Return Cmq of a two-state model about the CG, from the terms of a model's file about its reference point.

    The lift terms act ahead of the CG by ``arm``. With alpha' = (1 - (q_bar S/mV)(c/2V) CLq) q + ..., where CLq is
    that of the two-state model, the alpha-dot terms become terms in q.
    """
    executive = Executive(flown.aircraft, 1.0 / 200.0)
    executive.initialise(flown.trim.condition, flown.trim.controls)
    names = ("inertia/cg-x-in", "metrics/aero-rp-x-in")
    cg, reference = (node.get_double_value() * INCH for node in executive.nodes(names))
    arm, s = (cg - reference) / flown.aircraft.chord_m, flown.linear.scale
    turn = (
        1.0 - float(s.lift * s.half_chord_time) * flown.linear.central[LONGITUDINAL.parameters.index("CLq")]
    )
    return float(cmq + arm * cl_q + (cm_alpha_dot + arm * cl_alpha_dot) * turn)


def row(label: str, flown: Flown, methods: Sequence[str] = METHODS, batch: Batch | None = None) -> None:
    """Print the linearisation, the estimates and their errors [%] for the moment derivatives and CLalpha."""
    truth = flown.linear.central
    for method in methods:
        theta = estimate(flown, method, batch)
        cells = [f"{t:9.4f} {e:9.4f} {100 * (e / t - 1):+7.2f}" for t, e in zip(truth, theta, strict=True)]
        print(f"| {label} | {method} | " + " | ".join([*cells[3:], cells[0]]) + " |", flush=True)


HEADER: Final = "| case | method | " + " | ".join(
    f"{name}: model, estimate, error %" for name in (*LONGITUDINAL.parameters[3:], LONGITUDINAL.parameters[0])
)
"""Heading of the tables."""


def main() -> None:
    """Print both tables."""
    with tempfile.TemporaryDirectory() as scratch:
        counter = iter(range(100))

        def made(
            name: str,
            edit: Edit | None = None,
            settings: str = "",
            without: str = "",
            changes: dict[str, object] | None = None,
        ) -> Flown:
            folder = copy(name, Path(scratch) / str(next(counter)), edit, settings, without)
            return fly(name, folder, changes)

        print(HEADER + " |\n|---|---|---|---|---|---|")
        first = {name: made(name) for name in NAMES}
        for name, flown in first.items():
            c = flown.batch.channels
            row(name, flown)
            print(
                f"|   | wn {flown.linear.wn_rad_s:.2f} rad/s, zeta {flown.linear.zeta:.2f}; alpha "
                f"{c['alpha_rad'].min() / DEG:.2f} to {c['alpha_rad'].max() / DEG:.2f} deg, airspeed "
                f"{c['airspeed_m_s'].min():.2f} to {c['airspeed_m_s'].max():.2f} m/s | | | | |"
            )
        print("\n" + HEADER + " |\n|---|---|---|---|---|---|")
        row("T38, one throttle of two", made("T38", without=SECOND_THROTTLE))
        row("T38, no Cm alpha-dot", made("T38", without_functions("aero/coefficient/Cmadot")))
        row("f16, 0.05 deg", made("f16", changes={"amplitude_deg": 0.05}))
        row("f16, 3-2-1-1", made("f16", changes={"kind": '"3211"'}))
        row("T38, 3-2-1-1", made("T38", changes={"kind": '"3211"'}))
        row("f16, 2 deg", made("f16", changes={"amplitude_deg": 2.0}))
        for degrees in (2.0, 3.0, 5.0):
            row(f"c172x, {degrees:g} deg", made("c172x", changes={"amplitude_deg": degrees}))
        condition = first["c172x"].trim.condition
        level = level_wings(first["c172x"].aircraft, condition)
        weak: dict[str, object] = {"amplitude_deg": 2.0}
        row("c172x, 2 deg, wings held level", made("c172x", settings=level, changes=weak))
        row("c172x, wings held level", made("c172x", settings=level))
        row("c172x, no hysteresis", made("c172x", without_hysteresis))
        row("c172x, neither", made("c172x", without_hysteresis, level))
        small: dict[str, object] = {"amplitude_deg": 0.2}
        row("c172x, neither, 0.2 deg", made("c172x", without_hysteresis, level, changes=small))
        print("\n| aircraft | Cmq from the terms of its file | linearised | iv-f1 |\n|---|---|---|---|")
        for name, terms in IN_FILE.items():
            flown = first[name]
            expected, estimated = expected_cmq(flown, *terms), estimate(flown, "iv-f1")[CMQ]
            print(f"| {name} | {expected:.3f} | {flown.linear.central[CMQ]:.3f} | {estimated:.3f} |")
        print("\n" + HEADER + " |\n|---|---|---|---|---|---|")
        for name, reach in (("c172x", 4.0), ("f16", 3.0)):
            flown = first[name]
            model = model_of(
                flown.aircraft, flown.trim, grid_about(flown.trim, (reach * DEG, reach * DEG, 24.0 * DEG))
            )
            for drift, word in ((1.0, "free"), (0.0, "held")):
                batch = simulated(replace(model, drift=drift), flown)
                row(f"{name}, tables, speed {word}", flown, batch=batch)


if __name__ == "__main__":
    main()
