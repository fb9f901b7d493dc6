"""The interface that every result shares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


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
