"""How well `airtruth check` finds errors of lateral instruments: simulated records with none, one or two errors.

    python -m studies.lateral_check_study [--records 300] [--seed 1]

The flights are those of `validation.lateral_truth`, four records of aileron 1-2-1 and rudder 3-2-1-1 each, in calm and moving
air. Printed: the share of answers that name an error that is absent, and of 95 % intervals that hold the truth.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from airtruth.checks.kinematics_lateral import check_lateral
from airtruth.checks.kinematics_side import ERRORS
from airtruth.checks.result import CheckResult
from validation.lateral_truth import Flight, log_of, record_pair, with_effect

SIZES = {
    "vane_arm:beta_rad": (0.4, 1.2),
    "vane_lag:beta_rad": (0.05, 0.15),
    "vane_scale:beta_rad": (1.06, 1.2),
    "gyro_scale:p_rad_s": (1.04, 1.12),
    "gyro_scale:r_rad_s": (1.04, 1.12),
    "gyro_lag:p_rad_s": (0.03, 0.1),
    "sensor_delay:beta_rad": (0.05, 0.15),
    "sensor_delay:phi_rad": (0.03, 0.12),
}
"""Errors that are drawn, from the smallest to the largest size [SI]."""
TRUE_BIASES = {"gyro_bias:p_rad_s": np.radians(-0.0057), "gyro_bias:r_rad_s": np.radians(-0.0286 + 0.0)}
"""Biases of the sensors of `validation.lateral_truth`; that of psi is a constant, and leaves no ramp."""


def flown(number: int, seed: int) -> tuple[dict[str, float], float, list[Flight]]:
    """Errors, gust level and flights of one log: by turns none, one and two errors, and calm and moving air."""
    rng = np.random.default_rng([seed, number])
    gust = float((0.0, 0.5, 1.0)[number // 3 % 3])
    flights = [*record_pair(gust=gust, seed=4 * number), *record_pair(gust=gust, seed=4 * number + 2)]
    names = list(rng.choice(list(SIZES), size=number % 3, replace=False))
    errors = {str(name): float(rng.uniform(*SIZES[name])) for name in names}
    for name, size in errors.items():
        flights = [with_effect(flight, name, size) for flight in flights]
    return errors, gust, flights


def false_causes(result: CheckResult, errors: dict[str, float]) -> list[str]:
    """Errors that are said to be present and are not; a pair that is said to be one holds no false cause."""
    return [
        f.name for f in result.findings if f.state == "present" and f.name in ERRORS and f.name not in errors
    ]


def covered(result: CheckResult, errors: dict[str, float]) -> Iterator[tuple[str, bool]]:
    """Whether intervals hold the truth, of the errors that are shown, and of the biases.

    The interval of a possible cause is that of its size if it is the cause, and counts only then.
    """
    for finding in result.findings:
        if finding.name in ERRORS and (finding.state == "not needed" or finding.name in errors):
            truth = errors.get(finding.name, ERRORS[finding.name].neutral)
            yield finding.state, bool(finding.lower - 1e-12 <= truth <= finding.upper + 1e-12)
        elif finding.name in TRUE_BIASES:
            yield "bias", bool(finding.lower <= TRUE_BIASES[finding.name] <= finding.upper)


def best_covers(result: CheckResult, errors: dict[str, float]) -> list[bool]:
    """Whether the intervals of the set of the very errors hold them."""
    own = [c for c in result.causes if {f.name for f in c.errors} == set(errors)]
    return [f.lower <= errors[f.name] <= f.upper for c in own[:1] for f in c.errors]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    wrong, missed, excluded, small = 0, 0, 0, []
    hits: dict[str, list[bool]] = {}
    for number in range(arguments.first, arguments.first + arguments.records):
        errors, gust, flights = flown(number, arguments.seed)
        result = check_lateral([log_of(*flights)], None, flights[0].plane.span)
        absent = false_causes(result, errors)
        wrong += bool(absent)
        named = {f.name for f in result.findings if f.state in ("present", "one of")}
        missed += len(set(errors) - named)
        possible = {c.name for c in result.possible}
        excluded += " + ".join(sorted(errors)) not in possible and bool(errors)
        small.append(result.p_value < 0.05)
        for state, inside in covered(result, errors):
            hits.setdefault(state, []).append(inside)
        hits.setdefault("set of the very errors", []).extend(best_covers(result, errors))
        print(number, gust, errors, sorted(possible)[:6], absent, f"p {result.p_value:.3f}", flush=True)
    print(
        f"false causes in {wrong} of {arguments.records} logs; errors missed: {missed}; true set not possible: {excluded}"
    )
    print(f"p below 0.05 in {np.mean(small):.1%}")
    for state, inside in hits.items():
        print(f"{state}: {np.mean(inside):.1%} of {len(inside)} intervals hold the truth")


if __name__ == "__main__":
    main()
