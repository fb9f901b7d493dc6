"""The table and the chart of a closed loop, and the sentences that explain its differences."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final

from airtruth.charts import Chart, Mark, Panel, Rule
from airtruth.loop.changes import DerivativeChange
from airtruth.physics.motion import Motion, motion_of
from airtruth.table import MISSING, Cell, Group, Interval, Number, Row, Table, Uncertain
from airtruth.tracing.answer import Derivatives
from airtruth.tracing.compensate import Treatment

NAME: Final = "loop"
"""Name of the table's files and of loop.json."""
REFIT: Final = "refit of the trace"
"""Row of the derivatives that the trace fitted with the effects."""


def loop_table(
    changes: Sequence[DerivativeChange], treatments: Sequence[Treatment], refit: Derivatives
) -> Table:
    """Return the derivatives of every method before and after, beside the declared ones.

    Parameters
    ----------
    changes : every derivative by every method.
    treatments : treatment of each traced effect, for the notes.
    refit : derivatives of the trace.
    """
    methods = list(dict.fromkeys(c.method for c in changes))
    cells = {(c.derivative, c.method): c for c in changes}
    groups = []
    motion = motion_of(refit.declared)
    for name in motion.parameters:
        own = [cells[name, method] for method in methods]
        groups.append(Group(name, (*(_row(c) for c in own), *([_refit_row(name, refit)] if own else []))))
    converged = [next(c for c in changes if c.method == m) for m in methods]
    counts: list[Row] = [
        (c.method, "", "", c.runs_before, c.runs_after, "", c.runs_compared) for c in converged
    ]
    return Table(
        title="Derivatives before and after the traced effects are taken out of the records",
        columns=(
            "",
            "declared",
            "declared, same inputs",
            "before",
            "after",
            "corrected, same inputs",
            "after less declared, same inputs",
        ),
        groups=(*groups, Group("runs", tuple(counts))),
        notes=tuple(_notes(changes, treatments, refit, motion)),
    )


def _row(c: DerivativeChange) -> Row:
    low, high = c.interval
    difference: Cell = MISSING
    if math.isfinite(low):
        difference = Interval(*(Number(x, digits=3) for x in (c.difference, low, high)))
    return (
        c.method,
        Number(c.declared),
        Number(c.declared_same_inputs),
        _estimate(c.before, c.before_error),
        _estimate(c.after, c.after_error),
        Number(c.corrected_same_inputs),
        difference,
    )


def _refit_row(name: str, refit: Derivatives) -> Row:
    after = _estimate(refit.after.get(name, math.nan), refit.after_std.get(name, math.nan))
    return (
        REFIT,
        Number(refit.declared.get(name, math.nan)),
        "",
        refit.before.get(name, math.nan),
        after,
        "",
        "",
    )


def _notes(
    changes: Sequence[DerivativeChange],
    treatments: Sequence[Treatment],
    refit: Derivatives,
    motion: Motion,
) -> Iterator[str]:
    yield (
        "before, after: mean over the converged runs +- its standard error; refit: estimate +- standard error "
        f"[{motion.derivative_units}]; brackets: 95 % interval over the runs."
    )
    yield from (f"{t.sentence}." for t in treatments)
    if not any(c.runs_compared for c in changes):
        yield "No record was simulated whole, so that the columns of the same inputs are empty."
        return
    yield (
        "same inputs: the declared and the corrected model, simulated without noise and gusts through the measured inputs and "
        "identified by the same method. The difference from `declared` is the error of the method with these inputs."
    )
    yield from _explained(changes, refit)
    yield (
        f"The two values after differ in what they are: the {REFIT} is the slope of the nonlinear model at the trim, "
        "from all fitted records together; a method fits one linear model to each run over the whole manoeuvre. "
        "`corrected, same inputs` is what the method makes of the refit."
    )


def _explained(changes: Sequence[DerivativeChange], refit: Derivatives) -> Iterator[str]:
    """Sentences that name the derivatives that still differ after, and why."""
    differing = [c for c in changes if c.runs_compared and c.differs]
    if not differing:
        yield (
            "No derivative after differs from the declared model with the same inputs: the 95 % interval of each contains zero."
        )
        return
    refitted = ", ".join(_moved(name, refit) for name in dict.fromkeys(c.derivative for c in differing))
    yield (
        f"Still different after from the declared model with the same inputs: {_by_derivative(differing, _share)}. The share of "
        f"the refit is that of the flown aircraft, whose derivatives are not the declared ones: the trace refits {refitted}."
    )
    rest = [c for c in differing if c.remains]
    if rest:
        yield (
            f"The rest exceeds its 95 % interval in {_by_derivative(rest, lambda c: c.method)}: noise and turbulence, which the "
            "simulations lack, bias the method there, or the corrected model lacks something."
        )


def _moved(name: str, refit: Derivatives) -> str:
    value = _estimate(refit.after.get(name, math.nan), refit.after_std.get(name, math.nan))
    return f"{name} from {Number(refit.declared.get(name, math.nan))} to {value}"


def _share(c: DerivativeChange) -> str:
    explained = c.difference - c.remaining
    return f"{c.method} ({Number(c.difference, digits=2)}, refit {Number(explained, digits=2)})"


def _by_derivative(changes: Sequence[DerivativeChange], words: Callable[[DerivativeChange], str]) -> str:
    named: dict[str, list[str]] = {}
    for c in changes:
        named.setdefault(c.derivative, []).append(words(c))
    return "; ".join(f"{name} by {', '.join(own)}" for name, own in named.items())


def loop_chart(changes: Sequence[DerivativeChange]) -> Chart:
    """Draw every derivative by every method before and after, with two standard errors, and the declared value."""
    methods = list(dict.fromkeys(c.method for c in changes))
    panels = []
    motion = motion_of([c.derivative for c in changes])
    for name in motion.parameters:
        own = [c for c in changes if c.derivative == name]
        marks = []
        for c in own:
            row = methods.index(c.method)
            two, reach = "two standard errors", (2.0 * c.before_error, 2.0 * c.after_error)
            marks += [
                Mark(
                    row - 0.2,
                    c.before,
                    c.before - reach[0],
                    c.before + reach[0],
                    None,
                    f"before, {two}",
                    "vermillion",
                ),
                Mark(row, c.after, c.after - reach[1], c.after + reach[1], None, f"after, {two}", "blue"),
                Mark(row + 0.2, c.declared_same_inputs, label="declared, same inputs", colour="ink"),
            ]
        rules = tuple(Rule(c.declared, label="declared") for c in own[:1])
        panels.append(
            Panel(
                x_label=f"{name} [{motion.units[name]}]", rows=tuple(methods), marks=tuple(marks), rules=rules
            )
        )
    title = "Derivatives before and after the traced effects are taken out"
    return Chart(NAME, title, tuple(panels), columns=3)


def _estimate(value: float, error: float) -> Uncertain:
    return Uncertain(Number(value), Number(error, digits=2))


__all__ = ["NAME", "REFIT", "loop_chart", "loop_table"]
