"""How often the gate refuses flights of damaged aircraft, which no log of theirs deserves. Prints counts by mode.

python -m studies.gate_refusals --flights 300 --seed 51501
"""

from __future__ import annotations

import argparse
from typing import Final

from airtruth import aircraft
from airtruth.checks.gate import inspect
from validation.blind import draw
from validation.blind.flight import LeftRangeError

MODES: Final = ("composite", "derivative")
"""Modes of the blind trials whose aircraft are damaged, loaded otherwise, or declared wrongly."""


def main() -> None:
    """Fly, inspect with and without the declared aircraft, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=300)
    parser.add_argument("--seed", type=int, default=51501)
    parser.add_argument("--mode", choices=draw.MODES, action="append")
    arguments = parser.parse_args()
    declared = aircraft.load("gtm")
    for mode in arguments.mode or MODES:
        flown = 0
        refused: list[str] = []
        bare: list[str] = []
        for number in range(arguments.flights):
            try:
                log = draw.fly(draw.draw(arguments.seed, number, mode))
            except LeftRangeError:  # the aircraft departs beyond the tables
                continue
            flown += 1
            for aeroplane, found in ((declared, refused), (None, bare)):
                certain = [fault.sentence for fault in inspect(log, aeroplane) if fault.certain]
                found += [f"{mode} {number}: {certain[0]}"] if certain else []
        print(f"{mode}: {flown} flights, refused {len(refused)}, without the declared aircraft {len(bare)}")
        print("\n".join(refused + bare))


if __name__ == "__main__":
    main()
