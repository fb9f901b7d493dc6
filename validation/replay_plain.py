"""Fly an aircraft folder in plain JSBSim through the measured elevator of a log, without airtruth.

    python -m validation.replay_plain out/trace/aircraft/gtm data/undeclared/a.parquet

A check from outside of what a trace reports: the model is loaded by JSBSim alone, the sensors of aircraft.toml
(position, lag, delay, scale) are applied here, and initial angle of attack, initial pitch rate, an offset of
the elevator and a bias of each channel are free. The air's horizontal velocity follows the measured airspeed.
Prints the root mean square error of alpha, q and az over the runs.
"""

import argparse
import json
import math
import os
import tomllib
from pathlib import Path

os.environ["JSBSIM_DEBUG"] = "0"  # read when it is imported: no banner among the results
import jsbsim
import numpy as np
import pyarrow.parquet as pq

FT, SLUG, KT = 0.3048, 14.593902937206364, 1852.0 / 3600.0
UNITS = {
    "": 1.0, "s": 1.0, "ms": 1e-3, "m": 1.0, "ft": FT, "in": FT / 12.0, "m_s": 1.0, "kt": KT, "ft_s": FT,
    "rad": 1.0, "deg": math.pi / 180.0, "rad_s": 1.0, "deg_s": math.pi / 180.0, "m_s2": 1.0, "g": 9.80665,
}  # fmt: skip
CHANNELS = ("alpha_rad", "q_rad_s", "az_m_s2")
STEP_S = 0.005
AB3 = 4.0  # JSBSim's number for third-order Adams-Bashforth


def quantity(sensors, channel, name, neutral):
    """A sensor's value in SI."""
    table = sensors.get(channel, {}).get(name)
    if table is None:
        return neutral
    return table["value"] * UNITS[table.get("unit", "")]


class Aircraft:
    """A JSBSim model and what aircraft.toml says of it."""

    def __init__(self, folder):
        self.table = tomllib.loads((folder / "aircraft.toml").read_text())
        self.sensors = self.table.get("sensors", {})
        model = self.table["jsbsim"]
        self.elevator = {"command_per_rad": 1.0, "surface": "fcs/elevator-pos-rad", "surface_rad": 1.0}
        self.elevator |= model["elevator"]
        throttle = model.get("throttle", {})
        self.throttle = [*throttle.get("command", ["fcs/throttle-cmd-norm"]), *throttle.get("trim", [])]
        self.set = model.get("set", {})
        self.name = model["model"]
        self.folder = folder.resolve().parent
        if model.get("root", ".") == "wheel":
            self.folder = Path(jsbsim.get_default_root_dir()) / "aircraft"

    def open(self, step):
        root = self.folder
        fdm = jsbsim.FGFDMExec(str(root))
        fdm.set_debug_level(0)
        fdm.set_dt(step)
        fdm.set_aircraft_path(str(root))
        fdm.set_engine_path(str(root.parent / "engine" if root.name == "aircraft" else root / "engine"))
        fdm.set_systems_path(str(root.parent / "systems" if root.name == "aircraft" else root / "systems"))
        if not fdm.load_model(self.name):
            raise SystemExit(f"JSBSim refused {self.name} in {root}")
        fdm.disable_output()
        return fdm

    def start(self, fdm, at, alpha, q, command, throttle):
        fdm.set_trim_status(True)  # actuators pass their input through: the surface is commanded
        for name, value in self.set.items():
            fdm[name] = value
        for name, value in {
            "ic/h-sl-ft": at["altitude_m"] / FT, "ic/lat-gc-deg": 0.0, "ic/long-gc-deg": 0.0,
            "ic/psi-true-rad": 0.0, "ic/phi-rad": 0.0, "ic/ve-kts": at["eas_m_s"] / KT, "ic/theta-rad": alpha,
            "ic/alpha-rad": alpha, "ic/beta-rad": 0.0, "ic/gamma-rad": 0.0, "ic/p-rad_sec": 0.0,
            "ic/q-rad_sec": q, "ic/r-rad_sec": 0.0,
        }.items():  # fmt: skip
            fdm[name] = value
        fdm[self.elevator["command"]] = command * self.elevator["command_per_rad"]
        for name in self.throttle:
            fdm[name] = throttle
        fdm.run_ic()
        if fdm.get_propulsion().get_num_engines():
            fdm.get_propulsion().get_steady_state()
        for order in ("rate", "position"):
            for kind in ("rotational", "translational"):
                fdm[f"simulation/integrator/{order}/{kind}"] = AB3

    def surface(self, fdm):
        return fdm[self.elevator["surface"]] * self.elevator["surface_rad"]

    def trim(self, at):
        """Newton's method on angle of attack, elevator command and throttle for level flight."""
        fdm = self.open(STEP_S)
        rates = ("accelerations/udot-ft_sec2", "accelerations/wdot-ft_sec2", "accelerations/qdot-rad_sec2")

        def respond(x):
            self.start(fdm, at, x[0], 0.0, x[1], x[2])
            return np.array([fdm[name] for name in rates])

        x, h = np.array([0.08, 0.0, 0.4]), np.array([1e-5, 1e-5, 1e-4])
        for _ in range(60):
            now = respond(x)
            if np.abs(now).max() < 1e-8:
                break
            jacobian = np.column_stack([(respond(x + h * e) - now) / h[i] for i, e in enumerate(np.eye(3))])
            step = -np.linalg.lstsq(jacobian, now, rcond=None)[0]
            x = x + np.clip(step, [-0.05, -0.1, -0.1], [0.05, 0.1, 0.1])
            x[2] = min(max(x[2], 0.0), 1.0)
        respond(x)
        return {"alpha": x[0], "command": x[1], "throttle": x[2], "offset": x[1] - self.surface(fdm)}


