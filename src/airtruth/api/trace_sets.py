"""Many sets of records, each traced by itself: one folder for each set, and one table of the answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from airtruth.api.trace_tasks import Ended, TraceTask, attempt, attempted_on
from airtruth.charts import Bar, Chart, Panel
from airtruth.cluster import Cluster
from airtruth.errors import ConfigurationError, LogError, StoreError
from airtruth.logs.histories import FILE, read_histories
from airtruth.logs.outputs import writing
from airtruth.logs.provenance import PROVENANCE, Provenance
from airtruth.result import shortened
from airtruth.table import Table, as_html, as_text, flat, to_frame, write_table
from airtruth.tracing.answer import ANSWER, TraceAnswer
from airtruth.tracing.motions import MotionTrace, parts_of
from airtruth.tracing.presentation.files import ERRORS
from airtruth.tracing.presentation.several import by_motion
from airtruth.tracing.presentation.text import effect_line
from airtruth.tracing.run import provenance_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from airtruth.aircraft import Aircraft
    from airtruth.tracing import TraceOptions

NAME: Final = "traces"
"""Name of the table's files."""
FAILED: Final = "failed"
"""Entry of a set without an answer, in the place of its verdict."""
Progress = Callable[[int, int, int], None]
"""Called with the number of sets that are done, of all sets, and of those that failed."""


@dataclass(frozen=True)
class TracedSet:
    """One set of records.

    Attributes
    ----------
    name : of its folder below the output folder.
    answer : what trace.json states; None if the set has no answer.
    error : why it has none.
    others : answers of the other motions that the same records excite.
    """

    name: str
    answer: TraceAnswer | None
    error: str = ""
    others: tuple[TraceAnswer, ...] = ()

    @property
    def answers(self) -> tuple[TraceAnswer, ...]:
        """Answer of each motion; none if the set has none."""
        return () if self.answer is None else (self.answer, *self.others)


@dataclass(frozen=True)
class TracedSets:
    """The answers to many sets of records; satisfies `airtruth.result.Result`.

    Attributes
    ----------
    sets : in the order of the arguments.
    """

    sets: tuple[TracedSet, ...]

    @property
    def failed(self) -> tuple[TracedSet, ...]:
        """Sets without an answer."""
        return tuple(s for s in self.sets if s.answer is None)

    @property
    def verdicts(self) -> Mapping[str, int]:
        """Number of answers with each verdict, and of sets without one."""
        failed = [FAILED for s in self.sets if s.answer is None]
        return Counter([*(a.verdict for s in self.sets for a in s.answers), *failed])

    def table(self) -> Table:
        """One row for each answer: verdict, effects with sizes, and the p-value of the declared model."""
        several = any(s.others for s in self.sets)
        columns = (
            "set",
            *(("motion",) if several else ()),
            "verdict",
            "provisional",
            "p declared",
            "effects",
        )
        rows = [row for s in self.sets for row in _rows(s, several)]
        return flat(f"{len(self.sets)} sets of records", columns, rows)

    def summary(self) -> str:
        """The number of sets with each verdict, then the table."""
        counts = ", ".join(f"{count} {name}" for name, count in sorted(self.verdicts.items()))
        return f"{len(self.sets)} sets of records traced: {counts}.\n\n{as_text(self.table())}"

    def to_frame(self) -> pd.DataFrame:
        """The table."""
        return to_frame(self.table())

    def to_dict(self) -> dict[str, Any]:
        """Name of a set -> its trace.json, or the reason why it has none under the key "error"."""
        return {s.name: dict(by_motion(s.answers)) if s.answers else {"error": s.error} for s in self.sets}

    def plot(self) -> Figure:
        """Number of sets with each verdict."""
        from airtruth.charts import as_figure

        names = tuple(sorted(self.verdicts))
        counts = [self.verdicts[name] for name in names]
        bars = tuple(Bar(row, float(n), words=str(n)) for row, n in enumerate(counts))
        panel = Panel(x_label="number of sets [-]", rows=names, bars=bars)
        return as_figure(Chart(NAME, f"Verdicts of {len(self.sets)} sets of records", (panel,), columns=1))

    def __repr__(self) -> str:
        """Return the first lines of the summary."""
        return shortened(self.summary())

    def _repr_html_(self) -> str:
        return as_html(self.table())


