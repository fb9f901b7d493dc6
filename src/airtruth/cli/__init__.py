"""The command line, a module per group of commands; scientific imports happen inside the commands."""

from airtruth.cli import (
    aircraft,
    export,
    fly,
    identify,
    importing,
    library,
    measured,
    new,
    plan,
    report,
    schema,
    trace,
    verify,
)
from airtruth.cli.application import app
from airtruth.cli.entry import main

__all__ = [
    "aircraft",
    "app",
    "export",
    "fly",
    "identify",
    "importing",
    "library",
    "main",
    "measured",
    "new",
    "plan",
    "report",
    "schema",
    "trace",
    "verify",
]
