"""How a child process of Python is started: it never imports a module from the working folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Final

HOME: Final = Path(__file__).resolve().parents[2]
"""Folder that holds the package airtruth: a working folder for child processes."""


def module_command(module: str, *arguments: str) -> list[str]:
    """Return the command that runs a module of airtruth in a new interpreter."""
    return [sys.executable, "-P", "-m", module, *arguments]


def environment(**changes: str) -> dict[str, str]:
    """Return the environment of a child process.

    Its PYTHONPATH begins with `HOME` and has no entry that means the working folder, because a file of a stranger in
    that folder could have the name of a module.

    Parameters
    ----------
    changes : variables to set.
    """
    stated = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    here = os.path.realpath(os.curdir)
    absolute = [os.path.abspath(entry) for entry in stated if entry]
    kept = [entry for entry in absolute if os.path.realpath(entry) not in (here, str(HOME))]
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(HOME), *kept]), **changes}


__all__ = ["HOME", "environment", "module_command"]
