"""The result of a trace: the answer, the records and stages behind it, and its text, table and figures."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airtruth.logs.atomic import write_text
from airtruth.logs.histories import Histories
from airtruth.logs.provenance import Provenance
from airtruth.result import shortened
from airtruth.tracing.accepted import AcceptedEffect
from airtruth.tracing.answer import ANSWER, TraceAnswer
from airtruth.tracing.prepare import Case
from airtruth.tracing.presentation.brief import as_brief_text
from airtruth.tracing.presentation.html import as_trace_html
from airtruth.tracing.presentation.several import by_motion, html_under_headings, under_headings
from airtruth.tracing.presentation.text import as_trace_text
from airtruth.tracing.selection.rounds import SearchRound
from airtruth.tracing.stages import Stages

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class TraceResult:
    """A finished trace; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    answer : what trace.json states.
    rounds : rounds of the search, the last without an accepted effect.
    stages : models of the report, assessed on every record.
    provenance : version, options and digests of the inputs.
    others : results of the other motions that the same logs answer; text and JSON have each under its name.
    """

    answer: TraceAnswer
    rounds: tuple[SearchRound, ...]
    stages: Stages
    provenance: Provenance = field(default_factory=Provenance)
    others: tuple[TraceResult, ...] = ()

    @property
    def motion(self) -> str:
        """Name of the motion."""
        return self.answer.motion.name

    @property
    def motions(self) -> dict[str, TraceResult]:
        """Name of each motion that is answered -> its result."""
        return {one.motion: one for one in (self, *self.others)}

    @cached_property
    def histories(self) -> Histories:
        """Every record beside the simulations of the stages."""
        from airtruth.tracing.presentation.trace_histories import trace_histories

        return trace_histories(self.answer, self.stages, self.provenance)

    @property
    def case(self) -> Case:
        """Records, declared aircraft and candidates."""
        return self.stages.case

    @property
    def verdict(self) -> str:
        """Verdict of the answer: "none", "traced", "one_of", "learned" or "unexplained"."""
        return self.answer.verdict

    @property
    def effects(self) -> tuple[AcceptedEffect, ...]:
        """Accepted effects of the answer, with the estimates of their parameters."""
        return self.answer.effects

    def summary(self) -> str:
        """The text that `airtruth trace` prints: one screen, the verdict first."""
        return under_headings(as_brief_text, self.answers)

    def details(self) -> str:
        """The text of `airtruth trace --verbose`: every table, candidate and note."""
        return under_headings(as_trace_text, self.answers)

    def to_frame(self) -> pd.DataFrame:
        """The candidates, one row each, most significant first."""
        import pandas as pd

        return pd.DataFrame([c.to_dict() for c in self.answer.candidates])

    @property
    def answers(self) -> list[TraceAnswer]:
        """Answer of each motion."""
        return [one.answer for one in self.motions.values()]

    def to_dict(self) -> dict[str, Any]:
        """The content of trace.json (docs/trace.md); for several motions, that of each under its name."""
        return dict(by_motion(self.answers))

    def plot(self) -> Figure:
        """Residuals of one record's free run: as declared, the effect, before and after."""
        from airtruth.charts import as_figure
        from airtruth.tracing.presentation.charts import trace_chart

        return as_figure(trace_chart(self.answer, self.histories))

    def write(self, out: Path) -> None:
        """Write the records and the errors into the folder of the trace, and trace.json at the end.

        Raises
        ------
        StoreError
            If a file cannot be written.
        """
        from airtruth.tracing.presentation.files import mark_provisional, write_evidence

        write_evidence(self.answer, self.histories, out)
        mark_provisional(self.answer)
        write_text(out / ANSWER, self.answer.to_json())

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return html_under_headings(as_trace_html, self.answers)
