"""Learned increments as effects of a library: a Python package of one module, which campaigns and traces can use."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from airtruth.channels import SIGNALS
from airtruth.effects.closed_form import ClosedForm, closed_forms
from airtruth.effects.increment import STEP
from airtruth.effects.increment_shape import signal_over, unit_over
from airtruth.errors import StoreError
from airtruth.logs import atomic
from airtruth.physics.terms import OUTPUTS
from airtruth.tracing.accepted import AcceptedEffect, IncrementTable
from airtruth.tracing.answer import Z95, TraceAnswer

MODULE: Final = "learned_effects"
"""Name of the module and of the package."""
_MEANINGS: Final = {"at": "value of the signal where it begins", "width": "width of the step"}
"""Location -> meaning."""
_RANGE: Final = 4.0
"""Largest size that the effect may take, over the learned one [-] (judgement: another aircraft of its kind)."""
_MATERIAL: Final = 0.2
"""Material size over the learned one [-] (judgement: a fifth of what was worth learning)."""
_TERMS: Final = {
    "break above": '({term}("{c}", "{s}", "above", values["slope"], values["at"]{by}),)',
    "break below": '({term}("{c}", "{s}", "below", values["slope"], values["at"]{by}),)',
    "step above": """(
            {term}("{c}", "{s}", "above", values["step"] / values["width"], values["at"]{by}),
            {term}("{c}", "{s}", "above", -values["step"] / values["width"], values["at"] + values["width"]{by}),
        )""",
    "step below": """(
            {term}("{c}", "{s}", "below", -values["step"] / values["width"], values["at"]{by}),
            {term}("{c}", "{s}", "below", values["step"] / values["width"], values["at"] - values["width"]{by}),
        )""",
    "curve": '({term}("{c}", "{s}", "quadratic", values["curvature"], {trim!r}{by}),)',
    "line": '({term}("{c}", "{s}", "linear", values["slope"], {trim!r}{by}),)',
    "share": """(
            {term}("{c}", "{s}", "linear", values["share"], {trim!r}),
            {term}("{c}", "{driver}", "linear", -values["share"], {trim!r}),
        )""",
}
"""Closed form -> terms, as Python."""


def effect_module(answer: TraceAnswer) -> str:
    """Text of a module with one effect for each learned increment of an answer.

    Raises
    ------
    StoreError
        If the answer has no learned increment.
    """
    learned = [e for e in answer.effects if e.acts_on is not None]
    if not learned:
        raise StoreError(
            f"the answer has no learned increment (its verdict is {answer.verdict!r}); `--from` writes effects from an "
            "answer whose verdict is 'learned'"
        )
    parts = [_HEAD]
    parts += [part for number, e in enumerate(learned, start=1) for part in _effect(e, number)]
    names = ", ".join(f"EFFECT_{number}" for number in range(1, len(learned) + 1))
    return "\n\n".join([*parts, "EFFECTS = (" + names + ",)\n"])


def write_effect_package(answer: TraceAnswer, out: Path) -> Path:
    """Write the module with a pyproject.toml that registers its effects; `pip install OUT` adds them to the library.

    Raises
    ------
    StoreError
        If the answer has no learned increment, or the folder cannot be written.
    """
    text = effect_module(answer)
    atomic.make_folder(out)
    atomic.write_text(out / f"{MODULE}.py", text)
    atomic.write_text(out / "pyproject.toml", _PROJECT.format(module=MODULE))
    return out


_HEAD: Final = '''"""Effects that `airtruth trace` learned from flight logs.

`pip install` of this folder adds them to the library: `airtruth effects` lists them, campaigns fly them, and
traces test them.
"""

from airtruth.effects.effect import Effect, Parameter
from airtruth.physics.terms import AeroTerm, Change, ReadingTerm, StateTerm
'''
"""First lines of a module."""
_PROJECT: Final = """[build-system]
requires = ["setuptools>=68"]
build-backend = "setuptools.build_meta"

[project]
name = "learned-effects"
version = "0.1"
dependencies = ["airtruth"]

[tool.setuptools]
py-modules = ["{module}"]

