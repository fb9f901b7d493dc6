"""Campaigns flown, degraded and exported like real flights, through the commands of the README without hand work.

    python -m studies.real_rows [--rows NAME...] [--out DIR] [--no-trace]

Each row is a campaign of the GTM with one difficulty of a real file: 10 Hz, an airspeed that drifts, a slow vane, a
delayed elevator, two recorders with clocks of their own. The commands are import --guess, import, check, identify and
trace with the whole library. The verdict of the trace is printed beside the truth.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat
from typer.testing import CliRunner

from airtruth.cli import app
from airtruth.logs.flight_log import FlightLog
from airtruth.logs.store import iter_logs
from airtruth.simulation.campaign import run as campaign
from airtruth.units import DEG, FT, G0, KT
from validation import recorders
from validation.recorders import Topic

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

CAMPAIGN: Final = """schema = 1
name = "row"
title = "A real flight's difficulty"
aircraft = "gtm"
runs = {runs}
seed = {seed}
duration_s = {duration_s}
log_hz = {log_hz}
[condition]
eas_kt = 75.0
altitude_ft = 7000.0
[[manoeuvre]]
kind = "3211"
amplitude_deg = {amplitude_deg}
start_s = 1.5
step_s = 0.35
[gust]
figures = "gtm"
level = "light"
factor = 0.15
{effect}
"""
"""Campaign of a row."""
EFFECT: Final = '[[effect]]\nname = "{}"\n{} = {}\n'
"""Effect of a campaign."""


@dataclass(frozen=True)
class Row:
    """A campaign and its export.

    Attributes
    ----------
    truth : name of the effect that is flown, "" for none.
    write : columns of a record, its name, folder -> its files, one for each recorder.
    effect : text of the effect in the campaign file.
    duration_s, log_hz, amplitude_deg : of the campaign.
    """

    truth: str
    write: Callable[[Columns, str, Path], list[Path]]
    effect: str = ""
    duration_s: float = 10.0
    log_hz: int = 50
    amplitude_deg: float = 1.5


def _table(c: Columns, name: str, folder: Path) -> list[Path]:
    """CSV with units in brackets, load factor positive up, elevator trailing edge up."""
    columns = {
        "Time [ms]": c["t_s"] * 1000.0 + 36000.0,
        "VTAS [kts]": c["airspeed_m_s"] / KT,
        "AoA1 [deg]": c["alpha_rad"] / DEG,
        "THETA_D": c["theta_rad"] / DEG,
        "Pitch rate (deg/s)": c["q_rad_s"] / DEG,
        "Ax [g]": c["ax_m_s2"] / G0,
        "Nz [g]": -c["az_m_s2"] / G0,
        "STAB POS (deg TEU)": -c["elevator_rad"] / DEG,
        "Hp [ft]": c["altitude_m"] / FT,
        "rho": 0.0 * c["t_s"],
    }
    rows = [",".join(f"{x:.9g}" for x in row) for row in zip(*columns.values(), strict=True)]
    path = folder / f"{name}.csv"
    path.write_text("\n".join([",".join(columns), *rows]) + "\n")
    return [path]


def _matrix(c: Columns, name: str, folder: Path) -> list[Path]:
    """A .mat file whose labels occur twice and are longer than its matrix; time in single precision."""
    t = (c["t_s"] + 4000.0).astype(np.float32).astype(np.float64)
    values = [t, c["airspeed_m_s"] / FT, c["alpha_rad"] / DEG, c["theta_rad"] / DEG, c["q_rad_s"] / DEG]
    values += [c["ax_m_s2"] / G0, c["az_m_s2"] / G0, c["elevator_rad"] / DEG, c["altitude_m"] / FT]
    labels = [
        "time (sec)",
        "V (ft/sec)",
        "alpha (deg)",
        "theta (deg)",
        "q (deg/sec)",
        "ax (g)",
        "az (g)",
        "de (deg)",
    ]
    cells = np.array([*labels, "h (ft)", "beta (deg)", "phi (deg)"], dtype=object)
    path = folder / f"{name}.mat"
    savemat(path, {"fdata": np.column_stack(values), "varlab": cells, "varlab_copy": cells})
    return [path]


def _topics(c: Columns) -> tuple[Topic, Topic]:
    units = {"GyrY": "deg/s", "AccX": "m/s/s", "AccZ": "m/s/s", "Pitch": "deg", "Elev": "deg"}
    units |= {"TAS": "m/s", "AOA": "deg", "Alt": "m"}
    inertial = {"GyrY": c["q_rad_s"] / DEG, "AccX": c["ax_m_s2"], "AccZ": c["az_m_s2"]}
    inertial |= {"Pitch": c["theta_rad"] / DEG, "Elev": c["elevator_rad"] / DEG}
    air = {"TAS": c["airspeed_m_s"], "AOA": c["alpha_rad"] / DEG, "Alt": c["altitude_m"]}
    return Topic("NAVX", c["t_s"] + 20.0, inertial, units), Topic("AIR", c["t_s"] + 20.0, air, units)


def _mdf(c: Columns, name: str, folder: Path) -> list[Path]:
    """MDF4 with two channel groups that share their times."""
    path = folder / f"{name}.mf4"
    recorders.mdf4(path, _topics(c))
    return [path]


def _two(c: Columns, name: str, folder: Path) -> list[Path]:
    """An autopilot's DataFlash log, and air data in CSV with another clock that read the pitch rate too."""
    inertial, _ = _topics(c)
    (folder / f"{name}.bin").write_bytes(recorders.dataflash([inertial]))
    columns = {
        "t (s)": c["t_s"] + 700.125,
        "TAS (m/s)": c["airspeed_m_s"],
        "alpha (deg)": c["alpha_rad"] / DEG,
        "alt (m)": c["altitude_m"],
        "q (deg/s)": c["q_rad_s"] / DEG,
    }
    rows = [",".join(f"{x:.9g}" for x in row) for row in zip(*columns.values(), strict=True)]
    (folder / f"{name}.csv").write_text("\n".join([",".join(columns), *rows]) + "\n")
    return [folder / f"{name}.bin", folder / f"{name}.csv"]


