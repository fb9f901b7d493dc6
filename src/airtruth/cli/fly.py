"""`airtruth fly`: campaigns flown in JSBSim."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final

import typer

from airtruth.cli.application import app
from airtruth.cli.arguments import PROCESSORS, CampaignFile, OnCluster, Quiet
from airtruth.cli.early import require_file
from airtruth.cli.output import notice, print_result
from airtruth.cli.progress import loading, progress_bar
from airtruth.errors import FAILED_RUNS

SHOWN_FAILURES: Final = 5
"""Failed runs whose reason is printed (judgement: a screen stays readable); the manifest lists all."""


@app.command(epilog="Example: airtruth fly data/campaigns/light.toml --out out/light --jobs 2")
def fly(
    campaign: CampaignFile,
    out: Annotated[
        Path,
        typer.Option(
            help="Folder of the campaign, or URL of one (s3://, gs://); the same command resumes an unfinished one."
        ),
    ],
    jobs: Annotated[
        int,
        typer.Option(
            min=1,
            help="Number of processes; the logs do not depend on it.",
            show_default="number of processors",
        ),
    ] = PROCESSORS,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed, instead of the file's.")] = None,
    runs: Annotated[int | None, typer.Option(min=1, help="Number of runs, instead of the file's.")] = None,
    cluster: OnCluster = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Check and print the plan, fly nothing.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Fly a campaign in JSBSim and write its flight logs."""
    with loading("fly", quiet):
        require_file(campaign, "campaign file", "`airtruth new campaign --out FILE.toml` writes one")
        from airtruth.cluster import workers
        from airtruth.logs.manifest import MANIFEST
        from airtruth.logs.remote import location
        from airtruth.simulation.campaign import plan as planning
        from airtruth.simulation.campaign import run as flying

    if dry_run:
        print_result(planning.describe(planning.make(campaign, seed, runs)))
        return
    out = location(out)
    with workers(cluster) as working, progress_bar("fly", "runs", quiet) as advance:
        result = flying.fly(campaign, out, jobs, seed, runs, advance, working)
    headline, *_ = result.summary().splitlines()
    print_result(headline)
    for sentence in () if quiet else result.repaired:
        notice(f"{out}/{sentence}; restored")
    ended = (*result.failures, *result.interrupted)
    for outcome in ended[:SHOWN_FAILURES]:
        notice(f"{outcome.run_id} {outcome.status}: {outcome.reason}")
    if len(ended) > SHOWN_FAILURES:
        notice(f"and {len(ended) - SHOWN_FAILURES} more, see {out / MANIFEST}")
    if ended:
        raise typer.Exit(FAILED_RUNS)