def fly(plane, at, trim, record, free):
    """One run; alpha, q and az as the aircraft's sensors log them, (3, samples)."""
    steps = record["steps"]
    fdm = plane.open(record["dt_s"] / steps)
    command = record["elevator_rad"] + free[2] + trim["offset"]
    plane.start(fdm, at, free[0], free[1], command[0], trim["throttle"])
    names = ("aero/alpha-rad", "velocities/q-rad_sec", "forces/fbz-total-lbs", "accelerations/qdot-rad_sec2")
    mass = fdm["inertia/mass-slugs"]
    rows = [[fdm[n] for n in names]]
    for c, v in zip(command[1:], record["airspeed_m_s"][1:] / FT, strict=True):
        fdm[plane.elevator["command"]] = c * plane.elevator["command_per_rad"]
        level = math.sqrt(max(v * v - fdm["velocities/v-down-fps"] ** 2, 0.0))
        fdm["atmosphere/gust-north-fps"] = fdm["velocities/v-north-fps"] - level
        fdm.run()
        rows.append([fdm[n] for n in names])
    alpha, q, force, q_dot = np.array(rows).T
    az = force / mass * FT
    alpha = alpha - q * quantity(plane.sensors, "alpha_rad", "x", 0.0) / record["airspeed_m_s"]
    x, z = (quantity(plane.sensors, "az_m_s2", n, 0.0) for n in ("x", "z"))
    az = az - q_dot * x - q * q * z
    logged = zip(CHANNELS, (alpha, q, az), strict=True)
    return np.stack([sensed(plane.sensors, n, y, record["dt_s"] / steps)[::steps] for n, y in logged])


def sensed(sensors, channel, y, step):
    """Lag, delay and scale of a sensor."""
    lag, delay, scale = (
        quantity(sensors, channel, n, d) for n, d in (("lag", 0.0), ("delay", 0.0), ("scale", 1.0))
    )
    if lag > 0.0:
        r = step / lag
        decay, mean = math.exp(-r), -math.expm1(-r) / r
        out = y.copy()
        for k in range(1, len(y)):
            out[k] = decay * out[k - 1] + (mean - decay) * y[k - 1] + (1.0 - mean) * y[k]
        y = out
    if delay > 0.0:
        index = np.arange(len(y))
        y = np.interp(index - delay / step, index, y)
    return scale * y


