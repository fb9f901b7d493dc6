"""Numbers and names of the signals of an identification; kernels read them, so the module imports nothing large."""

from __future__ import annotations

from typing import Final

COMMAND: Final = "elevator_command_rad"
"""Channel of the elevator command [rad]."""
ALPHA: Final = 0
"""Index of alpha [rad] among the signals."""
Q: Final = 1
"""Index of q [rad/s] among the signals."""
AZ: Final = 2
"""Index of az [g] among the signals."""
ELEVATOR: Final = 3
"""Index of the elevator [rad] among the signals."""

__all__ = ["ALPHA", "AZ", "COMMAND", "ELEVATOR", "Q"]
