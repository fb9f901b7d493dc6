"""JSBSim without output: stdout belongs to results, and the probe of a model has shown its messages."""

from __future__ import annotations

import os
from typing import Any

import jsbsim


class _Silent(jsbsim.FGLogger):
    """Logger that discards JSBSim's messages."""

    def set_level(self, level: object) -> None:
        """Discard."""

    def message(self, message: str) -> None:
        """Discard."""

    def file_location(self, filename: str, line: int) -> None:
        """Discard."""

    def format(self, format: object) -> None:
        """Discard."""

    def flush(self) -> None:
        """Discard."""


jsbsim.set_logger(_Silent())


def no_files(fdm: Any) -> None:
    """Discard the output files that some models write at every start."""
    number = 0
    while fdm.set_output_filename(number, os.devnull):
        number += 1
    fdm.disable_output()


__all__ = ["no_files"]
