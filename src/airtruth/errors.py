"""Errors that a user can act on: what is wrong, where, what is allowed, and the next step."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class AirtruthError(Exception):
    """Base of every error that airtruth raises on purpose; the command line prints it and exits 2."""

    exit_code = 2


class ConfigurationError(AirtruthError):
    """A campaign, mapping or option that cannot be used as written."""


class AircraftError(AirtruthError):
    """An aircraft folder or file that is missing, malformed or that JSBSim refuses."""


class TrimError(AirtruthError):
    """No equilibrium exists, or none was found, at the stated condition."""


class FlightError(AirtruthError):
    """A run that left the range in which the simulation means anything."""


class LogError(AirtruthError):
    """A flight log that breaks the log contract."""


class StoreError(AirtruthError):
    """A file or folder that cannot be read or written."""


def choices(wrong: str, allowed: Iterable[str]) -> str:
    """Return "did you mean ...? allowed: ..." for a misspelt name.

    Parameters
    ----------
    wrong : the name that was given.
    allowed : the names that exist.
    """
    names = sorted(allowed)
    near = difflib.get_close_matches(wrong, names, n=2, cutoff=0.6)
    hint = f"did you mean {' or '.join(repr(n) for n in near)}? " if near else ""
    return f"{hint}allowed: {', '.join(names)}"
