"""Mutation testing: how many small changes of the code the tests notice (`make mutants`).

    python -m scripts.mutants [MODULE ...] [--sample N | --all] [--seed S] [--jobs N]

cosmic-ray makes the mutants of each module in `TESTS`: an operator, a comparison, a number or a decorator changed,
one at a time. A mutant is killed if a test of the module fails or does not end. A seeded sample of the mutants is
run unless --all is given. Survivors are printed as differences. Kernels run as plain Python (NUMBA_DISABLE_JIT), since
a cached kernel would hide a mutant in a function that it inlines. Exit 1 if the score is below `LEAST`.
"""

from __future__ import annotations

import argparse
import os
import random
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from typing import Final

from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.plugins import get_operator, operator_names

ROOT: Final = Path(__file__).resolve().parents[1]
LEAST: Final = 0.85
"""Share of mutants that the tests have to kill [-]: the target of the project."""
TIMEOUT_S: Final = 240.0
"""A mutant whose tests take longer counts as killed [s]: several times the slowest unmutated run."""
COPIED: Final = ("src", "tests", "aircraft", "data", "scripts", "studies", "validation", "pyproject.toml")
"""Parts of the project that a test run reads."""
ARITHMETIC: Final = ("Add_Sub", "Sub_Add", "Mul_Div", "Div_Mul", "Pow_Mul", "FloorDiv_Mul", "Mod_Mul")
"""Arithmetic replacements that are made. The others fail on types or repeat these."""
SLOW_TOO: Final = "-mnot long and not study"
"""Option that adds the slow tests: a campaign that is killed or damaged is one of them."""
NO_DEVICES: Final = "--deselect=tests/logs/test_outputs.py::test_devices_and_links_are_not_replaced"
"""Option that leaves a test out: a mutant that fails it replaces /dev/null where the user is root."""
TESTS: Final[dict[str, tuple[str, ...]]] = {
    "physics/atmosphere": ("tests/physics/test_atmosphere.py",),
    "physics/short_period": ("tests/physics/test_short_period.py",),
    "physics/sensors": ("tests/physics/test_sensors.py",),
    "physics/actuators": ("tests/physics/test_actuators.py",),
    "physics/gust_figures": ("tests/physics/test_gust_figures.py",),
    "physics/dryden": (
        "tests/physics/test_dryden.py",
        "--deselect=tests/physics/test_dryden.py::test_simulated_spectrum",
    ),
    "identification/regression/solve": (
        "tests/identification/test_identify_regression.py",
        "tests/identification/test_identify_covariance.py",
        "-knot filter-error and not output-error",
    ),
    "identification/regression/covariance": (
        "tests/identification/test_identify_covariance.py",
        "-knot filter-error and not output-error",
    ),
    "simulation/campaign/run": (
        "tests/simulation/test_campaign_failures.py",
        "tests/simulation/test_campaign_killed.py",
        "tests/simulation/test_campaign_workers.py",
        "-knot all_its_processes and not ctrl_c",
        SLOW_TOO,
    ),
    "simulation/campaign/chunk": (
        "tests/simulation/test_campaign_failures.py",
        "tests/simulation/test_gust_in_flight.py",
        "tests/simulation/test_sensors_in_logs.py",
        "tests/simulation/test_log_contract.py",
        SLOW_TOO,
    ),
    "simulation/campaign/plan": (
        "tests/simulation/test_bad_campaigns.py",
        "tests/simulation/test_campaign_result.py",
        "tests/simulation/test_gust_in_flight.py",
        "tests/simulation/test_closed_loop.py",
        "tests/simulation/test_log_contract.py",
        SLOW_TOO,
    ),
    "logs/manifest": (
        "tests/logs/test_manifest.py",
        "tests/simulation/test_campaign_damaged.py",
        "tests/simulation/test_campaign_failures.py",
        SLOW_TOO,
    ),
    "logs/ledger": ("tests/logs/test_outputs.py", NO_DEVICES),
    "logs/outputs": ("tests/logs/test_outputs.py", NO_DEVICES),
    "logs/verify": ("tests/simulation/test_campaign_damaged.py", SLOW_TOO),
    "simulation/campaign/folder": (
        "tests/simulation/test_campaign_bytes.py",
        "tests/simulation/test_campaign_damaged.py",
        "tests/simulation/test_campaign_failures.py",
        "tests/simulation/test_campaign_killed.py",
        "-knot all_its_processes and not ctrl_c and not at_a_rename",
        SLOW_TOO,
    ),
    "simulation/campaign/workers": ("tests/simulation/test_campaign_workers.py", SLOW_TOO),
    "tracing/selection/evidence": (
        "tests/tracing/test_evidence.py",
        "tests/tracing/test_explanation.py",
        "-knot about_a_fit and not predicted_point",
    ),
    "tracing/anomalies/significance": ("tests/tracing/test_significance.py",),
    "tracing/selection/explanation": ("tests/tracing/test_explanation.py",),
}
"""Module below src/airtruth -> tests that have to notice a change of it."""