[project.entry-points."airtruth.effects"]
{module} = "{module}:EFFECTS"
"""
"""pyproject.toml of the package."""


def _effect(e: AcceptedEffect, number: int) -> Iterator[str]:
    """Function of the terms and the effect, as Python."""
    form = _form(e)
    acts_on = e.acts_on or ""
    over, factor = signal_over(acts_on, e.over or ""), signal_over(acts_on, e.by) if e.by else ""
    driver = factor if e.states and factor else over
    state = "-".join(
        ("learned", *(e.acts_on or "").split("_"), *driver.split("_"), *(s.kind for s in e.states))
    )
    signal = state if e.states and not factor else over
    trim = e.table.origin if e.table is not None else 0.0
    by = f', behind="{state}"' if e.states else f', "{factor}", {e.by_at!r}'
    by = by if factor else ""
    field, term = ("readings", "ReadingTerm") if e.acts_on in OUTPUTS else ("aero", "AeroTerm")
    values = {name: p.value for name, p in e.parameters.items()} if form is None else form.values
    sizes = {k: v for k, v in values.items() if k not in ("at", "width", "time_s", "damping", "half_width")}
    if form is not None:
        terms = _TERMS[form.name].format(term=term, c=e.acts_on, s=signal, driver=driver, trim=trim, by=by)
        sentence = (
            f"Closed form of the learned table ({form.name}): chi-square {form.statistic:.3g} over "
            f"{form.degrees} degrees of freedom.{_beyond(form, e)}"
        )
    elif e.table is None:
        terms = _TERMS["share"].format(term=term, c=e.acts_on, s=signal, driver=driver, trim=0.0)
        sentence = "Linear part behind a state."
    else:
        terms = _of_table(f'{term}("{e.acts_on}"', e.table, signal, by)
        sizes, values = {"factor": 1.0}, {"factor": 1.0}
        sentence = "No closed form is as good as the learned table, so the effect scales the table."
    states = "".join(
        f'StateTerm("{state}", "{s.kind}", "{driver}", {s.time_s!r}, {s.damping!r}, {s.half_width!r}),'
        for s in e.states
    )
    yield (
        f"def _terms_{number}(values):\n    return Change(\n        states=({states}),\n        {field}={terms},\n    )\n"
    )
    locations = {k: values[k] for k in ("at", "width") if k in values}
    parameters = [_size(name, value, _unit(name, acts_on, factor, over)) for name, value in sizes.items()]
    if e.table is not None:
        unit = unit_over(over) or "-"
        parameters += [_location(name, value, unit, e.table) for name, value in locations.items()]
    lines = "".join(f"        {p},\n" for p in parameters)
    yield (
        f"EFFECT_{number} = Effect(\n"
        f'    name="learned_{(e.acts_on or "").lower()}_{f"{factor}_" if factor else ""}{over}",\n'
        f'    variant="{"-".join(s.kind for s in e.states)}",\n'
        f'    where="{"sensor" if e.acts_on in OUTPUTS else "dynamics"}",\n    parameters=(\n{lines}    ),\n'
        f"    describe=_terms_{number},\n"
        f'    explanation="Learned from flight logs: {e.variant}.",\n'
        f'    source="{sentence}",\n)\n'
    )


def _beyond(form: ClosedForm, e: AcceptedEffect) -> str:
    """A sentence on the flight outside the learned range, where a line, a break and a curve go on and a step does not."""
    if e.table is None or form.name.startswith("step"):
        return ""
    unit = unit_over(signal_over(e.acts_on or "", e.over or ""))
    ends = " to ".join(f"{end:.4g}" for end in (e.table.at[0], e.table.at[-1]))
    return f" Learned from {ends}{unit and ' '}{unit}; it extrapolates outside this range."


def _form(e: AcceptedEffect) -> ClosedForm | None:
    """The best closed form that is as good as the table; None where there is none."""
    if e.table is None:
        return None
    t = e.table
    if STEP in e.parameters:
        return _step_of(t)
    rows = zip(t.low, t.high, t.samples, strict=True)
    std = [(high - low) / (2.0 * Z95) if n else math.inf for low, high, n in rows]
    return next(
        (f for f in closed_forms(t.at, t.value, std, t.origin, of_pair=e.by is not None) if f.is_as_good),
        None,
    )


def _step_of(table: IncrementTable) -> ClosedForm:
    """The step whose rise over one cell is all that the table has, but for a constant, which belongs to the trim."""
    first = table.steepest
    low, high = table.at[first : first + 2]
    rise, width = table.value[first + 1] - table.value[first], high - low
    if high > table.origin:
        return ClosedForm("step above", {"step": rise, "at": low, "width": width}, 0.0, 0)
    return ClosedForm("step below", {"step": -rise, "at": high, "width": width}, 0.0, 0)


def _of_table(term: str, table: IncrementTable, signal: str, by: str) -> str:
    """Terms of a table with a common factor: its slope at the trim and its bends on either side of it.

    ``term`` is how each term begins, ``by`` how it ends.
    """
    points, trim = list(table.at), table.origin
    pieces = zip(pairwise(points), pairwise(table.value), strict=True)
    slopes = [(b - a) / (y - x) for (x, y), (a, b) in pieces]
    bends = [after - before for before, after in zip([0.0, *slopes], [*slopes, 0.0], strict=True)]
    own = slopes[min(max(bisect_right(points, trim) - 1, 0), len(slopes) - 1)]
    hinges = [
        ("above" if x > trim else "below", bend if x > trim else -bend, x)
        for x, bend in zip(points, bends, strict=True)
    ]
    if points[0] <= trim < points[-1]:
        hinges += [("above", own, trim), ("below", own, trim)]
    rows = "".join(
        f'            {term}, "{signal}", "{side}", {slope!r} * values["factor"], {x!r}{by}),\n'
        for side, slope, x in hinges
    )
    return f"(\n{rows}        )"


def _unit(size: str, acts_on: str, factor: str, over: str) -> str:
    """Unit of a size: of a step, of a slope or share over a signal, of a curvature, or of a factor."""
    if size == "factor":
        return "-"
    of_derivative = factor and acts_on not in OUTPUTS
    above = SIGNALS[acts_on].unit if acts_on in OUTPUTS and not factor else ""
    signals = [factor] if of_derivative else []
    signals += [over] * {"step": 0, "slope": 1, "share": 1, "curvature": 2}[size]
    below = [unit for unit in map(unit_over, signals) if unit]
    return "/".join([above or ("1" if below else "-"), *below])


def _size(name: str, value: float, unit: str) -> str:
    reach = max(_RANGE * abs(value), 1e-9)
    return (
        f'Parameter("{name}", "-", "{name} [{unit}], learned: {value:.4g}", low={-reach!r}, high={reach!r}, '
        f"material={_MATERIAL * abs(value)!r}, step={0.1 * abs(value)!r})"
    )


def _location(name: str, value: float, unit: str, table: IncrementTable) -> str:
    span = table.at[-1] - table.at[0]
    low, high = (table.at[0], table.at[-1]) if name == "at" else (min(0.05 * span, value), max(span, value))
    return (
        f'Parameter("{name}", "-", "{_MEANINGS[name]} [{unit}], learned: {value:.4g}", low={low!r}, high={high!r}, material=0.0, '
        f"is_location=True, step={0.05 * span!r}, default={value!r})"
    )


__all__ = ["MODULE", "effect_module", "write_effect_package"]
