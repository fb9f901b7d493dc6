"""Arguments and options that several commands share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Final, Literal

import typer

from airtruth.cli.completion import METHOD_NAMES, complete_aircraft, complete_effect, complete_method

MotionName = Literal["longitudinal", "lateral"]
"""Choices of --motion, those of `airtruth.physics.motion.MOTIONS`."""
Condition = Literal["motion", "record", "window"]
"""Choices of --condition, those of `airtruth.identification.options.CONDITIONS`."""
Covariance = Literal["none", "paper", "white", "coloured", "corrected"]
"""Choices of --covariance, those of `airtruth.identification.options.COVARIANCE_NAMES`."""
Pressure = Literal["method", "constant", "measured"]
"""Choices of --pressure of identify, those of `airtruth.identification.options.PRESSURES`."""
PlanPressure = Literal["constant", "measured"]
"""Choices of --pressure of plan, those of `airtruth.identification.likelihood.options.PRESSURES`."""
TraceModel = Literal["aircraft", "linear"]
"""Choices of --model, those of `airtruth.tracing.options.MODELS`."""
Trim = Literal["intercept", "mean"]
"""Choices of --trim, those of `airtruth.identification.options.TRIMS`."""

PROCESSORS: Final = os.cpu_count() or 1
"""Default of --jobs: the processors of this machine [-]."""

Quiet = Annotated[bool, typer.Option("--quiet", help="No progress and no notices on stderr.")]
OnCluster = Annotated[
    str | None,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Work on a Dask cluster: local:N, tcp://HOST:PORT, tls://HOST:PORT or a scheduler file.",
    ),
]
Terms = Annotated[
    list[str] | None,
    typer.Option(
        "--term",
        metavar="NAME",
        help="Nonlinear term to free in the lateral coefficients, may be repeated: alpha, products with the angle of attack; "
        "beta, beta |beta|.",
    ),
]
OfMotion = Annotated[
    MotionName | None,
    typer.Option(
        "--motion",
        help="Motion to identify. Default: each that the records excite and have the channels for.",
    ),
]
TracedMotion = Annotated[
    MotionName | None,
    typer.Option(
        "--motion",
        help="Motion to trace. Default: each that the records excite and have the channels for.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]
CampaignFile = Annotated[
    Path, typer.Argument(metavar="CAMPAIGN.toml", help="Campaign file, see docs/campaigns.md.")
]
Declared = Annotated[
    str,
    typer.Option(
        "--aircraft",
        metavar="A",
        help="Folder with aircraft.toml, or a shipped name: gtm, c172x, f16, T38.",
        autocompletion=complete_aircraft,
    ),
]
LogFiles = Annotated[
    list[Path],
    typer.Argument(
        metavar="LOG...", help="Flight logs of one aircraft, campaign folders or folders of logs."
    ),
]
Methods = Annotated[
    list[str] | None,
    typer.Option(
        "--method",
        metavar="NAME",
        help=f"Estimator, may be repeated: {', '.join(METHOD_NAMES)}.",
        autocompletion=complete_method,
    ),
]
Force = Annotated[
    bool, typer.Option("--force", help="Use logs that contradict physics; the result lists the faults.")
]
ForceAndReplace = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Use logs that contradict physics, and replace files that this command did not write or that changed.",
    ),
]
Replace = Annotated[
    bool, typer.Option("--force", help="Replace files that this command did not write or that changed since.")
]
Model = Annotated[
    TraceModel,
    typer.Option(
        "--model", help="aircraft: forces probed in JSBSim; linear: the linear model of the motion."
    ),
]
HeldOut = Annotated[
    list[str] | None,
    typer.Option(
        "--hold-out",
        metavar="RUN_ID",
        help="Run to hold out of the fit; may be repeated. Default: every third run; with one or two runs, none.",
    ),
]
Threads = Annotated[
    int,
    typer.Option(
        "--jobs",
        min=1,
        help="Number of threads; the result does not depend on it.",
        show_default="number of processors",
    ),
]
TraceSeed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the draws behind the p-values.")]
Increments = Annotated[
    bool | None,
    typer.Option(
        "--increments/--no-increments",
        help="Learn increments from the residual of the named effects. Default: yes, if the whole library is searched.",
    ),
]
TimeBudget = Annotated[
    float | None,
    typer.Option(
        "--time-budget",
        metavar="S",
        min=0.0,
        help="Seconds after which the search starts no new step; the answer is then provisional and lists the omitted steps.",
    ),
]
Candidates = Annotated[
    list[str] | None,
    typer.Option(
        "--effect",
        metavar="KEY",
        help="Effect to test, may be repeated; default: all of `airtruth effects` except those of the gusts.",
        autocompletion=complete_effect,
    ),
]
