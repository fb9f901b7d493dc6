"""Omnibus tests of lateral-directional records in which nothing is missing: are their statistics chi-square?

Each trial is a flight of `validation.lateral_truth` without an effect. The declared aircraft is fitted, and every omnibus test of
`airtruth.tracing.anomalies` is made. Under the null hypothesis the sum of the statistics over that of their degrees is one.

    python -m studies.null_statistics --seed S [--count N] [--gust LEVEL] [--exact]

``--exact`` takes the measured surfaces for exact, as `airtruth.tracing.model.surface_noise` does where their noise is negligible.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from airtruth import aircraft
from airtruth.tracing import TraceOptions
from airtruth.tracing.anomalies.omnibus import anomalies
from airtruth.tracing.inference.optimise import fit, initial_parameters
from airtruth.tracing.inference.whitening import autoregression
from airtruth.tracing.model.records import TraceRecord
from airtruth.tracing.prepare import prepare
from validation.lateral_declared import lateral_aircraft
from validation.lateral_truth import log_of, trial


def exact(record: TraceRecord) -> TraceRecord:
    """The record with surfaces without noise."""
    signals = record.signals
    return replace(record, signals=replace(signals, surface_noise_rad2=signals.surface_noise_rad2[:, :0]))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, required=True, help="of the first trial; the others follow")
    parser.add_argument("--count", type=int, default=25)
    parser.add_argument("--gust", type=float, default=0.0, help="0 is calm air, 1 light turbulence")
    parser.add_argument("--exact", action="store_true", help="surfaces without noise")
    chosen = parser.parse_args()
    found: dict[str, list[tuple[float, int]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        declared = aircraft.load(lateral_aircraft(Path(folder) / "declared"))
        for seed in range(chosen.seed, chosen.seed + chosen.count):
            hidden = trial("lateral-none", seed, gust=chosen.gust)
            case = prepare([log_of(*hidden.flights)], declared, [], TraceOptions(motion="lateral"))
            problem = case.fitted
            if chosen.exact:
                problem = replace(problem, records=tuple(exact(r) for r in problem.records))
            null = fit(problem, case.hypothesis, initial_parameters(problem, case.hypothesis))
            assert null is not None
            for test in anomalies(null, problem, autoregression(null.innovations))[
                :-1
            ]:  # the last is of the spectrum
                found.setdefault(test.null, []).append((test.statistic, test.degrees))
            print(f"{seed}", flush=True)
    for name, pairs in {**found, "all": [p for own in found.values() for p in own]}.items():
        statistics, degrees = np.sum(pairs, axis=0)
        print(f"{name:62} {statistics / degrees:.3f} +- {np.sqrt(2.0 / degrees):.3f}")


if __name__ == "__main__":
    main()
