"""Error classes and exit codes; a message states the fault, its location, the allowed values and the next step."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from typing import Final

FAILED_RUNS: Final = 1
"""Exit code of a command that finished with failed runs or unverified files, or whose reader closed the pipe [-]."""
USAGE: Final = 2
"""Exit code of wrong usage and of every `AirtruthError` [-]."""
UNEXPECTED: Final = 70
"""Exit code of an exception that airtruth did not foresee: EX_SOFTWARE of sysexits.h (BSD) [-]."""
INTERRUPTED: Final = 130
"""Exit code after Ctrl-C: 128 + SIGINT, as shells report it [-]."""
TERMINATED: Final = 143
"""Exit code after SIGTERM: 128 + SIGTERM, as shells report it [-]."""


class AirtruthError(Exception):
    """Base of every error that a user can correct; the command line prints it and exits with `exit_code`."""

    exit_code = USAGE


class ConfigurationError(AirtruthError):
    """A campaign, mapping or option cannot be used as written."""


class AircraftError(AirtruthError):
    """An aircraft folder or file is missing or malformed, or JSBSim refuses it."""


class TrimError(AirtruthError):
    """The trim at the requested condition does not exist or did not converge."""


class FlightError(AirtruthError):
    """A run left the range in which the simulation is valid."""


class LogError(AirtruthError):
    """A flight log breaks the log contract or contradicts physics."""


class StoreError(AirtruthError):
    """A file or folder cannot be read or written."""


LONGEST_REASON: Final = 200
"""Characters of a library's message that an error quotes (judgement: two lines of a terminal)."""


def reason(error: BaseException) -> str:
    """Return the message of another library's exception in one line; its class where there is no message."""
    return " ".join(str(error).split())[:LONGEST_REASON].rstrip(".") or type(error).__name__


def counted(number: int, noun: str) -> str:
    """Return ``1 run`` or ``2 runs``, of a noun whose plural ends in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


MOST_HINTS: Final = 3
"""Names that are offered because they contain a wrong one [-] (judgement: a line of a terminal)."""


def choices(wrong: str, allowed: Iterable[str]) -> str:
    """Return "did you mean ...? allowed: ..." for a misspelt name.

    Parameters
    ----------
    wrong : the misspelt name.
    allowed : the names that exist.
    """
    names = sorted(allowed)
    plain = {name.lower(): name for name in reversed(names)}
    word = wrong.strip().lower()
    near = [plain[n] for n in difflib.get_close_matches(word, plain, n=2, cutoff=0.6)]
    near = near or ([name for name in names if word in name.lower()][:MOST_HINTS] if len(word) > 1 else [])
    hint = f"did you mean {' or '.join(repr(n) for n in near)}? " if near else ""
    return f"{hint}allowed: {', '.join(names)}"