ROWS: Final[Mapping[str, Row]] = {
    "coarse": Row("", _table, log_hz=10, duration_s=12.0),
    "drift": Row("", _table, duration_s=20.0, amplitude_deg=3.0),
    "vane": Row("vane_lag", _matrix, EFFECT.format("vane_lag", "tau_s", 0.2)),
    "elevon": Row("elevator_delay", _mdf, EFFECT.format("elevator_delay", "delay_s", 0.09)),
    "two": Row("vane_lag", _two, EFFECT.format("vane_lag", "tau_s", 0.17)),
}
"""Name of a row -> campaign and export."""


def exported(row: Row, folder: Path, runs: int = 4, seed: int = 11) -> list[list[Path]]:
    """Files of each record of a row."""
    text = CAMPAIGN.format(
        runs=runs, seed=seed, duration_s=row.duration_s, log_hz=row.log_hz, amplitude_deg=row.amplitude_deg, effect=row.effect
    )  # fmt: skip
    (folder / "row.toml").write_text(text)
    campaign.fly(folder / "row.toml", folder / "flown")
    log = FlightLog.concat(list(iter_logs(folder / "flown")))
    records = []
    for number in range(runs):
        rows = log.rows(number)
        columns = {"t_s": log.t_s[rows], **{name: values[rows] for name, values in log.channels.items()}}
        records.append(row.write(columns, f"tp{number + 1}", folder))
    return records


def run(*arguments: object) -> str:
    """Output of a command of airtruth in this process.

    Raises
    ------
    RuntimeError
        If it fails.
    """
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    if done.exit_code:
        raise RuntimeError(f"airtruth {' '.join(map(str, arguments))}: {done.exception or done.output}")
    return done.stdout


def imported(records: Sequence[Sequence[Path]], folder: Path) -> Path:
    """Logs of a row by the commands: a guess for each recorder, then one import, or one for each merged record."""
    mappings = []
    for number, file in enumerate(records[0]):
        mappings.append(folder / f"map{number}.toml")
        mappings[-1].write_text(run("import", "--guess", file))
    stated = [word for mapping in mappings for word in ("--mapping", mapping)]
    logs = folder / "logs"
    logs.mkdir()
    if len(mappings) == 1:
        run("import", *(files[0] for files in records), *stated, "--out", logs / "all.parquet", "--quiet")
        return logs
    for number, files in enumerate(records, start=1):
        run("import", *files, *stated, "--out", logs / f"tp{number}.parquet", "--quiet")
    return logs


def traced(logs: Path, folder: Path, *options: object) -> Mapping[str, object]:
    """Answer of the trace (contract 3)."""
    text = run("trace", logs, "--aircraft", "gtm", "--out", folder / "traced", "--json", "--quiet", *options)
    answer: Mapping[str, object] = json.loads(text)
    return answer


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", nargs="+", default=list(ROWS), choices=list(ROWS))
    parser.add_argument("--no-trace", action="store_true")
    options = parser.parse_args()
    for name in options.rows:
        row = ROWS[name]
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            logs = imported(exported(row, folder), folder)
            run("check", logs, "--aircraft", "gtm", "--quiet")
            run("identify", logs, "--aircraft", "gtm", "--quiet")
            print(f"{name}: imported, checked, identified", flush=True)
            if options.no_trace:
                continue
            answer = traced(logs, folder)
        effects = [
            {k: e[k] for k in ("name", "parameters", "indistinguishable_from")}  # type: ignore[index]
            for e in answer["effects"]  # type: ignore[attr-defined]
        ]
        print(
            f"{name}: truth {row.truth or 'none'}; {answer['verdict']}, provisional {answer['provisional']}: {effects}",
            flush=True,
        )


if __name__ == "__main__":
    main()
