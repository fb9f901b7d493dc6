"""make robustness: kill commands, damage campaigns, and compare every file with the undisturbed one.

    python -m validation.robustness --kills 200 --damages 150 --seed 1

The exit code is 1 if a file differs, is left over or is damaged without being named.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from airtruth.simulation.campaign.plan import make
from airtruth.simulation.campaign.run import fly
from validation.robustness.damages import run_damages
from validation.robustness.kills import ROOT, prepared_verbs, run_kills


def main() -> int:
    """Run both parts; faulty trials stay in the scratch folder."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--damages", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--verb", action="append", help="kill only this command; may be repeated")
    given = parser.parse_args()
    scratch = Path(tempfile.mkdtemp(prefix="robustness-"))
    print(f"scratch folder {scratch}", flush=True)
    faults = 0
    if given.damages:
        plan = make(ROOT / "data" / "campaigns" / "light.toml", runs=20)
        fly(plan, scratch / "whole")
        faults += run_damages(scratch / "whole", plan, scratch, given.damages, given.seed)
    if given.kills:
        faults += run_kills(prepared_verbs(scratch / "kills", given.verb), scratch, given.kills, given.seed)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
