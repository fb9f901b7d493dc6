"""The interface that every result shares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final, Protocol, runtime_checkable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


MOST_LINES: Final = 20
"""Lines of a result at the prompt of an interpreter [-] (judgement: a screen keeps what was typed before)."""


def shortened(text: str) -> str:
    """Return a text of up to `MOST_LINES` lines; of a longer one the first lines, and how many are left out."""
    lines = text.rstrip().splitlines()
    if len(lines) <= MOST_LINES:
        return "\n".join(lines)
    left = len(lines) - MOST_LINES + 1
    return "\n".join([*lines[: MOST_LINES - 1], f"... {left} more lines: print(result.summary())"])


@runtime_checkable
class Result(Protocol):
    """A finished result of a verb: a frozen dataclass that prints, converts and draws itself."""

    def summary(self) -> str:
        """The answer as text, the conclusion first."""

    def to_frame(self) -> pd.DataFrame:
        """The main table, one row per estimate, cause, candidate or run."""

    def to_dict(self) -> dict[str, Any]:
        """Everything that a JSON file of this result holds."""

    def plot(self) -> Figure:
        """The figure that shows the answer."""

    def _repr_html_(self) -> str:
        """HTML for notebooks."""
