"""Write the keys of trace.json into docs/trace_keys.md, and the constants that decide into docs/theory/trace_rules.md.

    python -m scripts.trace_tables

The keys are those of the docstrings of the classes that trace.json holds, the rules those of the documented constants of
the modules that decide.
"""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Final

from airtruth.tracing import accepted, answer, stage_errors
from airtruth.tracing.criterion import CRITERION, AnswerCriterion

ROOT: Final = Path(__file__).resolve().parents[1]
"""Root of the repository."""

KEYS_PAGE: Final = ROOT / "docs" / "trace_keys.md"
"""The page that has the keys."""

RULES_PAGE: Final = ROOT / "docs" / "theory" / "trace_rules.md"
"""The page that has the rules."""

CLASSES: Final = {
    "top level": answer.TraceAnswer,
    "`anomaly`, `remaining`": answer.Evidence,
    "`declared_model`": answer.DeclaredModel,
    "`declared_model.shifts`, each": answer.DerivativeShift,
    "`effects`, each": accepted.AcceptedEffect,
    "`effects[].parameters`, each": accepted.ParameterEstimate,
    "`effects[].table`": accepted.IncrementTable,
    "`effects[].states`, each": accepted.IncrementState,
    "`candidates`, each": answer.CandidateScore,
    "`error`, each stage and set": stage_errors.Rms,
    "`tolerances`, each stage and set": stage_errors.Excursions,
}
"""Part of trace.json -> class whose docstring describes its keys."""

DECIDING: Final = (
    "tracing/answer.py",
    "tracing/anomalies/*.py",
    "tracing/calibration/*.py",
    "tracing/confirmation.py",
    "tracing/friction.py",
    "tracing/learning/*.py",
    "tracing/record_differences.py",
    "tracing/reservations.py",
    "tracing/selection/*.py",
)
"""Modules of the package whose constants decide what a trace answers."""


def attributes(documented: type) -> list[tuple[str, str]]:
    """Names and descriptions in the section "Attributes" of a class, several names of one entry together.

    Raises
    ------
    ValueError
        If the class has no such section.
    """
    text = inspect.getdoc(documented) or ""
    if "Attributes\n----------\n" not in text:
        raise ValueError(f"{documented.__name__} has no section Attributes")
    section = text.split("Attributes\n----------\n")[1]
    entries = re.split(r"\n(?=\S)", section.strip())
    joined = [" ".join(entry.split()) for entry in entries]
    parts = [part for entry in joined for part in re.split(r"; (?=\w+(?:, \w+)* : )", entry)]
    return [(names, meaning) for names, _, meaning in (part.partition(" : ") for part in parts)]


def keys() -> str:
    """Tables of the keys, a heading for each part."""
    parts = []
    for part, documented in CLASSES.items():
        rows = [
            f"| `{names.replace(', ', '`, `')}` | {_cell(meaning)} |"
            for names, meaning in attributes(documented)
        ]
        parts.append(
            "\n".join([f"## {part[0].upper()}{part[1:]}", "", "| key | content |", "|---|---|", *rows])
        )
    return "\n\n".join(parts) + "\n"


def rules() -> str:
    """Tables of the numbers that decide, a heading for each module."""
    own = [
        f"| `{name}` | {getattr(CRITERION, name)} | {_cell(meaning)} |"
        for name, meaning in attributes(AnswerCriterion)
    ]
    head = (
        "`airtruth.tracing.criterion.AnswerCriterion`: constants that decide what a trace answers; the provenance of a result "
        "states them"
    )
    parts = [
        "\n".join(
            ["## criterion", "", f"{head}.", "", "| constant | value | meaning |", "|---|---|---|", *own]
        )
    ]
    paths = [path for pattern in DECIDING for path in sorted((ROOT / "src" / "airtruth").glob(pattern))]
    for path in paths:
        rows = [f"| `{name}` | {value} | {_cell(text)} |" for name, value, text in _numbers(path)]
        if rows:
            module = path.relative_to(ROOT / "src").with_suffix("").as_posix().replace("/", ".")
            head = (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n\n")[0]
            table = ["| constant | value | meaning |", "|---|---|---|", *rows]
            parts.append(
                "\n".join([f"## {path.stem}", "", f"`{module}`: {' '.join(head.split())}", "", *table])
            )
    return "\n\n".join(parts) + "\n"


def _numbers(path: Path) -> Iterator[tuple[str, str, str]]:
    """Name, source text and docstring of each documented constant of a module that is a number or a tuple of numbers."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for node, after in pairwise(body):
        if not (
            isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None
        ):
            continue
        leaves = [n for n in ast.walk(node.value) if isinstance(n, ast.Constant)]
        if not leaves or not all(
            isinstance(n.value, int | float) and not isinstance(n.value, bool) for n in leaves
        ):
            continue
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
            yield node.target.id.strip("_"), ast.unparse(node.value), str(after.value.value)


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|").rstrip(".")


def with_part(page: str, text: str) -> str:
    """The page with a generated part between its marks."""
    begin, end = "<!-- generated: begin -->\n", "<!-- generated: end -->"
    before, rest = page.split(begin)
    _, after = rest.split(end)
    return f"{before}{begin}\n{text}\n{end}{after}"


PAGES: Final = {KEYS_PAGE: keys, RULES_PAGE: rules}
"""Page -> its generated part."""


if __name__ == "__main__":
    for page, made in PAGES.items():
        page.write_text(with_part(page.read_text(encoding="utf-8"), made()), encoding="utf-8")
