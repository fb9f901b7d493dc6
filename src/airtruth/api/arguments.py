"""Types of the arguments that the public functions share."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from airtruth.aircraft import Aircraft

    FilePath: TypeAlias = str | os.PathLike[str]
    """Path of a file or folder."""
    AircraftSource: TypeAlias = FilePath | Aircraft
    """Folder with aircraft.toml, that file, the name of a shipped aircraft, or a loaded aircraft."""
