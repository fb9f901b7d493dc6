"""Aircraft of the JSBSim package in calm air: each lateral derivative that records determine beside its linearisation.

The first lateral campaign of each aircraft (`studies.foreign_lateral`), doublets of aileron and rudder in both signs, is flown in
calm air with ideal sensors, once more with a fifth of the amplitude, and with the noise of aircraft.toml. A derivative counts as
determined where its standard deviation from six noisy records is at most 3 %. The error is that of least squares with
instruments (`iv-lowpass`) from both ideal records. Where it exceeds 3 %, experiments follow: the small amplitude, products with
alpha and beta |beta|, the bank angle as a further signal, and the slopes on each side of the trim. For an error in Cnr, the
yawing moment of the propellers is regressed on the rates: in a flight their speed lags, in the linearisation it is settled.
Folders are kept: a second call flies what is missing.

    python -m studies.foreign_lateral_calm --out out/lateral-fleet [--aircraft NAME...]
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airtruth.aircraft import load
from airtruth.errors import AirtruthError
from airtruth.identification import Options, identify_joint
from airtruth.identification.lateral.observation import observe
from airtruth.identification.lateral.problems import rate_of, with_corners
from airtruth.identification.record_constants import values_of
from airtruth.logs.flight_log import Batch, batches
from airtruth.logs.sources import log_files
from airtruth.logs.store import read_log, read_table
from airtruth.numerics.prefilter import butterworth, zero_phase
from airtruth.physics.motion import LATERAL
from airtruth.simulation.campaign import plan
from airtruth.simulation.campaign import run as campaign
from airtruth.simulation.foreign_aircraft import LATERAL_CAMPAIGN, new_from_jsbsim
from airtruth.simulation.simulator import Executive
from airtruth.simulation.trim import trim
from airtruth.table import as_markdown, flat
from airtruth.units import DEG, FT

Array = NDArray[np.float64]

AIRCRAFT = (
    *("737", "A320", "MD11", "B747", "787-8", "global5000", "c172p", "c172r", "c182", "c310", "pa28", "pc7"),
    *("DHC6", "C130", "L410", "OV10", "T37", "T38", "A4", "F4N", "F80C", "f15", "f16", "f104"),
)
"""The 24 aircraft of the latest test of `studies.foreign_fleet`."""
KINDS = {"ideal": (1.0, True), "small": (0.2, True), "noise": (1.0, False)}
"""Kind of a flight -> share of the amplitude, whether the sensors are ideal."""
BAR = 0.03
"""Largest relative error, and largest relative standard deviation of a determined derivative [-]."""
METHOD = "iv-lowpass"
RATE_HZ = 200.0
STICKS = {"fcs/aileron-cmd-norm": 0.5, "fcs/rudder-cmd-norm": 4.0}
"""Commands of the flight with propellers, and the starts of their doublets [s]."""
STICK, DOUBLET_S = 0.1, 0.5
"""Amplitude [-] and half of the length [s] of these doublets."""
EXPERIMENTS = ("ideal sensors", "a fifth of the amplitude", "`--term alpha --term beta`", "bank as a signal")
NAMES = LATERAL.parameters
ROWS = tuple(derivative.row for derivative in LATERAL.derivatives)
"""Number of the coefficient of each derivative."""


@dataclass(frozen=True)
class Flown:
    """Flights of one kind.

    Attributes
    ----------
    records : the two records.
    central, plus, minus : (15,) linearisation, and that of each side of the trim.
    """

    records: Sequence[Batch]
    central: Array
    plus: Array
    minus: Array


@dataclass(frozen=True)
class Compared:
    """An aircraft.

    Attributes
    ----------
    truth : (15,) linearisation.
    determined : (15,) whether the records determine a derivative.
    error : (experiments, 15) relative error [-], in the order of `EXPERIMENTS`.
    sides : (15,) half of the difference of the one-sided slopes over the central one [-].
    """

    truth: Array
    determined: NDArray[np.bool_]
    error: Array
    sides: Array

    @property
    def missed(self) -> NDArray[np.intp]:
        """Determined derivatives whose error exceeds the bar."""
        return np.flatnonzero(self.determined & (np.abs(self.error[0]) > BAR))


def flown(folder: Path, kind: str, out: Path) -> Flown:
    """Fly two records of an aircraft unless that was done.

    Raises
    ------
    AirtruthError
        If the aircraft has no lateral campaign or a run fails.
    """
    share, ideal = KINDS[kind]
    if not (folder / LATERAL_CAMPAIGN).exists():
        raise AirtruthError(f"{folder.name}: the survey found no lateral campaign")
    text = (
        (folder / LATERAL_CAMPAIGN)
        .read_text(encoding="utf-8")
        .split("[gust]")[0]
        .replace("runs = 6", "runs = 2")
    )
    text = re.sub(r"amplitude_deg = (-?[\d.]+)", lambda m: f"amplitude_deg = {share * float(m[1]):g}", text)
    file, logs = folder / f"calm-{kind}.toml", out / f"{folder.name}-{kind}"
    if not (logs / "truth.parquet").exists():
        file.write_text(text + ("\n[sensors]\nideal = true\n" if ideal else ""), encoding="utf-8")
        failures = campaign.fly(plan.make(file), logs).failures
        if failures:
            raise AirtruthError(f"{folder.name}: {failures[0].reason}")
    row = read_table(logs / "truth.parquet").iloc[0]
    central, plus, minus = (
        row[[f"{name}{side}" for name in NAMES]].to_numpy(float) for side in ("", "_plus", "_minus")
    )
    return Flown([b for path in log_files(logs) for b in batches(read_log(path))], central, plus, minus)


def with_bank(records: Sequence[Batch], constants) -> Array:
    """(15,) least squares with the bank angle as a sixth signal of each coefficient."""
    options = Options()
    left, right = [], []
    for number, record in enumerate(records):
        o = observe(record, constants, options)
        sos = butterworth(options.cutoff_of(o.dt_s), options.order, o.dt_s)
        inside = slice(2, -2)
        bank = record.channels["phi_rad"][0]
        free = np.zeros((len(records), bank.size))
        free[number] = 1.0
        signals = np.vstack([with_corners(o)[0], bank - bank[0]])
        left.append(np.vstack([zero_phase(signals, sos), free])[:, inside])
        right.append((rate_of(zero_phase(o.slopes, sos), o.dt_s) + zero_phase(o.added, sos)[..., inside])[0])
    theta: Array = np.linalg.lstsq(np.hstack(left).T, np.hstack(right).T, rcond=None)[0]
    return theta[: len(LATERAL.signals)].T.ravel()


def propellers(folder: Path) -> tuple[float, float]:
    """Derivative of the propellers' yawing moment by r b/(2V) [-]: in a flight of 10 s with doublets, and settled."""
    planned = plan.make(folder / "calm-ideal.toml")
    aircraft = planned.aircraft
    at = trim(aircraft, plan.planned_runs(planned.table.head(1))[0].condition)
    executive = Executive(aircraft, 1.0 / RATE_HZ)
    span_ft, half = aircraft.constants.span_m / FT, aircraft.constants.span_m / (2.0 * at.airspeed_m_s)
    area = aircraft.constants.wing_area_m2 / FT**2

    def row(fdm) -> list[float]:
        rates = [half * fdm[f"velocities/{n}-rad_sec"] for n in "pr"]
        return [
            fdm["moments/n-prop-lbsft"] / (fdm["aero/qbar-psf"] * area * span_ft),
            fdm["aero/beta-rad"],
            *rates,
        ]

    settled = []
    for side in (-1.0, 1.0):
        one = executive.again()
        one.initialise(at.condition, at.controls.moved({}, r_rad_s=side * DEG))
        one.respond()
        settled.append(row(one.fdm))
    change = np.subtract(settled[1], settled[0])
    executive.initialise(at.condition, at.controls)
    fdm, rows = executive.fdm, []
    trims = {name: fdm[name] for name in STICKS}
    for k in range(round(10.0 * RATE_HZ)):
        for name, start in STICKS.items():
            phase = (k / RATE_HZ - start) / DOUBLET_S
            fdm[name] = trims[name] + (STICK if 0.0 <= phase < 1.0 else -STICK if 1.0 <= phase < 2.0 else 0.0)
        fdm.run()
        rows.append(row(fdm))
    table = np.array(rows)
    x = np.column_stack([table[:, 1:], np.ones(len(table))])
    return float(np.linalg.lstsq(x, table[:, 0], rcond=None)[0][2]), float(change[0] / change[3])


