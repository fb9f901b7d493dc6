"""The result of a closed loop: its table, chart and files."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from airtruth.identification.result import IdentificationResult
from airtruth.identification.store import write_estimates
from airtruth.logs.atomic import make_folder, write_text
from airtruth.loop.changes import DerivativeChange
from airtruth.loop.layout import NAME, loop_chart, loop_table
from airtruth.result import shortened
from airtruth.table import Table, as_html, as_text, write_table
from airtruth.tracing import TraceResult
from airtruth.tracing.accepted import AcceptedEffect
from airtruth.tracing.compensate import Treatment
from airtruth.tracing.presentation.html import verdict_html
from airtruth.tracing.presentation.text import effect_line, verdict

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

OUTPUTS: Final = (
    "estimates-before.parquet",
    "estimates-after.parquet",
    *(f"{NAME}.{suffix}" for suffix in ("json", "md", "csv", "tex")),
)
"""Files of a loop, beside those of its trace."""


@dataclass(frozen=True)
class LoopResult:
    """A closed loop; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    trace : the trace of the records.
    treatments : treatment of each traced effect.
    before, after : estimates of every run by every method.
    changes : every derivative by every method, before and after, and by the same method on simulated records.
    others : loops of the other motions that the same logs answer.
    """

    trace: TraceResult
    treatments: tuple[Treatment, ...]
    before: IdentificationResult
    after: IdentificationResult
    changes: tuple[DerivativeChange, ...]
    others: tuple[LoopResult, ...] = ()

    @property
    def motion(self) -> str:
        """Name of the motion."""
        return self.trace.motion

    @property
    def motions(self) -> dict[str, LoopResult]:
        """Name of each motion that is answered -> its loop."""
        return {one.motion: one for one in (self, *self.others)}

    def table(self) -> Table:
        """The derivatives of every method before and after, beside the declared ones."""
        return loop_table(self.changes, self.treatments, self.trace.answer.derivatives)

    @property
    def verdict(self) -> str:
        """Verdict of the trace."""
        return self.trace.verdict

    @property
    def effects(self) -> tuple[AcceptedEffect, ...]:
        """Accepted effects of the trace."""
        return self.trace.effects

    def summary(self) -> str:
        """Verdict, effects and the table of before and after, of several motions each under its heading."""
        if self.others:
            return "\n\n".join(
                f"{one.trace.answer.motion.heading}\n\n{replace(one, others=()).summary().rstrip()}"
                for one in self.motions.values()
            )
        answer = self.trace.answer
        lines = [verdict(answer), *(effect_line(e) for e in answer.effects), ""]
        if not self.treatments:
            why = (
                "The accepted effects change no channel of a regression"
                if answer.effects
                else "No effect was accepted"
            )
            lines += [f"{why}, so the estimates after are those before.", ""]
        return "\n".join([*lines, as_text(self.table())])

    def to_frame(self) -> pd.DataFrame:
        """One row per method and derivative, the fields of `airtruth.loop.DerivativeChange`."""
        import pandas as pd

        return pd.DataFrame([asdict(c) for c in self.changes])

    def to_dict(self) -> dict[str, Any]:
        """The content of loop.json: trace, treatments and changes of the derivatives; of several motions each under its name."""
        if self.others:
            return {name: replace(one, others=()).to_dict() for name, one in self.motions.items()}
        changes = [{k: _finite(v) for k, v in asdict(c).items()} for c in self.changes]
        return {
            "trace": self.trace.to_dict(),
            "treatments": [asdict(t) for t in self.treatments],
            "estimates": changes,
        }

    def plot(self) -> Figure:
        """Every derivative by every method before and after, with two standard errors, and the declared value."""
        from airtruth.charts import as_figure

        return as_figure(loop_chart(self.changes))

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return verdict_html(self.trace.answer) + as_html(self.table())

    def write(self, out: Path) -> tuple[Path, ...]:
        """Write the estimates, loop.json and the table (.md, .csv, .tex) into a folder.

        Raises
        ------
        StoreError
            If a file cannot be written.
        """
        make_folder(out)
        paths = [out / name for name in OUTPUTS[:3]]
        for path, result in zip(paths, (self.before, self.after), strict=False):
            write_estimates(path, result, merge=False)
        write_text(paths[2], json.dumps(self.to_dict(), indent=1, allow_nan=False) + "\n")
        return (*paths, *write_table(self.table(), out, NAME))


def _finite(value: object) -> object:
    return None if isinstance(value, float) and not math.isfinite(value) else value


__all__ = ["OUTPUTS", "LoopResult"]