def trace_sets(
    sets: Sequence[Path],
    aircraft: Aircraft,
    options: TraceOptions,
    out: Path,
    *,
    force: bool = False,
    cluster: Cluster | None = None,
    advance: Progress = lambda done, total, failed: None,
) -> TracedSets:
    """Trace each set of records into a folder of its name, and write the table of all (traces.csv, .md, .tex).

    A set whose folder holds an answer by the same version, options and inputs is not traced again, so that the
    same command continues after an interruption. An error of one set is stated in its row; the others go on.

    Parameters
    ----------
    sets : files and folders of logs, one for each set.
    aircraft : the declared aircraft.
    options : choices of every trace.
    out : folder of the folders.
    force : see `airtruth.api.trace_tasks.TraceTask`; sets with an answer are traced again.
    cluster : whose workers trace, in place of this process.
    advance : receives the progress.

    Raises
    ------
    ConfigurationError
        If two sets have the same name.
    StoreError
        If the table cannot be written.
    """
    tasks = {
        name: TraceTask((path,), aircraft, options, out / name, force) for name, path in _named(sets).items()
    }
    with writing("trace", sets, force=force) as outputs:
        outputs.require(*(out / f"{NAME}.{suffix}" for suffix in ("csv", "md", "tex")))
        found = {name: _earlier(task) for name, task in tasks.items()}
        left = {name: task for name, task in tasks.items() if found[name] is None}
        done, failed = len(tasks) - len(left), 0
        advance(done, len(tasks), failed)
        for task, ended in _attempted(list(left.values()), cluster):
            found[task.out.name] = _traced(task, ended)
            done, failed = done + 1, failed + (ended.error is not None)
            advance(done, len(tasks), failed)
        result = TracedSets(tuple(one for name in tasks if (one := found[name]) is not None))
        write_table(result.table(), out, NAME)
    return result


def _attempted(tasks: list[TraceTask], cluster: Cluster | None) -> Iterator[tuple[TraceTask, Ended]]:
    if cluster is not None:
        return attempted_on(cluster, tasks)
    return ((task, attempt(task)) for task in tasks)


def _named(sets: Sequence[Path]) -> dict[str, Path]:
    """Name of each set, that of its file or folder."""
    found: dict[str, Path] = {}
    for path in sets:
        name = path.resolve().name if path.is_dir() else path.stem
        if name in found:
            raise ConfigurationError(
                f"--each: {found[name]} and {path} have the same name {name!r}, which names their folder; rename one, or "
                "trace it into another --out"
            )
        found[name] = path
    return found


def _earlier(task: TraceTask) -> TracedSet | None:
    """The set if its folder holds answers of the same version, options and inputs."""
    if task.force:
        return None
    try:
        parts = parts_of(task.logs, task.aircraft, task.options)
        if all(_is_answered(task, part) for part in parts):
            return _read(task)
    except (StoreError, LogError, ConfigurationError):
        pass
    return None


def _is_answered(task: TraceTask, part: MotionTrace) -> bool:
    """Whether the folder of a motion holds its answer of the same version, options and inputs."""
    folder = part.into(task.out) or task.out
    if not all((folder / name).is_file() for name in (ANSWER, FILE, ERRORS)):
        return False
    stated = Provenance.read(read_histories(folder / FILE, "airtruth trace").facts.get(PROVENANCE))
    now = provenance_of(task.logs, task.aircraft, part.options)
    return replace(stated, folder=now.folder) == now  # the same bytes in another folder


def _traced(task: TraceTask, ended: Ended) -> TracedSet:
    if ended.error is not None:
        return TracedSet(task.out.name, None, str(ended.error))
    return _read(task)


def _read(task: TraceTask) -> TracedSet:
    first, *others = map(TraceAnswer.read, task.answers)
    return TracedSet(task.out.name, first, others=tuple(others))


def _rows(one: TracedSet, several: bool) -> Iterator[tuple[str, ...]]:
    """The rows of a set; ``several``: with the motion of each."""
    if not one.answers:
        yield (one.name, *([""] if several else []), FAILED, "", "", one.error.replace("\n", " "))
    for number, answer in enumerate(one.answers):
        effects = "; ".join(effect_line(e) for e in answer.effects)
        declared = answer.declared_model
        p_value = "" if declared is None else f"{declared.p_value:.2g}"
        motion = [answer.motion.name] if several else []
        name = "" if number else one.name
        yield (name, *motion, answer.verdict, "yes" if answer.provisional else "no", p_value, effects)


__all__ = ["FAILED", "NAME", "TracedSet", "TracedSets", "trace_sets"]
