"""Run the study; a module of this name, because processes that fly a truth do not import it."""

from __future__ import annotations

import argparse
import multiprocessing
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from studies.planned_ties.study import __doc__ as description
from studies.planned_ties.study import one, report, ties


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the study, or what is left of it, and print its table."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--blind", type=Path, required=True, help="folder of validation.blind")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, required=True, help="of gusts and noise of the planned flights")
    parser.add_argument("--trials", type=int, default=1000, help="ties, in the order of the trials")
    parser.add_argument("--jobs", type=int, default=1)
    chosen = parser.parse_args(arguments)
    chosen.out.mkdir(parents=True, exist_ok=True)
    names = [name for name in ties(chosen.blind) if not (chosen.out / f"{name}.json").exists()]
    names = names[: max(chosen.trials - len(list(chosen.out.glob("*-*.json"))), 0)]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(chosen.jobs, mp_context=context) as pool:
        futures = [pool.submit(one, chosen.blind, name, chosen.out, chosen.seed) for name in names]
        for future in futures:
            print(future.result(), flush=True)
    print(report(chosen.out))


if __name__ == "__main__":
    main()
