"""Are the intervals of `identify` true on the small aircraft of `validation.small_aircraft`?

    python -m studies.small_aircraft_intervals --seed 600 --flights 8 --method filter-error [--pressure measured]

Each flight has six records of the declared aircraft. The table has the root mean square of the errors, the same over their
standard deviations, and the share of the 95 % intervals that contain the truth. It separates records whose dynamic pressure
changes by more than `CHANGES` of its mean from the others. --quiet-inputs flies without noise of surface and airspeed.
--without-attitude leaves theta out, so that gravity across the path is constant.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from airtruth.identification import Options, identify
from airtruth.identification.condition import pressure_range
from airtruth.identification.doubts import CHANGES
from airtruth.logs.flight_log import batches
from validation import small_aircraft

TRUTH: Final = {
    **dict(zip(("CLalpha", "CLq", "CLde"), small_aircraft.LIFT[1:], strict=True)),
    **dict(zip(("Cmalpha", "Cmq", "Cmde"), small_aircraft.MOMENT[1:], strict=True)),
}
"""True derivatives [1/rad, rates as q c/(2V)]."""
QUIET: Final = {"elevator_rad": 1e-6, "airspeed_m_s": 1e-3}
"""Noise of surface [rad] and airspeed [m/s] with --quiet-inputs."""


def main(argv: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=600, help="of the first flight")
    parser.add_argument("--flights", type=int, default=8)
    parser.add_argument("--gust", type=float, default=0.0, help="vertical gust [m/s]")
    parser.add_argument("--method", action="append", required=True)
    parser.add_argument("--pressure", default="method")
    parser.add_argument("--quiet-inputs", action="store_true")
    parser.add_argument("--without-attitude", action="store_true")
    chosen = parser.parse_args(argv)
    noise = {**small_aircraft.NOISE, **(QUIET if chosen.quiet_inputs else {})}
    errors: dict[tuple[str, str], list[tuple[float, float]]] = {}
    changing: list[bool] = []
    with tempfile.TemporaryDirectory() as folder:
        plane = small_aircraft.declared(Path(folder))
        for seed in range(chosen.seed, chosen.seed + chosen.flights):
            log = small_aircraft.flight_log(seed, chosen.gust, stds=noise)
            if chosen.without_attitude:
                kept = {name: x for name, x in log.channels.items() if name != "theta_rad"}
                log = replace(log, channels=kept)
            (batch,) = batches(log)
            changing += (pressure_range(batch) > CHANGES).tolist()
            frame = identify(log, plane, chosen.method, Options(pressure=chosen.pressure)).to_frame()
            for name, rows in frame.groupby("method"):
                for derivative, true in TRUTH.items():
                    pairs = zip(rows[derivative] - true, rows[f"{derivative}_std"], strict=True)
                    errors.setdefault((str(name), derivative), []).extend(pairs)
    print(f"{'method':14} {'derivative':10} {'records':>26} {'rms error':>10} {'over std':>9} {'inside':>7}")
    some = np.array(changing)
    groups = {"all": np.ones_like(some), "pressure steady": ~some, "pressure changes": some}
    for (name, derivative), pairs in errors.items():
        error, std = np.array(pairs).T
        for words, rows in groups.items():
            if rows.any():
                z = error[rows] / std[rows]
                rms, relative, inside = (
                    np.sqrt(np.mean(error[rows] ** 2)),
                    np.sqrt(np.mean(z**2)),
                    np.mean(np.abs(z) < 1.96),
                )
                count = f"{words} ({rows.sum()})"
                print(f"{name:14} {derivative:10} {count:>26} {rms:10.4f} {relative:9.2f} {inside:7.2f}")


if __name__ == "__main__":
    main()
