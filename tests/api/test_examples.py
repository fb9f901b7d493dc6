"""Each public function and method documents itself with an example that runs as written."""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import pytest

import airtruth as at

FUNCTIONS = {name: getattr(at, name) for name in at.__all__ if inspect.isfunction(getattr(at, name))}
METHODS = {f"FlightLog.{name}": getattr(at.FlightLog, name) for name in ("select", "concat", "to_frame")}
EXAMPLES = FUNCTIONS | METHODS
SLOW = ("trace", "close_loop")


@pytest.mark.grid
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in EXAMPLES]
)
def test_example_runs_as_written(name: str, workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(workspace)
    documented = EXAMPLES[name]
    (example,) = doctest.DocTestFinder(recurse=False).find(documented, name, globs={"at": at})
    assert example.examples, f"{name} has no example"
    output: list[str] = []
    results = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE).run(example, out=output.append)
    assert results.failed == 0, "".join(output)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_public_function_documents_arguments_and_errors(name: str) -> None:
    text = inspect.getdoc(FUNCTIONS[name]) or ""
    for section in ("Parameters", "Raises", "Examples"):
        assert f"\n{section}\n---" in text, f"{name}: no section {section}"
    for argument in inspect.signature(FUNCTIONS[name]).parameters:
        assert f"{argument} : " in text or f"{argument}, " in text or f", {argument} :" in text, argument