def replay(plane, record):
    """Residuals (3, samples) of one run, what is free of it fitted."""
    at = record["condition"]
    trim = plane.trim(at)
    measured = record["measured"]
    weight = measured.std(axis=1, keepdims=True)
    offset = trim["command"] - trim["offset"] - record["elevator_rad"][: 5 * record["steps"]].mean()
    free = np.array([measured[0, :5].mean(), measured[1, :5].mean(), offset])
    flown = fly(plane, at, trim, record, free)
    h = np.array([2e-3, 1e-2, 5e-4])
    tangents = [(fly(plane, at, trim, record, free + h * e) - flown) / h[i] for i, e in enumerate(np.eye(3))]
    centred = np.stack([((t - t.mean(axis=1, keepdims=True)) / weight).ravel() for t in tangents], axis=1)

    def residual(y):
        return measured - y - (measured - y).mean(axis=1, keepdims=True)

    best = residual(flown)
    for _ in range(2):
        trial = free + np.linalg.lstsq(centred, (best / weight).ravel(), rcond=None)[0]
        after = residual(fly(plane, at, trim, record, trial))
        if ((after / weight) ** 2).sum() >= ((best / weight) ** 2).sum():
            break
        free, best = trial, after
    return best


def records(paths, wanted, plane):
    """Runs of logs, inputs on the simulation's grid as they were before their sensors."""
    for path in paths:
        table = pq.read_table(path).to_pandas()
        for run_id, rows in table.groupby("run_id", sort=False):
            if wanted and run_id not in wanted:
                continue
            dt = float((rows["t_s"].iloc[-1] - rows["t_s"].iloc[0]) / (len(rows) - 1))
            steps = math.ceil(dt / STEP_S - 1e-9)
            grid = np.arange((len(rows) - 1) * steps + 1) / steps
            inputs = {}
            for name in ("elevator_rad", "airspeed_m_s"):
                late = sum(quantity(plane.sensors, name, n, 0.0) for n in ("delay", "lag")) / dt
                y = rows[name].to_numpy(float)
                y = smooth(y, dt) if name == "airspeed_m_s" else y
                y = np.interp(grid + late, np.arange(len(y)), y)
                y = y - quantity(plane.sensors, name, "bias", 0.0)
                y = y / quantity(plane.sensors, name, "scale", 1.0)
                slope = quantity(plane.sensors, name, "alpha_slope", 0.0)
                alpha = rows["alpha_rad"].to_numpy(float)
                inputs[name] = y / (
                    1.0 + slope * (np.interp(grid, np.arange(len(alpha)), alpha) - alpha.mean())
                )
            density = float(rows["density_kg_m3"].mean())
            eas = float(inputs["airspeed_m_s"].mean()) * math.sqrt(density / 1.225)
            yield (
                run_id,
                inputs
                | {
                    "dt_s": dt,
                    "steps": steps,
                    "measured": rows[list(CHANNELS)].to_numpy(float).T,
                    "condition": {"eas_m_s": eas, "altitude_m": float(rows["altitude_m"].mean())},
                },
            )


def smooth(y, dt, cutoff_hz=5.0):
    """Gaussian low-pass: the noise of the airspeed is no motion of the air."""
    width = 1.0 / (2.0 * math.pi * cutoff_hz * dt) * math.sqrt(math.log(2.0))
    reach = math.ceil(4.0 * width)
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    return np.convolve(np.pad(y, reach, mode="edge"), kernel / kernel.sum(), mode="valid")


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("aircraft", type=Path, help="folder with aircraft.toml and its JSBSim model")
    parser.add_argument("logs", type=Path, nargs="+", help="flight logs (Parquet)")
    parser.add_argument("--run", action="append", help="run_id, may be repeated; default all")
    parser.add_argument("--json", action="store_true", help="print JSON")
    told = parser.parse_args()
    plane = Aircraft(told.aircraft)
    squares = {
        run: (replay(plane, record) ** 2).mean(axis=1) for run, record in records(told.logs, told.run, plane)
    }
    if not squares:
        raise SystemExit("no such run in these logs")
    rms = dict(zip(CHANNELS, np.sqrt(np.mean(list(squares.values()), axis=0)).tolist(), strict=True))
    if told.json:
        print(json.dumps({"runs": list(squares), "rms": rms}))
    else:
        print(f"{len(squares)} runs: " + ", ".join(f"{n} {v:.5g}" for n, v in rms.items()))


if __name__ == "__main__":
    main()