@dataclass(frozen=True)
class Mutant:
    """One change: the occurrence-th position of an operator in a module."""

    module: str
    operator: str
    arguments: tuple[tuple[str, object], ...]
    occurrence: int

    def applied(self, source: str) -> str | None:
        """Source with the change; None where the operator changes nothing."""
        from cosmic_ray.mutating import mutate_code

        changed = mutate_code(source, get_operator(self.operator)(**dict(self.arguments)), self.occurrence)
        return None if changed is None else str(changed)


def mutants(module: str) -> list[Mutant]:
    """All mutants of a module, in a fixed order."""
    tree = get_ast_from_path(ROOT / "src" / "airtruth" / f"{module}.py")
    result = []
    for name in sorted(operator_names()):
        kind = name.rpartition("/")[2]
        if kind.startswith("ReplaceBinaryOperator_") and not kind.endswith(ARITHMETIC):
            continue
        operator = get_operator(name)
        if operator.arguments():
            continue
        positions = [p for node in ast_nodes(tree) for p in operator().mutation_positions(node)]
        result += [Mutant(module, name, (), i) for i in range(len(positions))]
    return result


def copy_of_project(folder: Path) -> Path:
    """A copy that mutants may be written into."""
    for name in COPIED:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, folder / name)
    return folder


def run_tests(folder: Path, tests: tuple[str, ...]) -> tuple[bool, str]:
    """Whether the tests pass in a copy of the project, and their output."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", *tests]
    environment = os.environ | {
        "PYTHONPATH": str(folder / "src"),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_DISABLE_JIT": "1",
        "HYPOTHESIS_STORAGE_DIRECTORY": str(folder / ".hypothesis"),
    }
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False, "timeout"
    return done.returncode == 0, done.stdout[-2000:]


def survives(mutant: Mutant, folder: Path) -> str | None:
    """Difference that the tests did not notice, or None."""
    import difflib

    path = folder / "src" / "airtruth" / f"{mutant.module}.py"
    source = path.read_text(encoding="utf-8")
    changed = mutant.applied(source)
    if changed is None or changed == source:
        return None
    path.write_text(changed, encoding="utf-8")
    try:
        passed, _ = run_tests(folder, TESTS[mutant.module])
    finally:
        path.write_text(source, encoding="utf-8")
    if not passed:
        return None
    lines = difflib.unified_diff(source.splitlines(), changed.splitlines(), lineterm="", n=0)
    return "\n".join(line for line in lines if line[:2] not in ("--", "++"))


def score(modules: list[str], sample: int | None, seed: int, jobs: int) -> float:
    """Run the mutants of modules, print the table and the survivors; share killed over all modules."""
    total = killed = 0
    print(f"{'module':42s} mutants  run  killed  score")
    with tempfile.TemporaryDirectory() as scratch, ThreadPoolExecutor(jobs) as pool:
        copies: Queue[Path] = Queue()
        for i in range(jobs):
            copies.put(copy_of_project(Path(scratch) / str(i)))

        def work(mutant: Mutant) -> str | None:
            folder = copies.get()
            try:
                return survives(mutant, folder)
            finally:
                copies.put(folder)

        for module in modules:
            folder = copies.get()
            passed, output = run_tests(folder, TESTS[module])
            copies.put(folder)
            if not passed:
                sys.exit(f"{module}: {shlex.join(TESTS[module])} fails without any mutant\n{output}")
            every = mutants(module)
            chosen = (
                every
                if sample is None
                else random.Random(f"{seed} {module}").sample(every, min(sample, len(every)))
            )
            left = [difference for difference in pool.map(work, chosen) if difference is not None]
            count = len(chosen) - len(left)
            total, killed = total + len(chosen), killed + count
            print(
                f"{module:42s} {len(every):7d} {len(chosen):4d} {count:7d}  {count / max(len(chosen), 1):.2f}",
                flush=True,
            )
            for difference in left:
                print("  survivor:\n    " + difference.replace("\n", "\n    "), flush=True)
    print(f"{'all':42s} {'':7s} {total:4d} {killed:7d}  {killed / max(total, 1):.3f}")
    return killed / max(total, 1)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "module", nargs="*", metavar="MODULE", help=f"one of {', '.join(TESTS)}; default: all"
    )
    parser.add_argument("--sample", type=int, default=40, help="mutants per module")
    parser.add_argument("--all", action="store_true", help="every mutant (hours)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options = parser.parse_args()
    unknown = [m for m in options.module if m not in TESTS]
    if unknown:
        parser.error(f"no tests are listed for {', '.join(unknown)}; choose from {', '.join(TESTS)}")
    share = score(
        options.module or list(TESTS), None if options.all else options.sample, options.seed, options.jobs
    )
    sys.exit(share < LEAST)


if __name__ == "__main__":
    main()