def compared(name: str, out: Path) -> Compared:
    """Survey an aircraft unless that was done, fly it and compare.

    Raises
    ------
    AirtruthError
        If the aircraft cannot be surveyed or flown.
    """
    folder = out / "aircraft" / name
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        new_from_jsbsim(name, folder)
    aircraft = load(folder)
    ideal, small, noisy = (flown(folder, kind, out / "calm") for kind in KINDS)
    truth = ideal.central

    def estimated(records: Sequence[Batch], method: str = METHOD, terms: tuple[str, ...] = ()):
        return identify_joint(records, aircraft, method, Options(terms=terms), LATERAL)

    made = estimated(noisy.records, "filter-error")
    std = np.sqrt(np.diagonal(made.covariance[0]) / 3.0)  # six records instead of two
    theta = (
        estimated(ideal.records).theta[0],
        estimated(small.records).theta[0],
        estimated(ideal.records, terms=("alpha", "beta")).theta[0],
        with_bank(ideal.records, values_of(aircraft, LATERAL)),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.stack(theta) / truth - 1.0
        sides = 0.5 * (ideal.plus - ideal.minus) / truth
    return Compared(truth, bool(made.converged[0]) & (std <= BAR * np.abs(truth)), error, sides)


def summary(name: str, c: Compared) -> tuple[str, ...]:
    """Line of the first table."""
    error = np.where(c.determined, np.abs(c.error[0]), 0.0)
    worst = int(error.argmax())
    unused = " ".join(n for n, known in zip(NAMES, c.determined, strict=True) if not known)
    cells = (f"{c.determined.sum()}", f"{(error <= BAR).sum() - (~c.determined).sum()}")
    return (name, *cells, f"{NAMES[worst]} {100.0 * c.error[0][worst]:+.1f}", unused)


def experiments(name: str, c: Compared) -> Iterator[tuple[str, ...]]:
    """Lines of the second table: derivatives beyond the bar."""
    for i in c.missed:
        broken = [
            f"{NAMES[j]} {100.0 * c.sides[j]:+.0f}"
            for j in range(len(NAMES))
            if ROWS[j] == ROWS[i] and abs(c.sides[j]) > BAR and c.truth[j] != 0.0
        ]
        yield (name, NAMES[i], *(f"{100.0 * e[i]:+.1f}" for e in c.error), ", ".join(broken) or "none")


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--aircraft", nargs="+", default=AIRCRAFT)
    options = parser.parse_args()
    first, second, third = [], [], []
    for name in options.aircraft:
        try:
            made = compared(name, options.out)
        except AirtruthError as error:
            first.append((name, "", "", str(error), ""))
            continue
        first.append(summary(name, made))
        second += experiments(name, made)
        if LATERAL.index("Cnr") in made.missed:
            slopes = propellers(options.out / "aircraft" / name)
            cnr = made.truth[LATERAL.index("Cnr")]
            third.append(
                (
                    name,
                    f"{cnr:.4f}",
                    *(f"{x:.4f}" for x in slopes),
                    f"{100.0 * (slopes[0] - slopes[1]) / cnr:+.1f}",
                )
            )
        print(*first[-1], sep=", ", flush=True)
    columns = ("aircraft", "determined", "within 3 %", "largest error [%]", "not determined")
    print("\n" + as_markdown(flat("Calm air, ideal sensors", columns, first)))
    columns = (
        "aircraft",
        "derivative",
        *(f"{x}: error [%]" for x in EXPERIMENTS),
        "slopes of the coefficient that break at the trim [%]",
    )
    print(as_markdown(flat("Errors beyond 3 %", columns, second)))
    columns = ("aircraft", "Cnr", "share of the propellers, flight", "settled", "difference over Cnr [%]")
    print(as_markdown(flat("Propellers", columns, third)))


if __name__ == "__main__":
    main()
