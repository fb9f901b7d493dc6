"""Aircraft of the JSBSim wheel, flown in calm air and identified against their own linearisation, with the
experiments that show what the differences come from. Prints the tables of docs/foreign_aircraft.md.

    python scripts/foreign_aircraft.py
"""

from __future__ import annotations

import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import jsbsim
import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import Aircraft
from airtruth.fly import campaign, plan
from airtruth.fly.engine import Condition, Executive
from airtruth.fly.linearise import Linearisation, linearise
from airtruth.fly.probe import grid_about, probe
from airtruth.fly.trim import Trim, trim
from airtruth.identify import Options, identify_batch
from airtruth.logs import store
from airtruth.logs.flight_log import Batch, batches
from airtruth.physics.longitudinal import Longitudinal, simulate
from airtruth.physics.short_period import PARAMETERS
from airtruth.units import DEG, INCH

Array = NDArray[np.float64]
Edit = Callable[[ET.Element], None]

ROOT = Path(__file__).resolve().parents[1]
NAMES = ("c172x", "f16", "T38")
METHODS = ("iv-f1", "ls")
CMQ = PARAMETERS.index("Cmq")
IN_FILE = {"c172x": (-12.4, -5.2, 3.9, 1.7), "T38": (-18.0, -9.0, 0.0, 0.0)}
"""Cmq, Cm alpha-dot, CLq, CL alpha-dot, per c/(2V), as the wheel's XML files state them."""
SECOND_THROTTLE = ', "fcs/throttle-cmd-norm[1]"'
"""What T38's aircraft.toml lacks when one of its two engines is left alone."""


@dataclass(frozen=True)
class Flown:
    """One calm flight: log, trim and the derivatives that the model itself has there."""

    aircraft: Aircraft
    batch: Batch
    trim: Trim
    linear: Linearisation


def copy(name: str, target: Path, edit: Edit | None = None, settings: str = "", without: str = "") -> Path:
    """Folder of an aircraft of this repository below ``target``, its wheel model copied where it is edited.

    settings : entries added to jsbsim.set, as TOML; without : text taken out of aircraft.toml.
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
    """Remove aerodynamic functions by name."""

    def edit(root: ET.Element) -> None:
        for axis in root.findall("./aerodynamics/axis"):
            for function in axis.findall("function"):
                if function.get("name") in names:
                    axis.remove(function)

    return edit


def without_hysteresis(root: ET.Element) -> None:
    """Take hysteresis and bias out of the elevator's actuator."""
    for actuator in root.iter("actuator"):
        if actuator.get("name") == "fcs/elevator-actuator":
            for tag in ("hysteresis_width", "bias"):
                for element in actuator.findall(tag):
                    actuator.remove(element)


def both(*edits: Edit) -> Edit:
    """One edit after the other."""

    def edit(root: ET.Element) -> None:
        for each in edits:
            each(root)

    return edit


def fly(name: str, folder: Path, changes: dict[str, object] | None = None) -> Flown:
    """Fly data/campaigns/foreign-NAME.toml with the aircraft of a folder; changes: keys of the file."""
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
    at = trim(planned.aircraft, plan.condition({str(k): v for k, v in planned.table.iloc[0].items()}))
    return Flown(planned.aircraft, batch, at, linearise(planned.aircraft, at))


def level_wings(aircraft: Aircraft, condition: Condition) -> str:
    """Aileron and rudder, as jsbsim.set, that take the rolling and yawing moments out of the trim."""
    executive = Executive(aircraft, 1.0 / 200.0)
    at = trim(aircraft, condition)
    names = ("fcs/aileron-cmd-norm", "fcs/rudder-cmd-norm")

    def moments(x: Array) -> Array:
        for name, value in zip(names, x, strict=True):
            executive.node(name).set_double_value(float(value))
        executive.initialise(condition, at.alpha_rad, at.controls)
        rates = executive.nodes(["accelerations/pdot-rad_sec2", "accelerations/rdot-rad_sec2"])
        return np.array([node.get_double_value() for node in rates])

    origin, step = moments(np.zeros(2)), 0.01
    slopes = np.column_stack([(moments(d) - origin) / step for d in step * np.eye(2)])
    x = np.linalg.solve(slopes, -origin)
    return ", ".join(f'"{name}" = {value:.9f}' for name, value in zip(names, x, strict=True))


def simulated(model: Longitudinal, flown: Flown) -> Batch:
    """The log that the tabulated aircraft gives with the surface of the flight, at its own steps."""
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
    """(6,) estimate; NaN where there is none."""
    options = Options(covariance="none")
    theta: Array = identify_batch(batch or flown.batch, flown.aircraft, method, options).theta[0]
    return theta


def expected_cmq(flown: Flown, cmq: float, cm_alpha_dot: float, cl_q: float, cl_alpha_dot: float) -> float:
    """Cmq of a two-state model about the CG, from the terms of a model's file about its reference point.

    The lift terms act ahead of the CG by ``arm``; alpha' = (1 - (q_bar S/mV)(c/2V) CLq) q + ... turns the
    alpha-dot terms into terms in q, CLq being that of the two-state model.
    """
    executive = Executive(flown.aircraft, 1.0 / 200.0)
    executive.initialise(flown.trim.condition, flown.trim.alpha_rad, flown.trim.controls)
    names = ("inertia/cg-x-in", "metrics/aero-rp-x-in")
    cg, reference = (node.get_double_value() * INCH for node in executive.nodes(names))
    arm, s = (cg - reference) / flown.aircraft.chord_m, flown.linear.scale
    turn = 1.0 - float(s.lift * s.half_chord_time) * flown.linear.central[PARAMETERS.index("CLq")]
    return float(cmq + arm * cl_q + (cm_alpha_dot + arm * cl_alpha_dot) * turn)


def row(label: str, flown: Flown, methods: Sequence[str] = METHODS, batch: Batch | None = None) -> None:
    """Print linearisation, estimates and their errors [%] of the moment derivatives."""
    truth = flown.linear.central
    for method in methods:
        theta = estimate(flown, method, batch)
        cells = [f"{t:9.4f} {e:9.4f} {100 * (e / t - 1):+7.2f}" for t, e in zip(truth, theta, strict=True)]
        print(f"| {label} | {method} | " + " | ".join([*cells[3:], cells[0]]) + " |", flush=True)


HEADER = "| case | method | " + " | ".join(
    f"{name}: model, estimate, error %" for name in (*PARAMETERS[3:], PARAMETERS[0])
)


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
            model = probe(
                flown.aircraft, flown.trim, grid_about(flown.trim, reach * DEG, reach * DEG, 24.0 * DEG)
            )
            for drift, word in ((1.0, "free"), (0.0, "held")):
                batch = simulated(replace(model, drift=drift), flown)
                row(f"{name}, tables, speed {word}", flown, batch=batch)


if __name__ == "__main__":
    main()
